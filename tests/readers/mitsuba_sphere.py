#!/usr/bin/env python3
"""A sphere of a dense BRDF by `gonia render`, and by Mitsuba from what `gonia export` wrote, under one environment.

usage: mitsuba_sphere.py GONIA [DENSE.exr PICTURE.png]    (numpy, OpenEXR and mitsuba from PyPI)
Without DENSE.exr a BRDF that is neither mirrored nor turned into itself; with it, PICTURE.png shows gonia's sphere on
the left and Mitsuba's on the right. Ends with 1 where the two differ by more than the limits.
"""
import subprocess
import sys
import tempfile

import numpy as np
import OpenEXR

from lopsided import table

#: gonia's sphere reaches so far from the middle of the picture to its edge.
RADIUS = 0.96
#: Median of ln(Mitsuba / gonia), and of its absolute value, over the disc: Mitsuba's noise is in the second one.
LIMITS = (0.01, 0.03)


def main():
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    gonia, rest = sys.argv[1], sys.argv[2:]
    px, samples = (256, 1024) if rest else (96, 512)
    with tempfile.TemporaryDirectory() as folder:
        name = lambda of: f"{folder}/{of}"
        dense = rest[0] if rest else name("dense.exr")
        if not rest:
            table(dense)
        write(name("light.exr"), environment())
        run = lambda *of: subprocess.run([gonia, *of], check=True, capture_output=True)
        light = ["--light", name("light.exr"), "--lights", "4096", "--px", str(px)]
        run("render", dense, "-o", name("a.png"), "--linear", name("a.exr"), *light)
        run("export", dense, "-o", name("a.bsdf"), "--assume-scale", "1")
        ours = read(name("a.exr"))
        theirs = render(mi, name("a.bsdf"), name("light.exr"), px, samples)
    y, x = (np.mgrid[0:px, 0:px] + 0.5) / px * 2 - 1
    disc = x**2 + y**2 < (0.98 * RADIUS) ** 2
    ratio = np.log(theirs[disc] / ours[disc])
    bias, apart = abs(np.median(ratio)), np.median(abs(ratio))
    print(f"ln(Mitsuba / gonia) over the disc: median {bias:.4f}, median of its size {apart:.4f}")
    if rest:
        picture(mi, rest[1], ours, theirs, disc)
    sys.exit(0 if bias <= LIMITS[0] and apart <= LIMITS[1] else 1)


def environment(width=512, height=256):
    """A sun to the upper left of the viewer over a bright dome and dark ground, as a map whose first row looks up."""
    theta = np.pi * (np.arange(height) + 0.5) / height
    phi = 2 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    theta, phi = theta[:, None], phi[None, :]
    # The middle column is where the camera looks: -z, for a viewer at +z.
    towards = np.stack(np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)), -1)
    sun = np.array([-0.55, 0.62, 0.56]) / np.linalg.norm([-0.55, 0.62, 0.56])
    off = np.degrees(np.arccos(np.clip(towards @ sun, -1, 1)))[..., None]
    dome = np.where(towards[..., 1:2] > 0, [0.4, 0.55, 0.9], [0.12, 0.11, 0.1])
    return dome + np.array([1, 0.92, 0.78]) * (60 * np.exp(-((off / 5) ** 2)) + 0.6 * np.exp(-off / 20))


def render(mi, bsdf, light, px, samples):
    """Mitsuba's sphere, seen from afar; its x axis runs along the parallels, as gonia's."""
    place = mi.ScalarTransform4f
    # The sphere's poles are on its z axis: z goes up, x to the viewer, y to the right.
    turned = place([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    seen = place().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0]) @ place().scale([1 / RADIUS, 1 / RADIUS, 1])
    film = {"type": "hdrfilm", "width": px, "height": px, "rfilter": {"type": "box"}, "pixel_format": "rgb"}
    scene = {
        "type": "scene",
        "integrator": {"type": "direct"},
        "sensor": {"type": "orthographic", "to_world": seen, "film": film},
        "light": {"type": "envmap", "filename": light, "to_world": place().rotate([0, 1, 0], 180)},
        "sphere": {"type": "sphere", "to_world": turned, "bsdf": {"type": "measured", "filename": bsdf}},
    }
    return np.array(mi.render(mi.load_dict(scene), spp=samples))


def picture(mi, path, ours, theirs, disc):
    """Both side by side, equally exposed."""
    both = np.concatenate([np.where(disc[..., None], of, 0.9) for of in (ours, theirs)], axis=1)
    both = np.where(np.tile(disc, (1, 2))[..., None], both / np.quantile(ours[disc], 0.995), 0.9)
    mi.Bitmap(both.astype(np.float32)).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, True).write(path)


def write(path, rgb):
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGB": np.ascontiguousarray(rgb, dtype=np.float32)}) as file:
        file.write(path)


def read(path):
    with OpenEXR.File(path) as file:
        of = file.channels()
        return of["RGB"].pixels if "RGB" in of else np.stack([of[c].pixels for c in "RGB"], -1)


if __name__ == "__main__":
    main()
