"""Drivers in C: time of a call with its distribution, and of many drivers at 100 Hz in one thread.

python -m laboratory.compiled [--drivers 1000] [--seconds 60] [--profile motorway] [--compiler gcc]
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
from pathlib import Path

import xosc_lateral as xl


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drivers", type=int, default=1000)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--compiler", default="gcc")
    settings = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        source = xl.export_c(xl.read_profile(settings.profile), folder)[1]
        program = Path(__file__).with_suffix(".c").read_text(encoding="utf-8").replace("DRIVER", source.stem)
        bench = Path(folder) / "bench.c"
        bench.write_text(program, encoding="utf-8")
        words = [settings.compiler, "-std=c99", "-O2", "-ffp-contract=off", str(source), str(bench), "-lm"]
        subprocess.run([*words, "-o", f"{folder}/bench"], check=True)
        for drivers in (1, settings.drivers):
            subprocess.run([f"{folder}/bench", str(drivers), str(settings.seconds)], check=True)


if __name__ == "__main__":
    main()
