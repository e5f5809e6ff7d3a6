#!/usr/bin/env python3
"""Made-up small sets, whose truth is known: gonia's fit, and its grid, against scipy's linear RBF on logarithms.

usage: made_up_sets.py GONIA [--grid] [--only WORD] [--seed N]

Each set is a material, a way to choose directions, a number of samples and their noise. Asked at 600 further
directions that are chosen in the same way, where the truth without noise is known. Printed, a row a set and method:
RMS, median and 95th percentile of |ln(predicted / truth)|, the symmetry that was found, wall-clock seconds. `--grid`
adds what `gonia fill` and `gonia query --grid` make of them at 2 degrees. Of isotropic sets scipy is given the three
coordinates that these depend on, too.
"""
import pathlib
import sys
import tempfile
import time

import numpy as np
from real_sets import HEADER, ask, off, scipy_logs, table, vectors, filled

ASKED = 600


def unit(v):
    return v / np.linalg.norm(v, axis=1)[:, None]


def halves(rows):
    both = vectors(rows)
    light, view = both[:, :3], both[:, 3:]
    return light, view, unit(light + view)


def lobe(h, wide_x, wide_y):
    """exp(-tan^2) of the half vector, wide as said."""
    slope2 = (h[:, 0] / wide_x) ** 2 + (h[:, 1] / wide_y) ** 2
    return np.exp(-slope2 / h[:, 2] ** 2)


def fresnel(light, h):
    return 0.04 + 0.96 * (1 - np.sum(light * h, axis=1)) ** 5


def gloss(wide_x, wide_y, base=0.05):
    def at(rows):
        light, view, h = halves(rows)
        specular = fresnel(light, h) * lobe(h, wide_x, wide_y) / (wide_x * wide_y)
        return base + specular / (4 * np.maximum(light[:, 2], view[:, 2]))

    return at


def matte(rows):
    light, view, _ = halves(rows)
    both = light[:, 2] * view[:, 2]
    return 0.3 * (0.7 + 0.3 * np.exp(-3 * both)) + 0.02 * np.sum(light * view, axis=1)


def weak(share):
    """An isotropic gloss with a share that goes with twice the azimuth of the half vector."""

    def at(rows):
        _, _, h = halves(rows)
        planar = np.maximum(h[:, 0] ** 2 + h[:, 1] ** 2, 1e-9)
        return gloss(0.25, 0.25)(rows) * (1 + share * (h[:, 0] ** 2 - h[:, 1] ** 2) / planar)

    return at


def leaning(rows):
    """Alike on both sides of the plane at 40 degrees alone."""
    _, _, h = halves(rows)
    lean, azimuth = np.radians([12, 40])
    axis = [np.sin(lean) * np.cos(azimuth), np.sin(lean) * np.sin(azimuth), np.cos(lean)]
    return 0.04 + 0.3 * np.exp(60 * (h @ axis - 1))


def skew(rows):
    """No symmetry at all: two lobes that lean to their own sides, one wide along its own axis."""
    light, view, h = halves(rows)
    turned = np.radians(17)
    x = np.cos(turned) * h[:, 0] + np.sin(turned) * h[:, 1]
    y = np.cos(turned) * h[:, 1] - np.sin(turned) * h[:, 0]
    first = np.exp(-(((x - 0.1) / 0.2) ** 2) - ((y / 0.5) ** 2))
    second = np.exp(-((x / 0.3) ** 2) - (((y - 0.2) / 0.15) ** 2))
    return 0.03 + 0.2 * first + 0.1 * second


def mirror_like(rows):
    """A glass's in-plane scatter: a power of the distance from the mirror direction, over six decades."""
    both = vectors(rows)
    light, view = both[:, :3], both[:, 3:]
    planar = np.linalg.norm((light + view)[:, :2], axis=1)
    return 1e-3 + 2e3 / (1 + (planar / 0.003) ** 2) ** 1.2


def retro(wide_deg):
    def at(rows):
        both = vectors(rows)
        light, view = both[:, :3], both[:, 3:]
        apart = np.degrees(np.arccos(np.clip(np.sum(light * view, axis=1), -1, 1)))
        peak = 200 * light[:, 2] ** 2 * np.exp(-((apart / wide_deg) ** 1.3))
        return 0.08 + peak + gloss(0.2, 0.2, 0.0)(rows)

    return at


def spread_theta(random, n):
    return np.degrees(np.arccos(random.uniform(np.cos(np.radians(80)), 1, n)))


def pairs(random, n):
    return np.stack(
        [spread_theta(random, n), random.uniform(0, 360, n), spread_theta(random, n), random.uniform(0, 360, n)], 1
    )


def one_azimuth(random, n):
    rows = pairs(random, n)
    rows[:, 0] = random.choice([0, 15, 30, 45, 60, 75], n)
    rows[:, 1] = 20
    return rows


def in_plane(random, n):
    """Five angles of incidence, views near the plane of incidence, denser near the mirror direction."""
    theta = random.choice([5, 20, 40, 60, 75], n).astype(float)
    near = theta + np.sign(random.uniform(-1, 1, n)) * 10 ** random.uniform(-1, 1.6, n)
    signed = np.where(random.uniform(size=n) < 0.6, near, random.uniform(-80, 80, n))
    signed = np.clip(signed, -80, 80)
    phi_v = np.where(signed >= 0, 180.0, 0.0)
    return np.stack([theta, np.zeros(n), np.abs(signed), phi_v], 1)


