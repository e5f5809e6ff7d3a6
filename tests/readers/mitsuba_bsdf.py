#!/usr/bin/env python3
"""Mitsuba's `measured` reads what `gonia export` wrote, the right way round, and samples it rightly.

usage: mitsuba_bsdf.py GONIA    (numpy, OpenEXR and mitsuba from PyPI; `cargo xtask readers` makes them)
A BRDF that is neither mirrored nor turned into itself is tabulated by this script, exported by gonia and
evaluated by Mitsuba. Ends with 1 where a limit is exceeded.
"""
import struct
import sys
import tempfile

import numpy as np

from lopsided import brdf, direction, export, table


def main():
    gonia = sys.argv[1]
    import mitsuba as mi

    mi.set_variant("scalar_rgb" if "llvm_ad_rgb" not in mi.variants() else "llvm_ad_rgb")
    import drjit as dr

    with tempfile.TemporaryDirectory() as folder:
        table(folder + "/dense.exr")
        # The small file has a shape in its ndf, and places that do not lie evenly: a vndf.
        good = True
        for side, limits in [("32", (0.01, 0.06)), ("16", (0.012, 0.07))]:
            export(gonia, folder + "/dense.exr", folder + "/a.bsdf", "--resolution", side)
            sides = {name: shape[-1] for name, shape in shapes(folder + "/a.bsdf").items()}
            print(f"nodes a side: ndf {sides['ndf']}, vndf {sides['vndf']}")
            good &= side == "32" or (sides["ndf"] > 2 and sides["vndf"] > 2)
            bsdf = mi.load_dict({"type": "measured", "filename": folder + "/a.bsdf"})
            good &= check(mi, dr, bsdf, side, limits)
    sys.exit(0 if good else 1)


def shapes(path):
    """The shapes of the fields of a tensor file, by name."""
    with open(path, "rb") as file:
        data = file.read()
    (count,), at, found = struct.unpack_from("<I", data, 14), 18, {}
    for _ in range(count):
        (length,) = struct.unpack_from("<H", data, at)
        name = data[at + 2 : at + 2 + length].decode()
        (sides,) = struct.unpack_from("<H", data, at + 2 + length)
        at += 2 + length + 2 + 1 + 8
        found[name] = struct.unpack_from(f"<{sides}Q", data, at)
        at += 8 * sides
    return found


def check(mi, dr, bsdf, side, limits):
    """Whether values are within limits (median and p99 of |ln|), and albedos by sampling those by quadrature."""
    rng = np.random.default_rng(1)
    n = 20_000
    angles = lambda: (np.radians(75 * rng.random(n)), 2 * np.pi * rng.random(n))
    light, view = direction(*angles()), direction(*angles())
    si = dr.zeros(mi.SurfaceInteraction3f, n)
    si.wi = mi.Vector3f(light)
    seen = np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(view)))[1] / view[2]
    error = np.abs(np.log(seen / brdf(light, view)))
    median, p99 = np.median(error), np.quantile(error, 0.99)
    print(f"{side} places a side: |ln| median {median:.4f}, p99 {p99:.4f}")

    # Albedo of one light by Mitsuba's sampling, and by the function itself.
    m = 400_000
    worst = 0.0
    for theta, phi in [(0.0, 0.0), (0.6, 1.0), (1.1, 4.0)]:
        d = direction(np.array([theta]), np.array([phi]))
        si = dr.zeros(mi.SurfaceInteraction3f, m)
        si.wi = mi.Vector3f(np.repeat(d, m, axis=1))
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(3, m)
        _, weight = bsdf.sample(mi.BSDFContext(), si, sampler.next_1d(), sampler.next_2d())
        sampled = np.nan_to_num(np.array(weight)[1]).mean()
        z = rng.random(m)
        v = direction(np.arccos(z), 2 * np.pi * rng.random(m))
        exact = 2 * np.pi * (brdf(np.repeat(d, m, axis=1), v) * z).mean()
        worst = max(worst, abs(sampled / exact - 1))
        print(f"albedo at {np.degrees(theta):.0f} degrees: by sampling {sampled:.4f}, by quadrature {exact:.4f}")
    return median < limits[0] and p99 < limits[1] and worst < 0.02


if __name__ == "__main__":
    main()
