"""A drive that nothing was fitted to, beside sampled ones: KITTI's odometry 01, one motorway, measured with RTK GNSS.

    python -m laboratory.unseen_drive POSES.txt [--times TIMES.txt] [--profile motorway]

Poses: of the odometry benchmark's ground truth, 12 numbers of a row of a 3 x 4 matrix a line, with or without the time
before them. No lane centre is known: the path less a polynomial of it over time, in the straightest 42 s at 20 m/s and
more, shows what is faster than the road's bends; sampled offsets are taken through the same. Power in eight bands from
0.1 to 1 Hz as a multiple of the sampled drives' mean, and the share of these that have less.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.files.profiles import find_profile, read_profile

FloatArray = NDArray[np.float64]
LEAST_SPEED = 20.0
STEP, DRIVES = 0.2, 400
CENTRES = np.geomspace(0.1, 1.0, 8)


def powers(time: FloatArray, offset: FloatArray, order: int) -> FloatArray:
    """In each band, of an offset less its polynomial."""
    u = np.linspace(-1.0, 1.0, len(time))
    rest = offset - np.polynomial.legendre.Legendre.fit(u, offset, order)(u)
    spectrum, at = np.abs(np.fft.rfft(rest * np.hanning(len(rest)))) ** 2, np.fft.rfftfreq(len(rest), STEP)
    edges = np.sqrt(CENTRES[1] / CENTRES[0])
    return np.array([spectrum[(at >= f / edges) & (at < f * edges)].mean() for f in CENTRES])


def lateral(x: FloatArray, y: FloatArray, order: int) -> FloatArray:
    """Across the smooth path, positive left. [m]"""
    u = np.linspace(-1.0, 1.0, len(x))
    smooth = [np.polynomial.legendre.Legendre.fit(u, one, order) for one in (x, y)]
    dx, dy = (one.deriv()(u) for one in smooth)
    return ((y - smooth[1](u)) * dx - (x - smooth[0](u)) * dy) / np.hypot(dx, dy)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("poses", type=Path)
    parser.add_argument("--times", type=Path)
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--seconds", type=float, default=42.0, help="the stretch of so long that bends least")
    args = parser.parse_args()
    rows = np.loadtxt(args.poses)
    time = rows[:, 0] if rows.shape[1] == 13 else np.loadtxt(args.times)
    matrix = rows[:, -12:]
    grid = np.arange(time[0], time[-1], STEP)
    x, y = (np.interp(grid, time, values) for values in (matrix[:, 11], -matrix[:, 3]))  # ahead, left at the start
    speed = np.hypot(np.gradient(x, STEP), np.gradient(y, STEP))
    heading, n = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x))), round(args.seconds / STEP)
    begins = [k for k in range(len(grid) - n) if speed[k : k + n].min() >= LEAST_SPEED]
    first = min(begins, key=lambda k: float(np.ptp(heading[k : k + n])))
    part = slice(first, first + n)
    order = max(4, round(0.12 * STEP * (part.stop - part.start)))  # half waves of what is slower than 0.06 Hz
    own = powers(grid[part], lateral(x[part], y[part], order), order)
    profile = read_profile(find_profile(args.profile))
    runs = free_runs(
        profile, 1, drivers=DRIVES, duration=STEP * (part.stop - part.start - 1), speed=float(speed[part].mean())
    )
    sampled = np.array([powers(grid[part], run, order) for run in runs])
    seconds, slowest, fastest = STEP * n, speed[part].min(), speed[part].max()
    print(f"{seconds:.0f} s at {slowest:.1f} to {fastest:.1f} m/s, {profile.name}")
    for centre, ratio, rank in zip(CENTRES, own / sampled.mean(axis=0), (sampled < own).mean(axis=0), strict=True):
        print(f"{centre:.2f} Hz: {ratio:.2f} of the mean sampled power, above {100.0 * rank:.0f} % of sampled drives")


if __name__ == "__main__":
    main()
