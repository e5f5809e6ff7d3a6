"""gonia on several processes, by Dask on the loopback: the same bytes as one process, also when a worker is killed."""

import os
import pathlib
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

import gonia
import gonia.dask
from test_gonia import DIRECTIONS, lopsided, made, run_page

distributed = pytest.importorskip("dask.distributed")


RIG = """
[light]
distance_m = 1.1
[camera]
distance_m = 1.8
width_px = 240
height_px = 240
focal_px = 375.0
centre_px = [120.0, 120.0]
[target]
line_offset_mm = 335.0
line_width_mm = 4.0
material_half_mm = 320.0
[reference]
reflectance = [0.9, 0.9, 0.9]
[sampling]
disc_radius_mm = 277.0
grid_mm = 14.0
patch_mm = 14.0
"""


@pytest.fixture(scope="module")
def client():
    cluster = distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
    )
    with cluster, distributed.Client(cluster) as client:
        yield client


def some(n, seed=1):
    rows, frames = made(n, seed)
    return gonia.Samples(rows, frame=frames, scale="absolute", provenance={"rig": "none"})


def files(folder):
    folder = pathlib.Path(folder)
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def pids(client):
    return list(client.run(os.getpid).values())


def test_two_workers_write_the_bytes_of_one_process_though_one_is_killed(client, tmp_path):
    samples = some(9000)
    gonia.fill(samples, step=7.5).export(tmp_path / "one.zarr")
    before = pids(client)
    steps = []

    def progress(step, share):
        if step == "fitting" and not steps:
            os.kill(before[0], signal.SIGKILL)
        steps.append((step, share))

    path = gonia.dask.fill(client, samples, tmp_path / "two.zarr", step=7.5, parts=12, progress=progress)
    assert path == str(tmp_path / "two.zarr")
    assert steps[-1] == ("interpolating and writing", 1.0) and steps[0][1] <= 1 / 12 + 1e-9
    client.wait_for_workers(2)
    assert before[0] not in pids(client) and len(pids(client)) == 2
    assert files(tmp_path / "two.zarr") == files(tmp_path / "one.zarr")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one.zarr", "two.zarr"]

    import zarr

    table = zarr.open_group(str(tmp_path / "two.zarr"), mode="r")
    assert np.array_equal(gonia.read(path).values["G"], table["brdf"][1])
    node = table["brdf"][1, 4, 6, 8, 30]
    truth = lopsided([[30.0, 45.0, 60.0, 225.0]])[0, 1]
    assert node == pytest.approx(truth, rel=0.05)


def test_a_fill_whose_process_is_killed_goes_on_where_it_was(client, tmp_path):
    samples = some(9000)
    samples.save(tmp_path / "samples.npy")
    script = """if True:
        import os, sys, gonia, gonia.dask
        from dask.distributed import Client, LocalCluster
        def die(step, share):
            if step == "fitting" and share >= 0.5:
                os.kill(os.getpid(), 9)
        if __name__ == "__main__":
            cluster = LocalCluster(n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address=None)
            gonia.dask.fill(Client(cluster), sys.argv[1], sys.argv[2], step=7.5, parts=12, progress=die)
    """
    (tmp_path / "script.py").write_text(script)
    names = [str(tmp_path / name) for name in ("script.py", "samples.npy", "dense.zarr")]
    ended = subprocess.run([sys.executable, *names], capture_output=True, timeout=120)
    assert ended.returncode == -signal.SIGKILL, ended.stderr.decode()
    folder = tmp_path / "dense.zarr.parts"
    solved = {p.name: p.stat().st_mtime_ns for p in (folder / "solved-0").iterdir() if p.name[0] != "."}
    assert solved and not (tmp_path / "dense.zarr").exists()

    with pytest.raises(gonia.GoniaError, match="another fill"):
        gonia.dask.fill(client, some(9000, seed=2), tmp_path / "dense.zarr", step=7.5)
    kept = {}

    def look(step, share):
        if step == "fitting" and share == 1.0:
            here = (folder / "solved-0").iterdir()
            kept.update({p.name: p.stat().st_mtime_ns for p in here})

    gonia.dask.fill(client, tmp_path / "samples.npy", tmp_path / "dense.zarr", step=7.5, progress=look)
    assert all(kept[name] == when for name, when in solved.items())
    gonia.fill(gonia.read_samples(tmp_path / "samples.npy"), step=7.5).export(tmp_path / "one.zarr")
    assert files(tmp_path / "dense.zarr") == files(tmp_path / "one.zarr")


