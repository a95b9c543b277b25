"""Whether free runs of `autoregressive`, fitted to one drive, move as much as the drive does, at every pace.

    python -m laboratory.core_spread [DRIVE_TABLE ...] [--seeds 40 80]

Drives are those in the tables, or of the tests' simulator (50 min each). A number is the mean over drives of the
logarithm of sampled over measured standard deviation, as a factor, and the largest of a single drive (in brackets): of
the offset, and of its movement between averaging times. The last column is the mean distance of the ten metrics of 10 s
snippets, in standard deviations of the measured metric. Each row fits the memory of the coarse movement in another way.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from examples.driver_simulator import simulate_drive
from tests.kit.profiles import as_drive
from tests.kit.snippet_distances import snippet_distances
from xosc_lateral.drivers.drives.drive import PAPER_RULES, Drive, all_runs
from xosc_lateral.drivers.fitting.models import autoregressive_coarse as fit_coarse
from xosc_lateral.drivers.fitting.models import autoregressive_fit as fitting
from xosc_lateral.drivers.fitting.models.autoregressive_fit import simulate
from xosc_lateral.drivers.fitting.models.likelihood import fit_autoregression
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.core.autoregressive.parameters import Autoregression, stabilise
from xosc_lateral.extras.loop.timeline import Timeline, join_drives, local_mean
from xosc_lateral.files.drives import read_drives

FloatArray = NDArray[np.float64]
Fit = Callable[[Sequence[FloatArray]], AutoregressiveModel]

TIMES = (1.0, 3.0, 8.0, 20.0, 60.0, 200.0)
"""Averaging times between which the bands lie. [s]"""

SNIPPET = 51


def per_driver(runs: Sequence[FloatArray], order: int = fitting.DEFAULT_SETTINGS.order) -> AutoregressiveModel:
    settings = fitting.FitSettings(order=order)
    return fitting.fit_autoregressive(runs, ["one"] * len(runs), settings)


def calm_moments(seconds: float) -> Fit:
    """Each moment weighted by how calm its surroundings are, as the fit did at first (with 10 s)."""

    def weighted(
        runs: Sequence[FloatArray], order: int, *, every: int, drivers: Sequence[str]
    ) -> tuple[Autoregression, float]:
        first, between = fit_autoregression(runs, order, every=every, drivers=drivers)
        coefficients = first.coefficients
        long = [run for run in runs if len(run) > every * (order + 1)]
        pasts = [np.stack([run[every * (order - 1 - k) : len(run) - every * (k + 1)] for k in range(order)], axis=1)
                 for run in long]  # fmt: skip
        nexts = [run[every * order :] for run in long]
        for _ in range(3):
            normal, right = 1e-9 * np.eye(order), np.zeros(order)
            for past, value in zip(pasts, nexts, strict=True):
                everywhere = np.ones(len(value), dtype=np.bool_)
                weight = 1.0 / local_mean((value - past @ coefficients) ** 2, everywhere, seconds)
                normal += (past * weight[:, None]).T @ past
                right += (past * weight[:, None]).T @ value
            coefficients = np.linalg.solve(normal, right)
        return Autoregression(stabilise(coefficients), first.scale), between

    def fit(runs: Sequence[FloatArray]) -> AutoregressiveModel:
        with patch.object(fit_coarse, "fit_autoregression", weighted):
            return per_driver(runs)

    return fit


VARIANTS: dict[str, Fit] = {
    "**all moments of a driver alike**": per_driver,
    "the same, memory of 24 s": lambda runs: per_driver(runs, 24),
    "by how calm 150 s are": calm_moments(150.0),
    "by how calm 40 s are": calm_moments(40.0),
    "by how calm 10 s are": calm_moments(10.0),
}


def bands(rel_offset: FloatArray, timeline: Timeline) -> FloatArray:
    """Standard deviation of the offset, and of its movement between averaging times, shape (2 + len(TIMES),). [-]"""
    valid = timeline.valid
    levels = [rel_offset, *(local_mean(rel_offset, valid, seconds) for seconds in TIMES)]
    inside = [level[valid] for level in levels]
    return np.array([inside[0].std(), *(np.std(a - b) for a, b in pairwise(inside)), inside[-1].std()])


def score(drive: Drive, fit: Fit, n_runs: int, number: int) -> tuple[FloatArray, float]:
    """Logarithms of sampled over measured movement, and the mean distance of the ten metrics."""
    timeline = join_drives([drive], PAPER_RULES)
    runs = [run.rel_offset for run in all_runs([drive])]
    model = fit(runs)
    n = len(timeline)
    sampled = [sum(model.stream(np.random.SeedSequence([number, k])).take(n)) for k in range(n_runs)]
    logs = [np.log(bands(np.where(timeline.valid, values, 0.0), timeline)) for values in sampled]
    measured = np.log(bands(timeline.offset / timeline.lane_width, timeline))
    real = np.concatenate([run[: len(run) // SNIPPET * SNIPPET].reshape(-1, SNIPPET) for run in runs])
    made = simulate(model, SNIPPET, 0, drivers=len(real), starts=real[:, 0])
    return np.mean(logs, axis=0) - measured, float(np.mean(list(snippet_distances(real, made).by_metric.values())))


def drives_of(tables: Sequence[Path], seeds: range) -> Iterator[Drive]:
    if tables:
        yield from read_drives(tables)
    else:
        for seed in seeds:
            yield as_drive(simulate_drive(3000.0, seed).table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", type=Path, nargs="*")
    parser.add_argument("--seeds", type=int, nargs=2, default=(40, 80), help="first, and one beyond the last")
    parser.add_argument("--runs", type=int, default=8, help="free runs per drive")
    args = parser.parse_args()
    drives = list(drives_of(args.table, range(*args.seeds)))
    edges = [0.0, *TIMES]
    names = ["offset", *(f"{low:g}-{high:g} s" for low, high in pairwise(edges)), f"> {edges[-1]:g} s"]
    print("| weights | " + " | ".join(names) + " | ten metrics |\n" + "|---" * (len(names) + 2) + "|")
    for variant, fit in VARIANTS.items():
        found = [score(drive, fit, args.runs, number) for number, drive in enumerate(drives)]
        logs = np.array([log for log, _ in found])
        cells = [f"{a:.2f} ({b:.2f})" for a, b in zip(np.exp(logs.mean(axis=0)), np.exp(logs.max(axis=0)), strict=True)]
        print(f"| {variant} | " + " | ".join(cells) + f" | {np.mean([d for _, d in found]):.3f} |", flush=True)


if __name__ == "__main__":
    main()
