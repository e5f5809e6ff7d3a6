#!/usr/bin/env python3
"""Radiance reads what `gonia export` wrote, the right way round: tensor trees, Klems' matrix, and goniophotometer's
text through pabopto2bsdf.

usage: radiance_xml.py GONIA    (numpy, OpenEXR and pyradiance from PyPI; `cargo xtask readers` makes them)
Ends with 1 where a limit is exceeded.
"""
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyradiance
from pyradiance import bsdf

from lopsided import brdf, check, export, ln, pairs, smooth, table

N = 3000
KEPT = []


def degrees(v):
    """Polar angle and azimuth."""
    return np.degrees(np.arccos(np.clip(v[2], -1, 1))), np.degrees(np.arctan2(v[1], v[0])) % 360


def values(path, light, view):
    """X, Y, Z of a file at pairs of directions."""
    data = bsdf.load_file(path)
    # Freeing what was loaded crashes.
    KEPT.append(data)
    angles = np.stack([*degrees(light), *degrees(view)], axis=1)
    return np.array([bsdf.query(data, *row) for row in angles.tolist()])


def isotropic(light, view):
    """Isotropic, and not the same at phi and -phi."""
    across = light[0] * view[1] - light[1] * view[0]
    along = light[0] * view[0] + light[1] * view[1]
    return 0.1 * np.exp(0.7 * across - 0.3 * along + 0.4 * light[2])


def through_pabopto(gonia, folder, light, view):
    """Values of a few incidences as pabopto2bsdf's radial functions have them: a check of orientation."""
    table(f"{folder}/coarse.exr", {"Y": 1}, smooth, step=10.0)
    export(gonia, f"{folder}/coarse.exr", f"{folder}/a.pab", "--resolution", "4")
    root = os.path.dirname(pyradiance.__file__)
    env = os.environ | {"PATH": f"{root}/bin{os.pathsep}{os.environ['PATH']}", "RAYPATH": f"{root}/lib"}
    files = [str(path) for path in sorted(Path(folder, "a.pab").iterdir())]
    for command, output in [(["pabopto2bsdf", *files], "a.sir"), (["bsdf2ttree", "-g", "4", f"{folder}/a.sir"], "p.xml")]:
        with open(f"{folder}/{output}", "wb") as out:
            subprocess.run([f"{root}/bin/{command[0]}", *command[1:]], stdout=out, stderr=subprocess.DEVNULL, env=env, check=True)
    return values(f"{folder}/p.xml", light, view)[:, 1]


def main():
    gonia = sys.argv[1]
    light, view = pairs(N)
    good = True
    with tempfile.TemporaryDirectory() as folder:
        at = lambda name: os.path.join(folder, name)
        # Y of linear sRGB.
        luminance = 0.2126 + 0.5 * 0.7152 + 0.25 * 0.0722
        for name, function, limits in [("tensortree4", brdf, (0.06, 0.5)), ("klems", smooth, (0.06, 0.5))]:
            table(at("dense.exr"), {"R": 1, "G": 0.5, "B": 0.25}, function)
            table(at("one.exr"), {"Y": 1}, function)
            for source, factor in [("one.exr", 1.0), ("dense.exr", luminance)]:
                # A name of its own: what was loaded under a name before is not read again.
                written = at(f"{name}-{source}.xml")
                export(gonia, at(source), written, "--format", name)
                found = values(written, light, view)
                good &= check(f"{name} of {source}", found[:, 1], light, view, limits, factor, function)
            # X / Y and Z / Y of the colour, over the white point's.
            x, z = 0.4124 + 0.5 * 0.3576 + 0.25 * 0.1805, 0.0193 + 0.5 * 0.1192 + 0.25 * 0.9505
            wanted = np.array([x / 0.9505, z / 1.0890]) / luminance
            colour = np.median(found[:, [0, 2]] / found[:, [1]], axis=0)
            print(f"{name}: X/Y, Z/Y {colour}, wanted {wanted}")
            good &= bool(np.all(np.abs(np.log(colour / wanted)) < 0.05))
        table(at("isotropic.exr"), {"Y": 1}, isotropic)
        export(gonia, at("isotropic.exr"), at("tensortree3.xml"), "--format", "tensortree3")
        found = values(at("tensortree3.xml"), light, view)[:, 1]
        median, p99 = ln(found, isotropic(light, view))
        mirrored, _ = ln(found, isotropic(light * [[1], [-1], [1]], view * [[1], [-1], [1]]))
        print(f"tensortree3: |ln| median {median:.4f}, p99 {p99:.4f}; mirrored {mirrored:.4f}")
        good &= bool(median < 0.04 and p99 < 0.2 and mirrored > 2 * median)
        # Its radial functions are themselves a tenth off.
        found = through_pabopto(gonia, folder, light, view)
        good &= check("pab by pabopto2bsdf", found, light, view, (0.2, 2.0), function=smooth, apart=1.2)
    sys.stdout.flush()
    os._exit(0 if good else 1)


if __name__ == "__main__":
    main()
