"""Dense anisotropic BRDFs from a gonioreflectometer's frames or samples.

    samples = gonia.process("my-frames")
    dense = gonia.fill(samples, step=4, error=True)
    dense.query([[30, 45, 60, 225]])

Angles are degrees: polar angles from the normal, azimuths anticlockwise from the sample's x axis, of light
(theta_i, phi_i) and view (theta_v, phi_v). Values are in 1/sr where ``scale`` is "absolute", else relative.
Long functions take ``progress``, a function of a step's name and its share done (0 to 1); Ctrl-C ends them.
What is wrong is raised as :class:`GoniaError`, one line; what is odd is warned of (:class:`GoniaWarning`).
"""

from __future__ import annotations

import datetime
import os
import warnings
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _gonia
from ._gonia import GoniaError, __version__, set_threads

if TYPE_CHECKING:
    import xarray

Path = str | os.PathLike[str]
Progress = Callable[[str, float], object]

__all__ = [
    "Dense",
    "GoniaError",
    "GoniaWarning",
    "Samples",
    "calibrate",
    "compare",
    "fill",
    "fit",
    "process",
    "query",
    "read",
    "read_samples",
    "render",
    "set_threads",
    "__version__",
]

_ORIGINS = ("measured", "reciprocal", "interpolated", "extrapolated", "symmetric")


class GoniaWarning(UserWarning):
    """What was assumed of data, or speaks against what they are taken for."""


def _warn(remarks: Iterable[str]) -> None:
    for remark in remarks:
        warnings.warn(remark, GoniaWarning, stacklevel=3)


def _rows(array: ArrayLike, what: str) -> NDArray[np.float64]:
    rows = np.asarray(array)
    if rows.dtype.kind not in "fiu":
        raise GoniaError(f"{what}: {rows.dtype} is no type of numbers; give an array of floats")
    if rows.ndim != 2:
        raise GoniaError(f"{what}: has {rows.ndim} dimensions; give rows of numbers (two dimensions)")
    return np.ascontiguousarray(rows, dtype=np.float64)


class Samples:
    """Samples of one material: values at pairs of directions.

    ``rows`` is an array (N, 4 + channels) of theta_i, phi_i, theta_v, phi_v in degrees and the values, of any type
    and layout that means the same. ``frame`` (N,) says from which frame each came, where that is known.
    """

    def __init__(
        self,
        rows: ArrayLike,
        channels: Sequence[str] = ("R", "G", "B"),
        frame: ArrayLike | None = None,
        scale: str | None = None,
        provenance: dict[str, str] | None = None,
    ) -> None:
        rows = _rows(rows, "samples")
        if frame is not None:
            frame = np.asarray(frame, dtype=np.float64)
            if frame.shape != (len(rows),):
                raise GoniaError(
                    f"frame: has the shape {frame.shape}; give one number a sample ({len(rows)},)"
                )
            rows = np.column_stack([rows, frame])
        self._of = _gonia.Samples(
            rows, list(channels), frame is not None, scale, dict(provenance or {})
        )

    @classmethod
    def _from(cls, of):
        self = cls.__new__(cls)
        self._of = of
        return self

    @property
    def rows(self) -> NDArray[np.float32]:
        """(N, 4 + channels + 1) float32: angles in degrees, values, frame (-1 where it is unknown)."""
        return np.asarray(self._of.rows())

    @property
    def channels(self) -> list[str]:
        """Names of the channels: R, G, B; Y; or bands (380nm, ...)."""
        return self._of.channels

    @property
    def scale(self) -> str | None:
        """"absolute" (1/sr), "relative", or None where nothing says it."""
        return self._of.scale

    @property
    def provenance(self) -> dict[str, str]:
        """Where they came from, by name; with the uncertainties of the rig where it is known."""
        return self._of.provenance

    def save(self, path: Path) -> None:
        """Writes .npy (with NAME.npy.toml beside it) or .csv."""
        self._of.save(os.fspath(path))

    def __len__(self):
        return len(self._of)

    def __reduce__(self):
        rows = self.rows
        return Samples, (rows[:, :-1], self.channels, rows[:, -1], self.scale, self.provenance)

    def __repr__(self):
        return f"<gonia.Samples: {len(self)} of {', '.join(self.channels)}, {self.scale}>"


