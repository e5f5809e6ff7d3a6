"""What scipy makes of gonia's samples: interpolates a random share of the missing cells of the
2 degree grid from the same bins, and compares with the truth at these cells.

The truth is a dense BRDF that `gonia query` reads, so that no EXR reader is needed; `--dense` lets a
dense BRDF that `gonia fill` made stand beside them, at the same cells. Prints a markdown table.

    python bench/baselines/baselines.py samples.npy --truth truth.exr --gonia target/release/gonia \
        --dense default=dense.exr --dense paper=paper.exr
"""

import argparse
import os

# One core, so that seconds are core-seconds.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[name] = "1"

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

STEP_DEG = 2.0
N_THETA, N_PHI = 44, 180
N = N_THETA * N_PHI


def directions():
    """Unit vectors of the grid's directions, in their order."""
    index = np.arange(N)
    theta = np.radians(STEP_DEG * (index // N_PHI))
    phi = np.radians(STEP_DEG * (index % N_PHI))
    return np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )


def nearest(theta_deg, phi_deg):
    """The direction index of the nearest node, each angle rounded by itself, half away from zero;
    -1 beyond the grid. Poles are index 0."""
    i_theta = np.floor(theta_deg.astype(np.float64) / STEP_DEG + 0.5).astype(np.int64)
    i_phi = np.floor(phi_deg.astype(np.float64) % 360.0 / STEP_DEG + 0.5).astype(np.int64) % N_PHI
    index = np.where(i_theta == 0, 0, i_theta * N_PHI + i_phi)
    return np.where(i_theta < N_THETA, index, -1)


def bin_samples(path):
    """Cells with a sample, and the medians of their samples, as gonia bins."""
    samples = np.load(path, mmap_mode="r")
    light = nearest(samples[:, 0], samples[:, 1])
    view = nearest(samples[:, 2], samples[:, 3])
    rgb = np.asarray(samples[:, 4:7])
    inside = (light >= 0) & (view >= 0) & np.isfinite(rgb).all(axis=1)
    cell = (light * N + view)[inside]
    rgb = rgb[inside]
    cells, first, counts = np.unique(cell[np.argsort(cell)], return_index=True, return_counts=True)
    medians = np.empty((len(cells), 3), np.float32)
    for c in range(3):
        # Sorted by cell and value, the middle of a cell's run is its median.
        ranked = rgb[np.lexsort((rgb[:, c], cell)), c]
        medians[:, c] = 0.5 * (ranked[first + (counts - 1) // 2] + ranked[first + counts // 2])
    return cells, medians


def missing(cells, n, seed):
    """Random cells that are neither a bin nor a bin's mirror, poles once."""
    known = np.union1d(cells, cells % N * N + cells // N)
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, N * N, 3 * n)
    is_pole_again = lambda d: (d > 0) & (d < N_PHI)
    keep = ~np.isin(drawn, known) & ~is_pole_again(drawn // N) & ~is_pole_again(drawn % N)
    return drawn[keep][:n]


def query(gonia, dense, cells):
    """Values of a dense BRDF at cells, by `gonia query`."""
    lines = ["theta_i,phi_i,theta_v,phi_v"]
    for cell in cells:
        i, v = divmod(int(cell), N)
        angles = (i // N_PHI, i % N_PHI, v // N_PHI, v % N_PHI)
        lines.append(",".join(str(STEP_DEG * a) for a in angles))
    done = subprocess.run(
        [gonia, "query", dense], input="\n".join(lines) + "\n", text=True, capture_output=True
    )
    if done.returncode != 0:
        sys.exit(done.stderr.strip())
    rows = [line.split(",")[4:7] for line in done.stdout.splitlines()[1:]]
    return np.array(rows, dtype=np.float64)


def strata(cells, truth):
    theta = STEP_DEG * np.stack([cells // N // N_PHI, cells % N // N_PHI])
    d = directions()
    i, v = d[cells // N], d[cells % N]
    weighted = truth.mean(axis=1) * i[:, 2] * v[:, 2]
    return {
        "all": np.ones(len(cells), bool),
        "interior": (theta <= 75.0).all(axis=0),
        "grazing": (theta > 75.0).any(axis=0),
        "unmeasured": (theta > 78.0).all(axis=0),
        "highlight": weighted >= np.quantile(weighted, 0.99),
        "retro": np.sum(i * v, axis=1) > np.cos(np.radians(8.0)),
    }


class Rbf:
    """scipy's RBFInterpolator over the 200 nearest bins."""

    def __init__(self, kernel):
        self.kernel = kernel

    def __call__(self, points, values, at):
        rbf = RBFInterpolator(points, values, neighbors=200, kernel=self.kernel, smoothing=1e-3)
        return rbf(at)


def nearest_one(points, values, at):
    return values[cKDTree(points).query(at, 1)[1]]


def knn16(points, values, at):
    distance, found = cKDTree(points).query(at, 16)
    weight = 1.0 / np.maximum(distance, 1e-12)
    weight /= weight.sum(axis=1, keepdims=True)
    return np.einsum("nk,nkc->nc", weight, values[found])


BASELINES = [
    ("scipy linear, 200 neighbours", Rbf("linear"), False),
    ("scipy linear, mirrored samples", Rbf("linear"), True),
    ("scipy thin-plate, 200 neighbours", Rbf("thin_plate_spline"), False),
    ("nearest", nearest_one, False),
    ("16 nearest by distance", knn16, False),
]


def row(*columns):
    print("| " + " | ".join(columns) + " |", flush=True)


def report(material, name, value, truth, parts, floor, speed):
    log = np.log(np.maximum(value, floor) / np.maximum(truth, floor))
    columns = [np.sqrt(np.mean(log[inside] ** 2)) for inside in parts.values()]
    row(material, name, speed, *(f"{rms:.4f}" for rms in columns))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("samples", help=".npy, float32, N x 7 or N x 8")
    parser.add_argument("--truth", required=True, help="the true dense BRDF, .exr")
    parser.add_argument("--gonia", default="gonia", help="the program, for its query command")
    parser.add_argument("--cells", type=int, default=4000, help="missing cells to interpolate")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--dense", action="append", default=[], metavar="NAME=FILE.exr", help="a dense BRDF to judge too"
    )
    arguments = parser.parse_args()

    cells, medians = bin_samples(arguments.samples)
    at = missing(cells, arguments.cells, arguments.seed)
    truth = query(arguments.gonia, arguments.truth, at)
    floor = 1e-6 * truth.mean()
    parts = strata(at, truth)
    share = len(at) / (N * N - len(cells))
    print(f"{len(cells)} bins; {len(at)} missing cells, {share:.1e} of them all; log RMS by stratum")
    row("material", "method", "interpolations per core-s", *parts)
    row(*["---"] * (3 + len(parts)))
    material = Path(arguments.samples).stem

    d = directions()
    light, view = d[cells // N], d[cells % N]
    plain = np.concatenate([light, view], axis=1)
    mirrored = np.concatenate([plain, np.concatenate([view, light], axis=1)])
    # A bin whose light and view are one is its own mirror; twice the same point is singular.
    once = np.concatenate([np.ones(len(plain), bool), cells // N != cells % N])
    i, v = d[at // N], d[at % N]
    both = np.concatenate([np.concatenate([i, v], axis=1), np.concatenate([v, i], axis=1)])
    for name, method, is_mirrored in BASELINES:
        points = mirrored[once] if is_mirrored else plain
        values = np.concatenate([medians, medians])[once] if is_mirrored else medians
        values = values.astype(np.float64)
        # Trees are built in the time too, but belong to all cells: taken off again.
        start = time.process_time()
        method(points, values, both[:1])
        built = time.process_time()
        # Reciprocal values are averaged at the end, so every cell is interpolated both ways.
        try:
            value = method(points, values, both)
        except np.linalg.LinAlgError as error:
            print(f"{name}: {error}")
            continue
        worked = time.process_time() - built - (built - start)
        speed = len(both) / max(worked, 1e-3)
        mean = 0.5 * (value[: len(at)] + value[len(at) :])
        report(material, name, mean, truth, parts, floor, f"{speed:.0f}")
    for dense in arguments.dense:
        name, _, path = dense.partition("=")
        value = query(arguments.gonia, path, at)
        report(material, f"gonia {name}", value, truth, parts, floor, "–")


if __name__ == "__main__":
    main()
