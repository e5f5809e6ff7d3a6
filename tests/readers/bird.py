#!/usr/bin/env python3
"""BiRD's JSON as gonia writes it is what BiRD's schema says, and holds the table's values and uncertainties.

usage: bird.py GONIA    (numpy, OpenEXR and jsonschema from PyPI; `cargo xtask readers` makes them)
The rules are those of BRDF_JSON_schema of BiRD-project/BiRD_view, version 1.0, written down here. Ends with 1 where one is
broken.
"""
import json
import sys
import tempfile

import jsonschema
import numpy as np

from lopsided import brdf, check, direction, export, pairs, table

TEXT = {"type": "string"}
ADDRESS = ["country", "city", "street", "building_nr", "postal_code"]
NA = {"type": "string", "enum": ["NA"]}


def closed(properties, required):
    return {"type": "object", "properties": properties, "required": required, "additionalProperties": False}


def array(units, below=None):
    items = {"type": "number", "minimum": 0, **({"exclusiveMaximum": below} if below else {})}
    known = {"unit": {"type": "string", "enum": units}, "values": {"type": "array", "items": items}, "comments": TEXT}
    return closed(known, ["unit", "values"])


ADHOC = closed(
    {"name": TEXT, "description": TEXT, "unit": TEXT, "type": TEXT, "values": {"type": "array"}, "comments": TEXT},
    ["description", "unit", "type", "values"],
)
DATA = closed(
    {
        "theta_i": array(["deg"], 90),
        "phi_i": array(["deg"], 360),
        "theta_r": array(["deg"], 90),
        "phi_r": array(["deg"], 360),
        "BRDF": array(["1/sr", "sr^-1"]),
        "uBRDF": array(["1/sr", "sr^-1", "%"]),
        "wavelength_i": array(["nm"]),
        "wavelength_r": array(["nm"]),
        "adhoc_variables": {"type": "object", "additionalProperties": ADHOC},
    },
    ["theta_i", "phi_i", "theta_r", "phi_r", "BRDF"],
)
PROVENANCE = closed(
    {
        "organization": TEXT,
        "location": closed({name: TEXT for name in ADDRESS}, ADDRESS),
        "email": {"type": "string", "format": "email"},
        "contact_person": TEXT,
    },
    ["organization", "location", "email", "contact_person"],
)
SAMPLE = closed(
    {"name": TEXT, "type": TEXT, "dimensions": {"type": "object"}, "shape": TEXT, "zero_azimuth_location": TEXT},
    ["name", "type", "dimensions", "shape", "zero_azimuth_location"],
)
METADATA = closed(
    {
        "schema": {"type": "string", "format": "uri"},
        "id": {"type": "string", "format": "uri"},
        "type": {"type": "string", "const": "BRDF"},
        "timestamp": {"type": "string", "format": "date-time"},
        "provenance": PROVENANCE,
        "description": TEXT,
        "method": {"type": "string", "enum": ["simulation", "measurement"]},
        "instrumentation": NA,
        "software": closed({"name": TEXT, "version": TEXT, "comments": TEXT}, ["name"]),
        "sample": SAMPLE,
        "environment": NA,
        "comments": TEXT,
    },
    [
        "schema", "id", "type", "timestamp", "provenance", "description", "method", "instrumentation", "software",
        "sample", "environment",
    ],
)
SCHEMA = closed({"metadata": METADATA, "data": DATA}, ["metadata", "data"])


def main():
    gonia = sys.argv[1]
    good = True
    with tempfile.TemporaryDirectory() as folder:
        table(folder + "/dense.exr")
        table(folder + "/error.exr", {"R": 0.03, "G": 0.03, "B": 0.03})
        export(gonia, folder + "/dense.exr", folder + "/a.json", "--error", folder + "/error.exr")
        text = json.load(open(folder + "/a.json"))
    jsonschema.validate(text, SCHEMA, format_checker=jsonschema.FormatChecker())
    data = text["data"]
    column = lambda name: np.array(data[name]["values"])
    angle = lambda theta, phi: direction(np.radians(column(theta)), np.radians(column(phi)))
    light, view = angle("theta_i", "phi_i"), angle("theta_r", "phi_r")
    near = view[2] > np.cos(np.radians(75))
    good &= check("bird", column("BRDF")[near], light[:, near], view[:, near], (1e-6, 1e-5), function=brdf)
    share = column("uBRDF") / column("BRDF")
    print(f"bird: {share.size} values, uBRDF/BRDF {share.min():.4f} to {share.max():.4f}")
    good &= abs(share - 0.03).max() < 1e-5
    good &= samples(gonia)
    sys.exit(0 if good else 1)


def samples(gonia):
    """Whether samples are what the schema says, each with the scatter of the five of its direction."""
    light, view = (np.repeat(d, 5, axis=1) for d in pairs(400))
    f = brdf(light, view) * np.exp(0.015 * np.random.default_rng(2).normal(size=2000))
    degrees = lambda d: (np.degrees(np.arccos(d[2])), np.degrees(np.arctan2(d[1], d[0])) % 360)
    columns = [*degrees(light), *degrees(view), f, 2 * f, 3 * f]
    with tempfile.TemporaryDirectory() as folder:
        heading = "theta_i,phi_i,theta_v,phi_v,r,g,b"
        np.savetxt(folder + "/a.csv", np.stack(columns, -1), fmt="%.7g", delimiter=",", header=heading, comments="")
        export(gonia, folder + "/a.csv", folder + "/a.json")
        text = json.load(open(folder + "/a.json"))
    jsonschema.validate(text, SCHEMA, format_checker=jsonschema.FormatChecker())
    values, u = (np.array(text["data"][name]["values"]).reshape(-1, 3) for name in ("BRDF", "uBRDF"))
    off = abs(values / np.stack(columns[4:], -1) - 1).max()
    share = u / values
    print(f"bird, samples: values within {off:.1e}, uBRDF/BRDF {share.min():.4f} to {share.max():.4f} (noise 0.0150)")
    return off < 1e-5 and share.min() > 0.0135 and share.max() < 0.0165


if __name__ == "__main__":
    main()