class Dense:
    """A dense BRDF: a value for every pair of directions of a grid, per channel."""

    def __init__(self):
        raise TypeError("make one with gonia.fill, or read one with gonia.read")

    @classmethod
    def _from(cls, of):
        self = cls.__new__(cls)
        self._of = of
        return self

    @property
    def values(self) -> dict[str, NDArray[np.float32]]:
        """Views, not copies, by channel: (n_theta, n_phi, n_theta, n_phi) float32 of light, then view; read-only."""
        return {n: np.asarray(self._of.plane(k, False)) for k, n in enumerate(self.channels)}

    @property
    def u(self) -> dict[str, NDArray[np.float32]] | None:
        """Standard uncertainties (k = 1) as ``values``, or None where there are none."""
        if not self._of.has_uncertainty:
            return None
        return {n: np.asarray(self._of.plane(k, True)) for k, n in enumerate(self.channels)}

    @property
    def origin(self) -> NDArray[np.uint8] | None:
        """Where each value is from, as ``values``: 0 measured, 1 reciprocal, 2 interpolated, 3 extrapolated, 4 by symmetry; or None."""
        origins = self._of.origins
        if origins is None:
            return None
        n_theta, n_phi = self._of.shape
        return np.frombuffer(bytes(origins), np.uint8).reshape(n_theta, n_phi, n_theta, n_phi)

    @property
    def channels(self) -> list[str]:
        """Names of the channels."""
        return self._of.channels

    @property
    def step(self) -> float:
        """Step of the grid, degrees."""
        return self._of.step

    @property
    def theta(self) -> NDArray[np.float64]:
        """Polar angles of the nodes, degrees."""
        return np.arange(self._of.shape[0]) * self.step

    @property
    def phi(self) -> NDArray[np.float64]:
        """Azimuths of the nodes, degrees."""
        return np.arange(self._of.shape[1]) * self.step

    @property
    def scale(self) -> str:
        """"absolute" (1/sr) or "relative"."""
        return self._of.scale

    @property
    def provenance(self) -> dict[str, str]:
        """Where it came from, by name."""
        return self._of.provenance

    @property
    def account(self) -> dict[str, str]:
        """How it was made: settings and symmetry; empty where it was read."""
        return self._of.account

    def query(self, directions: ArrayLike) -> NDArray[np.float32]:
        """Values between the nodes at ``directions`` (N, 4), degrees: (N, channels) float32."""
        return np.asarray(self._of.query(_rows(directions, "directions")))

    def save(self, path: Path, error: Path | None = None) -> None:
        """Writes OpenEXR, and the error bars under a second name."""
        self._of.save(os.fspath(path), None if error is None else os.fspath(error))

    def export(
        self,
        path: Path,
        format: str | None = None,
        resolution: int | None = None,
        assume_scale: float | None = None,
        allow_coarse: bool = False,
    ) -> dict[str, Any]:
        """Writes another program's format, by the ending or by name (``gonia export --list-formats``).

        Uncertainties go where the format has a place for them. A grid that is too coarse for the format is refused, unless
        ``allow_coarse``. A dict: how far the file, read back, is from the values (``median``, ``p99``, ``rms`` of abs(ln)).
        """
        found = _gonia.export(self._of, os.fspath(path), format, resolution, assume_scale, allow_coarse)
        _warn(found["remarks"])
        return found

    def to_xarray(self) -> xarray.Dataset:
        """An xarray.Dataset with named dimensions, units, uncertainty and provenance (copies the values)."""
        import xarray

        dims = ("channel", "theta_i", "phi_i", "theta_v", "phi_v")
        units = "1/sr" if self.scale == "absolute" else "relative"

        def stacked(planes, name):
            return (dims, np.stack(list(planes.values())), {"units": units, "long_name": name})

        data = {"brdf": stacked(self.values, "bidirectional reflectance distribution function")}
        if self.u is not None:
            data["u"] = stacked(self.u, "standard uncertainty (k = 1)")
        if self.origin is not None:
            flags = {"flag_values": np.arange(len(_ORIGINS), dtype=np.uint8), "flag_meanings": " ".join(_ORIGINS)}
            data["origin"] = (dims[1:], self.origin, flags)
        degrees = {"units": "degree"}
        coordinates = {"channel": self.channels}
        for name, nodes in zip(dims[1:], (self.theta, self.phi) * 2):
            coordinates[name] = (name, nodes, degrees)
        return xarray.Dataset(data, coordinates, {**self.provenance, "scale": self.scale})

    def __repr__(self):
        return f"<gonia.Dense: {', '.join(self.channels)} at {self.step} degrees, {self.scale}>"


