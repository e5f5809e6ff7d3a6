#!/usr/bin/env python3
"""Mitsuba's `measured` reads what `gonia export` wrote, the right way round, and samples it rightly.

usage: mitsuba_bsdf.py GONIA    (numpy, OpenEXR and mitsuba from PyPI; `cargo xtask readers` makes them)
A BRDF that is neither mirrored nor turned into itself is tabulated by this script, exported by gonia and
evaluated by Mitsuba. Ends with 1 where a limit is exceeded.
"""
import subprocess
import sys
import tempfile

import numpy as np
import OpenEXR

STEP = 4.0
RINGS, AZIMUTHS = 22, 90


def direction(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def brdf(light, view):
    """1/sr, green, for 3 x N directions: reciprocal, and asymmetric in every way."""
    lobe = lambda v: 1 + 0.4 * v[0] + 0.3 * v[1] + 0.3 * v[0] * v[1]
    half = light + view
    half /= np.linalg.norm(half, axis=0)
    return 0.1 * lobe(light) * lobe(view) + np.exp(-30 * (1 - half[2]))


def table(path):
    theta, phi = np.meshgrid(np.radians(STEP * np.arange(RINGS)), np.radians(STEP * np.arange(AZIMUTHS)), indexing="ij")
    d = direction(theta.ravel(), phi.ravel())
    n = d.shape[1]
    light = np.repeat(d, n, axis=1)
    view = np.tile(d, (1, n))
    f = brdf(light, view).reshape(n, n).astype(np.float32)
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {c: f for c in "RGB"}) as file:
        file.write(path)


def main():
    gonia = sys.argv[1]
    import mitsuba as mi

    mi.set_variant("scalar_rgb" if "llvm_ad_rgb" not in mi.variants() else "llvm_ad_rgb")
    import drjit as dr

    with tempfile.TemporaryDirectory() as folder:
        table(folder + "/dense.exr")
        command = [gonia, "export", folder + "/dense.exr", "-o", folder + "/a.bsdf", "--assume-scale", "1"]
        subprocess.run(command, check=True)
        bsdf = mi.load_dict({"type": "measured", "filename": folder + "/a.bsdf"})
    rng = np.random.default_rng(1)
    n = 20_000
    angles = lambda: (np.radians(75 * rng.random(n)), 2 * np.pi * rng.random(n))
    light, view = direction(*angles()), direction(*angles())
    si = dr.zeros(mi.SurfaceInteraction3f, n)
    si.wi = mi.Vector3f(light)
    seen = np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(view)))[1] / view[2]
    error = np.abs(np.log(seen / brdf(light, view)))
    median, p99 = np.median(error), np.quantile(error, 0.99)
    print(f"values: |ln| median {median:.4f}, p99 {p99:.4f}")

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
    sys.exit(0 if median < 0.01 and p99 < 0.06 and worst < 0.02 else 1)


if __name__ == "__main__":
    main()
