"""The Python package: what goes in and out, and what is heard of long work. Run by `cargo xtask python`."""

import os
import pathlib
import signal
import subprocess
import threading
import time

import numpy as np
import pytest

import gonia

DIRECTIONS = [[30.0, 45.0, 60.0, 225.0], [10.0, 0.0, 20.0, 180.0]]


def lopsided(rows):
    """A BRDF that no mirror and no half turn leaves alone: R, G, B of rows of angles in degrees."""
    ti, pi, tv, pv = np.radians(np.asarray(rows, dtype=float)).T
    light = np.array([np.sin(ti) * np.cos(pi), np.sin(ti) * np.sin(pi), np.cos(ti)])
    view = np.array([np.sin(tv) * np.cos(pv), np.sin(tv) * np.sin(pv), np.cos(tv)])
    half = light + view
    half /= np.linalg.norm(half, axis=0)
    lobe = np.exp(-6 * ((half[0] - 0.1) ** 2 + 3 * half[1] ** 2))
    value = 0.1 + 0.2 * lobe + 0.03 * (light[0] + view[0]) + 0.02 * (light[1] + view[1])
    return np.stack([value, 0.8 * value, 0.5 * value], axis=1)


def made(n, seed=1):
    """Angles, values and frames of n samples with one per cent of noise."""
    random = np.random.default_rng(seed)
    theta = np.degrees(np.arccos(random.uniform(np.cos(np.radians(80)), 1, (n, 2))))
    phi = random.uniform(0, 360, (n, 2))
    angles = np.column_stack([theta[:, 0], phi[:, 0], theta[:, 1], phi[:, 1]])
    values = lopsided(angles) * random.normal(1, 0.01, (n, 1))
    return np.column_stack([angles, values]), np.arange(n) // 20


@pytest.fixture(scope="module")
def dense():
    rows, frames = made(2000)
    samples = gonia.Samples(rows, frame=frames, scale="absolute")
    return gonia.fill(samples, step=10, error=True, symmetry="none")


def test_values_are_near_the_truth_and_turned_nowhere(dense):
    found = dense.query(DIRECTIONS)
    assert found.shape == (2, 3) and found.dtype == np.float32
    assert np.allclose(found, lopsided(DIRECTIONS), rtol=0.05)
    # At the nodes they are the nodes' values.
    i = [(3, 9), (4, 30)]
    at = [[10 * a, 10 * b, 10 * c, 10 * d] for (a, b), (c, d) in [i]]
    node = dense.values["G"][3, 9, 4, 30]
    assert dense.query(at)[0, 1] == pytest.approx(node, rel=1e-6)


def test_values_are_views_that_outlive_their_owner():
    rows, frames = made(400)
    dense = gonia.fill(gonia.Samples(rows, frame=frames), step=15, preset="preview")
    plane = dense.values["R"]
    assert plane.shape == (6, 24, 6, 24) and not plane.flags.writeable and not plane.flags.owndata
    assert np.shares_memory(plane, dense.values["R"])
    kept = plane.copy()
    del dense
    np.zeros(10_000_000)
    assert np.array_equal(plane, kept)
    with pytest.raises(ValueError):
        plane[0, 0, 0, 0] = 1


def test_uncertainties_are_there_and_true(dense):
    grid = np.array(np.meshgrid(dense.theta[:7], dense.phi[::9], dense.theta[:7], dense.phi[::9], indexing="ij"))
    truth = lopsided(grid.reshape(4, -1).T)[:, 1]
    here = np.s_[:7, ::9, :7, ::9]
    found, u = dense.values["G"][here].ravel(), dense.u["G"][here].ravel()
    within = np.mean(np.abs(found - truth) <= 2 * u)
    assert within > 0.85, within
    assert dense.origin.shape == dense.values["G"].shape and dense.origin.max() <= 3


@pytest.mark.parametrize("like", ["float32", "fortran", "list", "strided"])
def test_any_layout_and_type_that_means_the_same_is_the_same(like):
    rows = made(300)[0].astype(np.float32).astype(np.float64)
    other = {
        "float32": rows.astype(np.float32),
        "fortran": np.asfortranarray(rows),
        "list": rows.tolist(),
        "strided": np.repeat(rows, 2, axis=0)[::2],
    }[like]
    assert np.array_equal(gonia.Samples(rows).rows, gonia.Samples(other).rows)


