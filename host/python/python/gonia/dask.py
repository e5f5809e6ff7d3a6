"""gonia on many processes or machines, by Dask (``pip install ./host/python[dask]``).

    from dask.distributed import Client
    import gonia, gonia.dask

    client = Client(n_workers=2, threads_per_worker=1)
    samples = gonia.dask.process(client, "my-frames")
    gonia.dask.fill(client, samples, "dense.zarr", step=1)

The folders must be seen by all workers under the same names. A worker uses all cores that it may; give it one thread
of Dask's. What a worker had not ended when it died is done again by another. The results are those of one
process, byte for byte, where all processors are of one kind.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from . import Path, Samples, _gonia, _warn, fill as _fill_here, read_samples
from ._gonia import GoniaError

if TYPE_CHECKING:
    from dask.distributed import Client

Progress = Callable[[str, float], object]

__all__ = ["fill", "fill_each", "process"]

#: Parts a worker, unless it is said: so many that the last ones to end leave few workers idle.
_PARTS = 4


def process(
    client: Client, folder: Path, parts: int | None = None, progress: Progress | None = None
) -> Samples:
    """Samples of a capture folder's frames, as ``gonia.process``: each worker samples some frames.

    ``parts`` is how many shares the frames are divided in. What they come to (26 kB a frame of 1225 points) is
    brought to this process, which calibrates it against the reference.
    """
    folder = os.path.abspath(folder)
    count = _gonia.frames_in(folder)
    bounds = _even(count, parts or _PARTS * _workers(client))
    shares = client.map(_share, [folder] * (len(bounds) - 1), bounds[:-1], bounds[1:], pure=False)
    _wait(shares, "frames to samples", progress)
    found = _gonia.process_shares(folder, client.gather(shares))
    _warn(found.remarks)
    return Samples._from(found)


def fill(
    client: Client,
    samples: Samples | Path,
    output: Path,
    step: float = 2.0,
    symmetry: str = "auto",
    plane: float | None = None,
    preset: str = "default",
    folder: Path | None = None,
    parts: int | None = None,
    progress: Progress | None = None,
) -> str:
    """Interpolates samples to every cell of a grid, as ``gonia.fill``, and writes them as Zarr; its path.

    ``folder`` is where the parts are made, on the disk of ``output``: by default its name with ``.parts``. It takes up to
    half as much room as the table. A folder of a fill of the same samples that was not ended goes on where it was. No
    uncertainties are made.
    """
    if not isinstance(samples, Samples):
        samples = read_samples(samples)
    output = os.path.abspath(output)
    if not output.endswith(".zarr"):
        raise GoniaError(f"{output}: a shared fill writes Zarr; give a name that ends in .zarr")
    if os.path.lexists(output):
        raise GoniaError(f"{output}: is there already; remove it or choose another name")
    folder = os.path.abspath(folder or output + ".parts")
    how = {"step": float(step), "error": False, "symmetry": symmetry, "plane": plane, "preset": preset}
    shared = _gonia.begin_fill(samples._of, how, folder)
    if shared is None:
        # Few samples: their fit is one machine's work of seconds.
        client.submit(_fill_one, samples, how, output, pure=False).result()
        return output
    _warn(shared.remarks)
    groups, patches, bands = shared.parts
    bounds = _even_pairs(patches, parts or _PARTS * _workers(client))
    each = [(group, a, b) for group in range(groups) for a, b in zip(bounds[:-1], bounds[1:])]
    _wait(_map(client, _solve, folder, each), "fitting", progress)
    each = [(group, band) for group in range(groups) for band in range(bands)]
    _wait(_map(client, _write, folder, each), "interpolating and writing", progress)
    shared.finish(output)
    return output


def fill_each(
    client: Client,
    materials: Mapping[str, Samples | Path],
    folder: Path,
    progress: Progress | None = None,
    **how: Any,
) -> dict[str, str]:
    """Fills each of many materials as a task of its own (``how`` as of ``gonia.fill``); paths of OpenEXR by name.

    Where ``error`` is set, each has its error bars beside it (NAME-error.exr). One that fails is raised when the others
    have ended, and theirs are there.
    """
    folder = os.path.abspath(folder)
    os.makedirs(folder, exist_ok=True)
    of = lambda value: value if isinstance(value, Samples) else os.path.abspath(value)
    tasks = {
        name: client.submit(_fill_named, of(value), how, os.path.join(folder, name), pure=False)
        for name, value in materials.items()
    }
    _wait(tasks.values(), "filling", progress)
    return {name: task.result() for name, task in tasks.items()}


def _share(folder, first, end):
    return _gonia.sample_share(folder, first, end)


def _solve(folder, group, first, end):
    _gonia.SharedFill.open(folder).solve(group, first, end)


def _write(folder, group, band):
    _gonia.SharedFill.open(folder).write(group, band)


def _fill_one(samples, how, output):
    _fill_here(samples, **how).export(output)


def _fill_named(samples, how, name):
    if not isinstance(samples, Samples):
        samples = read_samples(samples)
    dense = _fill_here(samples, **how)
    dense.save(name + ".exr", error=name + "-error.exr" if how.get("error") else None)
    return name + ".exr"


def _map(client, work, folder, each):
    return [client.submit(work, folder, *part, pure=False) for part in each]


def _wait(tasks: Iterable[Any], step: str, progress: Progress | None) -> None:
    from dask.distributed import as_completed

    tasks = list(tasks)
    failed = None
    for done, task in enumerate(as_completed(tasks), 1):
        if task.status != "finished":
            failed = failed or task
        if progress is not None:
            progress(step, done / len(tasks))
    if failed is not None:
        failed.result()


def _workers(client):
    return max(1, len(client.scheduler_info()["workers"]))


def _even(count: int, parts: int) -> list[int]:
    """Bounds of about equal shares."""
    parts = max(1, min(parts, count))
    return [k * count // parts for k in range(parts + 1)]


def _even_pairs(patches: int, parts: int) -> list[int]:
    """Bounds of shares of about equally many pairs: each patch is solved with itself and all later ones."""
    total, seen, bounds = patches * (patches + 1) // 2, 0, [0]
    for patch in range(patches):
        seen += patches - patch
        if seen * parts >= total * len(bounds):
            bounds.append(patch + 1)
    return bounds
