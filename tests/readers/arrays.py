#!/usr/bin/env python3
"""xarray reads what `gonia export` wrote as NetCDF and Zarr: values, axes, units, uncertainties, provenance.

usage: arrays.py GONIA    (numpy, OpenEXR, xarray, netCDF4 and zarr from PyPI; `cargo xtask readers` makes them)
Ends with 1 where something differs.
"""
import subprocess
import sys
import tempfile

import numpy as np
import xarray as xr

from lopsided import AZIMUTHS, RINGS, STEP, table

CASES = [
    ("colours", {"R": 1, "G": 0.5, "B": 0.25}, ["R", "G", "B"]),
    ("one value", {"Y": 1}, ["Y"]),
    ("bands", {"400nm": 1, "532.5nm": 0.5, "1064nm": 0.25, "10600nm": 0.125}, ["400nm", "532.5nm", "1064nm", "10600nm"]),
]


def holds(data, f, scales, names, u):
    """What differs in a data set, in words."""
    shape = (len(names), RINGS, AZIMUTHS, RINGS, AZIMUTHS)
    wanted = np.stack([scales[name] * f for name in names]).astype(np.float32).reshape(shape)
    axes = ("channel", "theta_i", "phi_i", "theta_v", "phi_v")
    if data.brdf.dims != axes or not np.array_equal(data.brdf.values, wanted):
        yield "values"
    if [str(c) for c in data.channel.values] != names:
        yield f"channels {data.channel.values}"
    if data.brdf.attrs["units"] != "1" or data.attrs["scale"] != "relative":
        yield "units"
    for axis, n in zip(axes[1:], shape[1:]):
        if data[axis].attrs["units"] != "degree" or not np.array_equal(data[axis].values, STEP * np.arange(n)):
            yield axis
    if names[0].endswith("nm"):
        if list(data.wavelength.values) != [float(name[:-2]) for name in names]:
            yield "wavelengths"
    if u and not np.array_equal(data.brdf_standard_uncertainty.values, np.float32(u) * wanted):
        yield "uncertainties"
    # By names of directions, and not mirrored: at light (40, 80) and view (24, 300).
    at = dict(theta_i=40.0, phi_i=80.0, theta_v=24.0, phi_v=300.0, channel=names[-1])
    row, column = 10 * AZIMUTHS + 20, 6 * AZIMUTHS + 75
    if float(data.brdf.sel(at)) != np.float32(scales[names[-1]] * f[row, column]):
        yield "a selected value"


def main():
    gonia = sys.argv[1]
    good = True
    with tempfile.TemporaryDirectory() as folder:
        for k, (what, scales, names) in enumerate(CASES):
            f = table(f"{folder}/dense.exr", scales)
            table(f"{folder}/error.exr", {name: 0.25 * by for name, by in scales.items()})
            for ending, open_it in [("nc", xr.open_dataset), ("zarr", xr.open_zarr)]:
                path = f"{folder}/{k}.{ending}"
                command = [gonia, "export", f"{folder}/dense.exr", "-o", path, "--error", f"{folder}/error.exr"]
                subprocess.run(command, check=True, capture_output=True)
                wrong = list(holds(open_it(path), f, scales, names, 0.25))
                print(f"{ending}, {what}: {', '.join(wrong) or 'as the table'}")
                good &= not wrong
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
