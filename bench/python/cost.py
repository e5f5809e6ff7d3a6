"""CPU time of `gonia fill` and of gonia.fill on the same samples: see README.md."""

import argparse
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

PROGRAM = """
import sys, gonia
gonia.fill(gonia.read_samples(sys.argv[1]), step=float(sys.argv[2])).save(sys.argv[3])
"""


def cpu_seconds(command):
    """CPU time of a process and of what it starts."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"failed: {command}")
    return used.ru_utime + used.ru_stime


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("gonia", type=pathlib.Path)
    arguments.add_argument("samples", type=pathlib.Path)
    arguments.add_argument("--step", default="4")
    arguments.add_argument("--runs", type=int, default=5)
    of = arguments.parse_args()
    ratios = []
    print("| run | command, CPU-s | Python, CPU-s | ratio |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        a, b = (str(pathlib.Path(folder) / name) for name in ("a.exr", "b.exr"))
        for run in range(of.runs):
            fill = [str(of.gonia), "fill", str(of.samples), "-o", a, "--step", of.step]
            python = [sys.executable, "-c", PROGRAM, str(of.samples), of.step, b]
            # In turn the one and the other first: the second one finds the file in memory.
            if run % 2:
                by_python, by_command = cpu_seconds(python), cpu_seconds(fill)
            else:
                by_command, by_python = cpu_seconds(fill), cpu_seconds(python)
            ratios.append(by_python / by_command)
            print(f"| {run + 1} | {by_command:.2f} | {by_python:.2f} | {ratios[-1]:.3f} |", flush=True)
    print(f"\nmedian of the ratios: {statistics.median(ratios):.3f}")


if __name__ == "__main__":
    main()