def process(folder: Path, progress: Progress | None = None) -> Samples:
    """Samples of a capture folder's frames (rig.toml, frames.csv and the frames)."""
    found = _gonia.process(os.fspath(folder), progress)
    _warn(found.remarks)
    return Samples._from(found)


def calibrate(
    folder: Path, output: Path | None = None, progress: Progress | None = None
) -> dict[str, Any]:
    """The rig of a capture folder as its frames show it.

    A dict: ``numbers`` (name to nominal, found and u), ``frames`` (looked at, used), ``lines_px`` (before, after),
    ``light_u_deg`` and ``view_u_deg`` (95th percentiles). ``output`` is a rig.toml to write.
    """
    date = datetime.date.today().isoformat()
    path = None if output is None else os.fspath(output)
    found = _gonia.calibrate(os.fspath(folder), path, date, progress)
    _warn(found["remarks"])
    return found


def fill(
    samples: Samples | ArrayLike,
    step: float = 2.0,
    error: bool = False,
    symmetry: str = "auto",
    plane: float | None = None,
    preset: str = "default",
    progress: Progress | None = None,
) -> Dense:
    """Interpolates samples to every cell of a grid.

    ``error`` adds standard uncertainties, combined with those of the rig where the samples carry them. ``symmetry`` is
    "auto", "none", "isotropic", "bilateral", "half-turn" or "half-turn-bilateral"; ``plane`` the azimuth of a plane
    that is known. ``preset`` is "preview", "fast", "default" or "best".
    """
    if not isinstance(samples, Samples):
        samples = Samples(samples)
    how = {
        "step": float(step),
        "error": bool(error),
        "symmetry": symmetry,
        "plane": plane,
        "preset": preset,
    }
    found = _gonia.fill(samples._of, how, progress)
    _warn(found.remarks)
    return Dense._from(found)


def query(
    samples: Samples, directions: ArrayLike, symmetry: str = "auto"
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The fit of few samples at ``directions`` (N, 4), without a grid: values and their standard uncertainties."""
    values, u = _gonia.query_samples(samples._of, _rows(directions, "directions"), symmetry)
    return np.asarray(values), np.asarray(u)


def read(path: Path, error: Path | None = None) -> Dense:
    """Reads a dense BRDF, and its error bars from a second file."""
    return Dense._from(_gonia.Dense.read(os.fspath(path), None if error is None else os.fspath(error)))


def read_samples(path: Path) -> Samples:
    """Reads samples: .npy, .npz or a table of text."""
    found = _gonia.Samples.read(os.fspath(path))
    _warn(found.remarks)
    return Samples._from(found)


def compare(a: Dense, b: Dense) -> dict[str, Any]:
    """Figures of merit of one dense BRDF against another of the same step, by part of the domain; a dict."""
    return _gonia.compare(a._of, b._of)


def fit(
    dense: Dense, model: str, samples: Samples | None = None, progress: Progress | None = None
) -> tuple[dict[str, Any], Dense]:
    """A model's parameters with standard uncertainties (a dict), and the model as a dense BRDF."""
    found, fitted = _gonia.fit(dense._of, model, None if samples is None else samples._of, progress)
    return found, Dense._from(fitted)


def render(
    dense: Dense, shape: str = "sphere", light: str = "sky", px: int = 512
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """A sphere or cylinder of the material: (px, px, 3) in linear light, and how much of each pixel it covers."""
    rgb, cover = _gonia.render(dense._of, shape, light, px)
    return np.asarray(rgb), np.asarray(cover)