def near_retro(random, n):
    """Half of the views within degrees of the light."""
    rows = pairs(random, n)
    close = random.uniform(size=n) < 0.6
    apart, around = 10 ** random.uniform(-1, 1.2, n), random.uniform(0, 2 * np.pi, n)
    theta_v = np.clip(rows[:, 0] + apart * np.cos(around), 0.05, 80)
    phi_v = rows[:, 1] + apart * np.sin(around) / np.sin(np.radians(np.maximum(rows[:, 0], 5)))
    rows[close, 2], rows[close, 3] = theta_v[close], phi_v[close] % 360
    return rows


def clusters(random, n):
    """Twelve clusters of pairs, each some five degrees wide: the asked ones come from the same."""
    middles = pairs(np.random.default_rng(99), 12)
    rows = middles[random.integers(0, 12, n)] + random.normal(0, [5, 8, 5, 8], (n, 4))
    rows[:, [0, 2]] = np.clip(np.abs(rows[:, [0, 2]]), 0, 80)
    rows[:, [1, 3]] %= 360
    return rows


def one_side(random, n):
    """Lights and views of azimuths between 0 and 180 degrees alone."""
    rows = pairs(random, n)
    rows[:, [1, 3]] /= 2
    return rows


# name, truth, directions, number, noise, isotropic
SETS = [
    *[(f"isotropic gloss, {n}", gloss(0.3, 0.3), pairs, n, 0.005, True) for n in (20, 50, 100, 300, 1000, 10000)],
    ("isotropic matte, 1 %, 300", matte, pairs, 300, 0.01, True),
    ("isotropic matte, 1 %, 3000", matte, pairs, 3000, 0.01, True),
    *[(f"anisotropic gloss, {n}", gloss(0.2, 0.45), pairs, n, 0.005, False) for n in (20, 50, 100, 300, 1000, 10000)],
    *[(f"weak anisotropy of 2 %, {n}", weak(0.02), pairs, n, 0.01, False) for n in (1000, 3000, 10000)],
    *[(f"leaning pile, bilateral, {n}", leaning, pairs, n, 0.01, False) for n in (100, 300, 1000, 3000)],
    *[(f"no symmetry, {n}", skew, pairs, n, 0.01, False) for n in (300, 1000, 3000)],
    ("in plane, six decades, 300", mirror_like, in_plane, 300, 0.02, True),
    ("in plane, six decades, 1500", mirror_like, in_plane, 1500, 0.02, True),
    ("retro peak of 1 degree, 1000", retro(1.0), near_retro, 1000, 0.02, True),
    ("retro peak of 1 degree, 5000", retro(1.0), near_retro, 5000, 0.02, True),
    ("one azimuth, gloss, 500", gloss(0.25, 0.25), one_azimuth, 500, 0.01, True),
    ("one azimuth, matte, 1800", matte, one_azimuth, 1800, 0.01, True),
    ("clustered, gloss, 600", gloss(0.25, 0.25), clusters, 600, 0.01, True),
    ("clustered, no symmetry, 600", skew, clusters, 600, 0.01, False),
    ("one side, no symmetry, 700", skew, one_side, 700, 0.01, False),
    ("one side, gloss, anisotropic, 700", gloss(0.2, 0.45), one_side, 700, 0.01, False),
]


def three(rows):
    """What isotropic materials depend on, light at azimuth 0: one side of its plane."""
    turned = rows.copy()
    turned[:, 3], turned[:, 1] = rows[:, 3] - rows[:, 1], 0
    both = vectors(turned)
    both[:, 4] = np.abs(both[:, 4])
    return np.delete(both, 1, axis=1)


def main():
    arguments = sys.argv[1:]
    gonia = arguments[0]
    option = lambda name, usual: arguments[arguments.index(name) + 1] if name in arguments else usual
    only, seed = option("--only", ""), int(option("--seed", "1"))
    print("| set | method | RMS | median | p95 | wall, s | |\n|---|---|---|---|---|---|---|")
    for name, truth, directions, number, noise, isotropic in SETS:
        if only not in name:
            continue
        random = np.random.default_rng(seed)
        known, asked = directions(random, number), directions(random, ASKED)
        known, asked = known.round(4), asked.round(4)
        values = truth(known) * (1 + noise * random.normal(size=number))
        true = truth(asked)
        known, asked = np.column_stack([known, values]), np.column_stack([asked, true])

        def say(method, predict):
            start = time.time()
            predicted, note = predict()
            figures = off(predicted, true)
            print(f"| {name} | {method} | {figures} | {time.time() - start:.1f} | {note} |", flush=True)

        with tempfile.TemporaryDirectory() as at:
            samples = f"{at}/samples.csv"
            pathlib.Path(samples).write_text(table(known, HEADER + ",brdf", 5))
            say("gonia", lambda: ask(gonia, samples, asked))
            if "--grid" in arguments:
                dense = f"{at}/dense.exr"
                say("gonia, grid of 2 degrees", lambda: ask(gonia, filled(gonia, samples, dense, "2"), asked, "--grid"))
            say("scipy", lambda: (scipy_logs(vectors(known), known, vectors(asked)), ""))
            if isotropic:
                say("scipy, isotropic", lambda: (scipy_logs(three(known), known, three(asked)), ""))


if __name__ == "__main__":
    main()
