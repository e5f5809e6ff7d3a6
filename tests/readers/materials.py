#!/usr/bin/env python3
"""Fitted materials in other programs: Mitsuba's `principled` has the values of gonia's, and MaterialX takes the files.

usage: materials.py GONIA    (numpy, OpenEXR, mitsuba and MaterialX from PyPI; `cargo xtask readers` makes them)
A table of Mitsuba's own `principled`, with its tangent off the sample's x axis, is fitted by gonia; Mitsuba loads the file
that gonia writes and is compared with gonia's table of the same fit, and the parameters with those of the start. glTF's and OpenPBR's
values are compared with a second implementation (second_models.py). Every MaterialX file is validated against the standard libraries, and a shader is generated from it. Ends with 1 where a limit
is exceeded.
"""
import json
import subprocess
import sys
import tempfile

import MaterialX as mx
import numpy as np
import OpenEXR
from MaterialX import PyMaterialXGenGlsl, PyMaterialXGenShader

from lopsided import direction
from second_models import MODELS

STEP = 5.0
RINGS, AZIMUTHS = int(86 // STEP) + 1, round(360 / STEP)
AZIMUTH = 23.0
TRUTH = {
    "roughness": 0.42,
    "anisotropic": 0.6,
    "metallic": 0.25,
    "specular": 0.6,
    "spec_tint": 0.3,
    "sheen": 0.35,
    "sheen_tint": 0.6,
    "flatness": 0.2,
    "clearcoat": 0.5,
    "clearcoat_gloss": 0.3,
}
BASE = [0.5, 0.3, 0.12]


def grid():
    """Unit vectors of the nodes, 3 x N."""
    theta, phi = np.meshgrid(
        np.radians(STEP * np.arange(RINGS)), np.radians(STEP * np.arange(AZIMUTHS)), indexing="ij"
    )
    return direction(theta.ravel(), phi.ravel())


def turned(v, degrees):
    """In axes turned by an angle about the normal."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.stack([v[0] * c + v[1] * s, v[1] * c - v[0] * s, v[2]])


def evaluate(mi, dr, bsdf, light, view, azimuth):
    """f in 1/sr, 3 x N, of 3 x N directions of the sample."""
    light, view = turned(light, azimuth), turned(view, azimuth)
    si = dr.zeros(mi.SurfaceInteraction3f, light.shape[1])
    si.wi = mi.Vector3f(light)
    return np.array(bsdf.eval(mi.BSDFContext(), si, mi.Vector3f(view))) / view[2]


def write(path, values):
    """Writes a table of 3 x N x N values that are 1/sr."""
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    planes = {c: v.astype(np.float32) for c, v in zip("RGB", values)}
    with OpenEXR.File(header, planes) as file:
        file.write(path)


def read(path):
    with OpenEXR.File(path, separate_channels=True) as file:
        return np.stack([file.channels()[c].pixels for c in "RGB"])


def run(*command):
    return subprocess.run([str(c) for c in command], check=True, capture_output=True, text=True).stdout


def in_a_scene(mi, path):
    """The material of a file, on a rectangle of a scene that includes it."""
    scene = mi.load_string(
        f'<scene version="3.0.0"><include filename="{path}"/>'
        '<shape type="rectangle"><ref id="material"/></shape></scene>'
    )
    return scene.shapes()[0].bsdf()


def mitsuba(gonia, folder):
    import mitsuba as mi

    mi.set_variant("scalar_rgb" if "llvm_ad_rgb" not in mi.variants() else "llvm_ad_rgb")
    import drjit as dr

    own = mi.load_dict({"type": "principled", "base_color": {"type": "rgb", "value": BASE}, **TRUTH})
    d = grid()
    n = d.shape[1]
    light, view = np.repeat(d, n, axis=1), np.tile(d, (1, n))
    table = evaluate(mi, dr, own, light, view, AZIMUTH).reshape(3, n, n)
    write(folder + "/dense.exr", table)
    outputs = ["fit.exr", "fit.xml", "fit.mtlx", "fit.json"]
    arguments = [a for o in outputs for a in ("-o", f"{folder}/{o}")]
    run(gonia, "fit", folder + "/dense.exr", "--model", "principled", "--assume-scale", 1, *arguments)
    fit = json.load(open(folder + "/fit.json"))
    found = fit["parameters"]
    print(f"principled: fitted with RMS of ln {fit['error']['log_rms']:.5f}, dE00 {fit['error']['delta_e00_sphere']:.3f}")
    good = fit["error"]["log_rms_interior"] < 0.01
    for name, truth in {**TRUTH, "azimuth": AZIMUTH}.items():
        off = found[name] - truth
        if abs(off) > 0.02 * max(1.0, abs(truth)):
            print(f"principled: {name} is {found[name]:.4f}, not {truth}")
            good = False

    theirs = in_a_scene(mi, folder + "/fit.xml")
    ours = read(folder + "/fit.exr").reshape(3, -1)
    rng = np.random.default_rng(1)
    some = rng.choice(n * n, 200_000, replace=False)
    seen = evaluate(mi, dr, theirs, light[:, some], view[:, some], found["azimuth"])
    error = np.abs(seen / ours[:, some] - 1)
    wrong = np.abs(evaluate(mi, dr, theirs, light[:, some], view[:, some], -found["azimuth"]) / ours[:, some] - 1)
    print(
        f"principled: gonia's values against Mitsuba's at {some.size} pairs: median {np.median(error):.1e}, "
        f"p99 {np.quantile(error, 0.99):.1e}, largest {error.max():.1e}; mirrored {np.median(wrong):.1e}"
    )
    return good and error.max() < 1e-3 and np.median(wrong) > 0.05


def second(model, found, table):
    """Whether a table has the values of a second implementation of its model."""
    d = grid()
    n = d.shape[1]
    light, view = np.random.default_rng(2).integers(n, size=(2, 50_000))
    ours = table[:, light, view]
    i, v = turned(d[:, light], found["azimuth"]), turned(d[:, view], found["azimuth"])
    error = np.abs(MODELS[model](found, i, v) / ours - 1)
    print(
        f"{model}: against a second implementation at {light.size} pairs: median {np.median(error):.1e}, "
        f"p99 {np.quantile(error, 0.99):.1e}, largest {error.max():.1e}"
    )
    # The sheen's albedo is a table in gonia, and integrated by other sums here.
    return error.max() < 1e-3


def materialx(path):
    """Whether MaterialX finds a file valid, and makes a shader of it."""
    libraries = mx.createDocument()
    search = mx.getDefaultDataSearchPath()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), search, libraries)
    document = mx.createDocument()
    mx.readFromXmlFile(document, path)
    document.importLibrary(libraries)
    valid, message = document.validate()
    shader = document.getNode("fitted")
    definition = shader.getNodeDef()
    unknown = [i.getName() for i in shader.getInputs() if definition is None or definition.getActiveInput(i.getName()) is None]
    generator = PyMaterialXGenGlsl.GlslShaderGenerator.create()
    context = PyMaterialXGenShader.GenContext(generator)
    context.registerSourceCodeSearchPath(search)
    source = generator.generate("material", document.getNode("material"), context).getSourceCode("pixel")
    good = valid and not unknown and len(source) > 1000
    print(f"{path.rsplit('/', 1)[1]}: {shader.getCategory()} valid {valid} {message}, shader of {len(source)} characters")
    if unknown:
        print(f"inputs that the node does not have: {unknown}")
    return good


def main():
    gonia = sys.argv[1]
    with tempfile.TemporaryDirectory() as folder:
        good = mitsuba(gonia, folder)
        good &= materialx(folder + "/fit.mtlx")
        for model, more in [("gltf", ["gltf"]), ("openpbr", [])]:
            outputs = [f"{folder}/{model}.{ending}" for ending in ["exr", "mtlx", "json", *more]]
            arguments = [a for o in outputs for a in ("-o", o)]
            quick = ["--cells", 3000, "--starts", 8]
            run(gonia, "fit", folder + "/dense.exr", "--model", model, "--assume-scale", 1, *quick, *arguments)
            fit = json.load(open(f"{folder}/{model}.json"))
            print(f"{model}: fitted with RMS of ln {fit['error']['log_rms']:.4f}, dE00 {fit['error']['delta_e00_sphere']:.2f}")
            good &= second(model, fit["parameters"], read(f"{folder}/{model}.exr"))
            good &= materialx(f"{folder}/{model}.mtlx")
        asset = json.load(open(folder + "/gltf.gltf"))
        good &= asset["asset"]["version"] == "2.0" and len(asset["materials"]) == 1
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