def test_files_are_those_of_the_command(tmp_path, dense):
    rows, frames = made(2000)
    gonia.Samples(rows, frame=frames, scale="absolute").save(tmp_path / "s.npy")
    command = os.environ.get("GONIA")
    if command is None:
        pytest.skip("GONIA does not name the command")
    fill = [command, "fill", "s.npy", "-o", "d.exr", "--step", "10", "--symmetry", "none", "--error", "e.exr"]
    subprocess.run(fill, cwd=tmp_path, check=True, capture_output=True)
    by_command = gonia.read(tmp_path / "d.exr", error=tmp_path / "e.exr")
    for name in "RGB":
        assert np.array_equal(by_command.values[name], dense.values[name])
        assert np.array_equal(by_command.u[name], dense.u[name])
    dense.save(tmp_path / "mine.exr", error=tmp_path / "mine-error.exr")
    again = gonia.read(tmp_path / "mine.exr", error=tmp_path / "mine-error.exr")
    assert np.array_equal(again.u["B"], dense.u["B"]) and again.scale == "absolute"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: gonia.Samples(np.zeros((3, 6))), "6 columns; 7 are needed"),
        (lambda: gonia.Samples(np.zeros(3)), "1 dimensions"),
        (lambda: gonia.Samples([["a"] * 7]), "no type of numbers"),
        (lambda: gonia.Samples(np.zeros((3, 7)), channels=["X", "Y", "Z"]), "by their wavelengths"),
        (lambda: gonia.Samples(np.zeros((3, 7)), scale="huge"), 'scale "huge"'),
        (lambda: gonia.read("nowhere.exr"), "nowhere.exr"),
        (lambda: gonia.process("nowhere"), "nowhere"),
        (lambda: gonia.fill(made(300)[0], step=0.3), "step"),
        (lambda: gonia.fill(made(300)[0], symmetry="round"), 'symmetry "round"'),
        (lambda: gonia.fill(made(300)[0], preset="slow"), 'preset "slow"'),
    ],
)
def test_what_is_wrong_is_one_line(call, said):
    with pytest.raises(gonia.GoniaError) as caught:
        call()
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_directions_that_are_none_are_refused(dense):
    for rows in ([[95.0, 0, 10, 0]], [[np.nan, 0, 10, 0]], [[1.0, 2, 3]]):
        with pytest.raises(gonia.GoniaError, match="directions"):
            dense.query(rows)


def test_progress_is_told_and_may_end_the_work():
    rows, _ = made(3000)
    heard = []
    gonia.fill(rows, step=15, symmetry="none", progress=lambda step, share: heard.append((step, share)))
    assert ("interpolating", 1.0) in heard and all(0 <= share <= 1 for _, share in heard)

    def refuse(step, share):
        raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        gonia.fill(rows, step=15, symmetry="none", progress=refuse)


def test_ctrl_c_ends_it_and_other_threads_go_on():
    rows, frames = made(20000)
    samples = gonia.Samples(rows, frame=frames)
    counted = []
    is_over = threading.Event()

    def count():
        while not is_over.wait(0.01):
            counted.append(time.monotonic())

    thread = threading.Thread(target=count)
    thread.start()
    # A shell starts what runs in the background with Ctrl-C ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
    signal.setitimer(signal.ITIMER_REAL, 0.7)
    began = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            gonia.fill(samples, step=2, symmetry="none", error=True)
    finally:
        is_over.set()
        thread.join()
    assert time.monotonic() - began < 30
    assert len(counted) > 20


def test_few_samples_are_asked_without_a_grid():
    rows = np.column_stack([made(300)[0][:, :4], lopsided(made(300)[0][:, :4])[:, :1]])
    values, u = gonia.query(gonia.Samples(rows, channels=["Y"]), DIRECTIONS, symmetry="none")
    assert np.allclose(values[:, 0], lopsided(DIRECTIONS)[:, 0], rtol=0.1) and (u > 0).all()


def test_bands_compare_fit_and_render(dense, tmp_path):
    bands = np.column_stack([made(300)[0], made(300)[0][:, 4:5]])
    names = ["650nm", "550nm", "450nm", "400nm"]
    of_bands = gonia.fill(gonia.Samples(bands, channels=names), step=15, symmetry="none")
    assert of_bands.channels == sorted(names)
    same = gonia.compare(dense, dense)
    assert same["strata"]["all"]["log_rms"] == 0 and same["sphere_delta_e"] == 0
    found, model = gonia.fit(dense, "ggx")
    assert found["parameters"] and model.step == dense.step
    rgb, cover = gonia.render(dense, px=32)
    assert rgb.shape == (32, 32, 3) and cover.max() == 1 and np.isfinite(rgb).all()


def test_exports_say_what_they_lost(dense, tmp_path):
    with pytest.raises(gonia.GoniaError, match="coarser than the 4 degrees of RGL"):
        dense.export(tmp_path / "f.bsdf")
    found = dense.export(tmp_path / "f.bsdf", allow_coarse=True)
    assert (tmp_path / "f.bsdf").stat().st_size > 1000 and 0 <= found["median"] < 0.2
    with pytest.raises(gonia.GoniaError, match="bsdf"):
        dense.export(tmp_path / "f.unknown")


def test_xarray_has_names_units_and_uncertainty(dense):
    pytest.importorskip("xarray")
    data = dense.to_xarray()
    assert data.brdf.dims == ("channel", "theta_i", "phi_i", "theta_v", "phi_v")
    assert data.brdf.attrs["units"] == "1/sr" and data.theta_i.attrs["units"] == "degree"
    one = data.brdf.sel(channel="G", theta_i=30, phi_i=90, theta_v=40, phi_v=300)
    assert float(one) == float(dense.values["G"][3, 9, 4, 30])
    assert data.u.shape == data.brdf.shape and "samples" not in data.brdf.attrs


def run_page(name):
    """Runs the Python of a page of the book; the names that it has given."""
    page = pathlib.Path(__file__).parents[3] / "docs/src/guides" / name
    blocks = page.read_text(encoding="utf-8").split("```python\n")[1:]
    program = "\n".join(block.split("```")[0] for block in blocks)
    names = {}
    exec(compile(program, str(page), "exec"), names)
    return names


def test_the_books_page_runs(capsys, recwarn):
    names = run_page("python.md")
    assert names["values"].shape == (1, 3) and names["picture"].shape == (64, 64, 3)
    assert "gonia.Dense" in capsys.readouterr().out
