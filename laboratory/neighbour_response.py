"""In what form do neighbours act on the offset? What each form leaves of its variance within drivers.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python -m laboratory.neighbour_response dlr.parquet [--write PAGE.md]

exp(-free space / scale) to the left and to the right, delayed (negative: drivers look ahead) and with a first-order
lag; least squares once a second, beside class, lane and speed.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.markers import show
from xosc_lateral.drivers.drives.drive import STEP, Run, all_runs
from xosc_lateral.drivers.fitting.context_effects import NEIGHBOURS
from xosc_lateral.drivers.model.effects import Acts, Proximity
from xosc_lateral.files.drives import read_drives

FloatArray = NDArray[np.float64]

SCALES = (10.0, 20.0, 40.0, 80.0)  # [m]
FORMS = (
    *((lag, response, 1) for lag in (0.0, -1.0, -2.0) for response in (0.0, 1.0, 2.0, 4.0) if response >= -lag),
    *((lag, response, 2) for lag in (0.0, -1.0, -2.0) for response in (0.5, 1.0, 2.0) if 2.0 * response >= -lag),
)
"""Delay and lag [s], and how many lags in a row [-]."""
EVERY = 5  # rows: 1 s


def columns(run: Run, effects: Sequence[Proximity]) -> FloatArray:
    """Class, lane, speed and responses to neighbours, then the offset, shape (n, k)."""
    beside = [
        effect.response(STEP, run.context)[:, 0] if effect.column in run.context else np.zeros(len(run))
        for effect in effects
    ]
    own = (run.context["is_truck"], run.context["lane_index"] == 0, run.context["speed"])
    return np.column_stack([*own, *beside, run.offset])[::EVERY]


def left(runs: Sequence[Run], effects: Sequence[Proximity]) -> float:
    """Share of the variance within drivers. [-]"""
    rows = np.concatenate([columns(run, effects) for run in runs])
    names = np.concatenate([[run.drive] * len(run.time[::EVERY]) for run in runs])
    _, drive = np.unique(names, return_inverse=True)
    counts = np.bincount(drive)
    within = rows - np.column_stack([np.bincount(drive, column) / counts for column in rows.T])[drive]
    x, y = within[:, :-1], within[:, -1]
    rest = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    return float((rest @ rest) / (y @ y))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="+")
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    runs = all_runs(read_drives(args.table))
    lines = [
        f"| delay, lags [s] | {' | '.join(f'{scale:g} m' for scale in SCALES)} |",
        "|---" * (len(SCALES) + 1) + "|",
    ]
    for lag, response, order in FORMS:
        several = [
            [
                Proximity(
                    acts=Acts.LOCATION,
                    column=name,
                    scale=scale,
                    lag_s=lag,
                    response_s=response,
                    response_order=order,
                )
                for name in NEIGHBOURS
            ]
            for scale in SCALES
        ]
        cells = " | ".join(f"{100 * left(runs, effects):.1f} %" for effects in several)
        lines.append(f"| {lag:g}, {' and '.join([f'{response:g}'] * order)} | {cells} |")
    show("\n".join(lines), args.write, "neighbour-response")


if __name__ == "__main__":
    main()
