"""What the readers' scripts share: a BRDF that is neither mirrored nor turned into itself, as gonia's table."""
import subprocess

import numpy as np
import OpenEXR

STEP = 4.0
RINGS, AZIMUTHS = 22, 90


def direction(theta, phi):
    """3 x N unit vectors of angles in radians."""
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def lobe(v):
    """Asymmetric in every way."""
    return 1 + 0.4 * v[0] + 0.3 * v[1] + 0.3 * v[0] * v[1]


def brdf(light, view):
    """1/sr, green, for 3 x N directions: reciprocal, and asymmetric in every way."""
    half = light + view
    half /= np.linalg.norm(half, axis=0)
    return 0.1 * lobe(light) * lobe(view) + np.exp(-30 * (1 - half[2]))


def smooth(light, view):
    """The same without its highlight: for files and readers that know patches of ten degrees and more."""
    return 0.1 * lobe(light) * lobe(view)


def table(path, scales=None, function=brdf, step=STEP):
    """Writes the dense BRDF on a grid of `step` degrees; each channel by its factor (grey: R, G and B alike)."""
    rings, azimuths = int(86 // step) + 1, round(360 / step)
    theta, phi = np.meshgrid(np.radians(step * np.arange(rings)), np.radians(step * np.arange(azimuths)), indexing="ij")
    d = direction(theta.ravel(), phi.ravel())
    n = d.shape[1]
    f = function(np.repeat(d, n, axis=1), np.tile(d, (1, n))).reshape(n, n)
    scales = scales or {"R": 1, "G": 1, "B": 1}
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {c: (by * f).astype(np.float32) for c, by in scales.items()}) as file:
        file.write(path)
    return f


def pairs(n, last_deg=75.0, seed=1):
    """Random directions of light and view, 3 x n each."""
    rng = np.random.default_rng(seed)
    angles = lambda: (np.radians(last_deg * rng.random(n)), 2 * np.pi * rng.random(n))
    return direction(*angles()), direction(*angles())


def export(gonia, table, output, *more):
    """Exports a table, taken as 1/sr."""
    command = [gonia, "export", table, "-o", output, "--assume-scale", "1", *more]
    return subprocess.run(command, check=True, capture_output=True, text=True)


def ln(found, wanted):
    """Median and 99th percentile of |ln|; what is not positive counts as far away."""
    with np.errstate(all="ignore"):
        error = np.nan_to_num(np.abs(np.log(np.asarray(found) / np.asarray(wanted))), nan=9.0, posinf=9.0)
    return np.median(error), np.quantile(error, 0.99)


# Ways in which a file may be confused; none of them may be as near as the right one.
CONFUSED = {
    "mirrored in x": lambda i, v: (i * [[-1], [1], [1]], v * [[-1], [1], [1]]),
    "mirrored in y": lambda i, v: (i * [[1], [-1], [1]], v * [[1], [-1], [1]]),
    "turned by 180": lambda i, v: (i * [[-1], [-1], [1]], v * [[-1], [-1], [1]]),
    "x and y exchanged": lambda i, v: (i[[1, 0, 2]], v[[1, 0, 2]]),
    "light turned by 180": lambda i, v: (i * [[-1], [-1], [1]], v),
    "view turned by 180": lambda i, v: (i, v * [[-1], [-1], [1]]),
}


def check(name, found, light, view, limits, factor=1.0, function=brdf, apart=2.0):
    """Prints how far values are, and whether they are within limits and `apart` times nearer than any confused BRDF."""
    median, p99 = ln(found, factor * function(light, view))
    print(f"{name}: |ln| median {median:.4f}, p99 {p99:.4f}")
    good = median < limits[0] and p99 < limits[1]
    for what, confuse in CONFUSED.items():
        wrong, _ = ln(found, factor * function(*confuse(light, view)))
        if wrong < apart * median:
            print(f"{name}: as near to what is {what}: {wrong:.4f}")
            good = False
    return good
