#!/usr/bin/env python3
"""Real measurements, a fifth of each held out: gonia's fit, and its grid, against scipy's linear RBF on logarithms.

usage: real_sets.py GONIA FOLDER [STEP]

FOLDER holds tables (.csv) with rows theta_i,phi_i,theta_v,phi_v,value: degrees, 1/sr; other lines are left out.
Printed, a row a method: RMS, median and 95th percentile of |ln(predicted / held out)|, and user CPU seconds.
"""
import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy as np
from scipy.interpolate import RBFInterpolator

HEADER = "theta_i,phi_i,theta_v,phi_v"


def read(path):
    rows = []
    for line in path.read_text().splitlines():
        try:
            rows.append([float(x) for x in line.split(",")[:5]])
        except ValueError:
            continue
    rows = np.array([r for r in rows if len(r) == 5])
    inside = (rows[:, 0] < 85) & (rows[:, 2] < 85) & (rows[:, 4] > 0)
    return rows[inside]


def vectors(rows):
    def unit(theta, phi):
        theta, phi = np.radians(theta), np.radians(phi)
        return [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]

    return np.array(unit(rows[:, 0], rows[:, 1]) + unit(rows[:, 2], rows[:, 3])).T


def table(rows, header, columns):
    lines = [",".join(f"{x:.7g}" for x in row[:columns]) for row in rows]
    return "\n".join([header, *lines]) + "\n"


def cpu_seconds():
    of_children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return of_children.ru_utime + resource.getrusage(resource.RUSAGE_SELF).ru_utime


def ask(gonia, source, rows, *options):
    asked = subprocess.run(
        [gonia, "query", source, *options], input=table(rows, HEADER, 4), text=True, capture_output=True, check=True
    )
    symmetry = [part for part in asked.stderr.split(", ") if part.startswith("symmetry")]
    values = [float(line.split(",")[4]) for line in asked.stdout.split("\n")[1:] if line]
    return np.array(values), " ".join(symmetry)


def off(predicted, true):
    """RMS, median and 95th percentile of |ln(predicted / true)|, as columns."""
    off = np.abs(np.log(np.maximum(predicted, 1e-9) / true))
    figures = [np.sqrt(np.mean(off**2)), np.median(off), np.quantile(off, 0.95)]
    return " | ".join(f"{x:.4f}" for x in figures)


def filled(gonia, samples, dense, step):
    """Fills samples into a dense file, and returns its name."""
    fill = [gonia, "fill", samples, "-o", dense, "--step", step]
    subprocess.run(fill, check=True, capture_output=True)
    return dense


def scipy_logs(known, rows, asked):
    """scipy's fit of the rows' values at known places, at those that are asked."""
    rbf = RBFInterpolator(
        known, np.log(rows[:, 4]), neighbors=min(200, len(rows)), kernel="linear", smoothing=1e-3
    )
    return np.exp(rbf(asked))


def main():
    gonia, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    step = sys.argv[3] if len(sys.argv) > 3 else "2"
    print("| set | method | RMS | median | p95 | core-s | |\n|---|---|---|---|---|---|---|")
    for path in sorted(folder.glob("*.csv")):
        rows = read(path)
        held_out = np.random.default_rng(1).random(len(rows)) < 0.2
        known, asked = rows[~held_out], rows[held_out]

        def say(method, predict):
            start = cpu_seconds()
            values, note = predict()
            print(f"| {path.stem} | {method} | {off(values, asked[:, 4])} | {cpu_seconds() - start:.1f} | {note} |", flush=True)

        with tempfile.TemporaryDirectory() as at:
            samples, dense = f"{at}/samples.csv", f"{at}/dense.exr"
            pathlib.Path(samples).write_text(table(known, HEADER + ",brdf", 5))

            def by_grid():
                return ask(gonia, filled(gonia, samples, dense, step), asked, "--grid")

            def by_scipy():
                return scipy_logs(vectors(known), known, vectors(asked)), ""

            say("query of the samples", lambda: ask(gonia, samples, asked))
            say(f"grid of {step} degrees, filled", by_grid)
            say("query of that, its samples beside it", lambda: ask(gonia, dense, asked))
            say("scipy, linear, logarithms", by_scipy)


if __name__ == "__main__":
    main()