def test_frames_by_shares_give_the_samples_of_one_process(client, tmp_path):
    command = os.environ.get("GONIA") or shutil.which("gonia")
    assert command, "the command gonia is needed: set GONIA to its path"
    (tmp_path / "rig.toml").write_text(RIG)
    plan = ["plan", "rig.toml", "-o", "plan.csv", "--views", "0:1,30:3", "--lights", "15:3"]
    capture = ["capture", "session", "--rig", "rig.toml", "--plan", "plan.csv", "--simulated", "--keep-frames"]
    for arguments in (plan, capture):
        run = subprocess.run([command, *arguments], cwd=tmp_path, capture_output=True, text=True)
        assert run.returncode == 0, run.stderr
    folder = tmp_path / "session"
    one, two = gonia.process(folder), gonia.dask.process(client, folder)
    assert np.array_equal(one.rows, two.rows) and len(one) > 1000
    assert one.provenance == two.provenance


def test_each_material_is_a_task_and_a_wrong_one_does_not_stop_the_others(client, tmp_path):
    some(1500).save(tmp_path / "a.npy")
    materials = {"a": tmp_path / "a.npy", "b": some(1500, seed=2), "few": some(3)}
    with pytest.raises(gonia.GoniaError):
        gonia.dask.fill_each(client, materials, tmp_path / "out", step=15, error=True)
    del materials["few"]
    paths = gonia.dask.fill_each(client, materials, tmp_path / "out", step=15, error=True)
    for name, path in paths.items():
        dense = gonia.read(path, error=tmp_path / "out" / f"{name}-error.exr")
        assert np.allclose(dense.query(DIRECTIONS), lopsided(DIRECTIONS), rtol=0.1)


def test_what_cannot_be_is_one_line(client, tmp_path):
    with pytest.raises(gonia.GoniaError, match="ends in .zarr"):
        gonia.dask.fill(client, some(100), tmp_path / "dense.exr")
    (tmp_path / "there.zarr").mkdir()
    with pytest.raises(gonia.GoniaError, match="is there already"):
        gonia.dask.fill(client, some(100), tmp_path / "there.zarr")
    with pytest.raises(gonia.GoniaError, match="no bins|at least"):
        gonia.dask.fill(client, some(3), tmp_path / "few.zarr", step=15)
    assert [p.name for p in tmp_path.iterdir()] == ["there.zarr"]


def test_few_samples_are_filled_by_one_worker(client, tmp_path):
    samples = gonia.Samples(made(300)[0], scale="absolute")
    gonia.dask.fill(client, samples, tmp_path / "two.zarr", step=15)
    gonia.fill(samples, step=15).export(tmp_path / "one.zarr")
    assert files(tmp_path / "two.zarr") == files(tmp_path / "one.zarr")


def test_the_books_page_runs(tmp_path, monkeypatch, capsys, recwarn):
    monkeypatch.chdir(tmp_path)
    # dask_jobqueue takes Ctrl-C for itself as it is imported.
    of_ctrl_c = signal.getsignal(signal.SIGINT)
    try:
        names = run_page("cluster.md")
    finally:
        signal.signal(signal.SIGINT, of_ctrl_c)
    assert pathlib.Path(names["path"]).is_dir() and len(names["paths"]) == 2
    script = names["slurm"].job_script()
    assert "--cpus-per-task=32" in script and "--nthreads 1" in script, script
