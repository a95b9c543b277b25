"""The other models beside ours: same real data, same splits, ten metrics, spectrum and classifier, in one table.

    xosc-lateral import dlr-ht tasi-0.15.4-py3-none-any.whl -o dlr.parquet
    python benchmarks/baselines.py dlr.parquet [--splits 4] [--write docs/real_data.md]

Half of the drives is fitted, the other half is scored, several times. Every baseline's free numbers are chosen to make
the mean distance of the ten metrics on the training half as small as it gets (not by a likelihood that nobody scores).
Sampled snippets start where the real ones start, where a model can start anywhere.
"""

from __future__ import annotations

import argparse
import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.fitting import fit_runs
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.series import STEP, Run, all_runs
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.drives import read_drives
from xosc_lateral.loop.classifier import told_apart
from xosc_lateral.loop.distance import Distances, mean_distances, metric_distances
from xosc_lateral.loop.longterm import spectrum
from xosc_lateral.loop.metrics import METRICS, snippet_metrics
from xosc_lateral.loop.snippets import Snippets, sample_runs, sample_snippets, snippets_of

FloatArray = NDArray[np.float64]
Sampler = Callable[[FloatArray, int, np.random.Generator], FloatArray]
SNIPPET = 10.0  # [s]
MEAN_SPEED = 32.0  # [m/s]; SloppyDriver steers by speed
MARKER = "baselines"


# ---- the models: start (n,), steps, rng -> offsets (n, steps) [m] ----------------------------------------------------
def lane_centre(start: FloatArray, steps: int, rng: np.random.Generator) -> FloatArray:
    """What a maneuver-based scenario does."""
    return np.zeros((len(start), steps))


def constant_offset(start: FloatArray, steps: int, rng: np.random.Generator) -> FloatArray:
    """CARLA's traffic manager: one lane offset per vehicle."""
    return np.repeat(start[:, None], steps, axis=1)


def ornstein_uhlenbeck(mean: float, time_constant: float, spread: float) -> Sampler:
    """dx = (mean - x) dt / time_constant + noise with the stationary standard deviation `spread`; exact steps."""

    def sample(start: FloatArray, steps: int, rng: np.random.Generator) -> FloatArray:
        keep = np.exp(-STEP / time_constant)
        kick = spread * np.sqrt(1 - keep**2) * rng.standard_normal((len(start), steps))
        return _recursion(start - mean, keep, kick) + mean

    return sample


def lc_sigma(sigma: float) -> Sampler:
    """SUMO's lateral imperfection: per action step exp(-dt/T) x + sigma sqrt(2 dt/T) noise, T = 100 s (1 - sigma).

    Taken at full speed and at steps of 0.2 s; with SUMO's usual 1 s it would be another process.
    """

    def sample(start: FloatArray, steps: int, rng: np.random.Generator) -> FloatArray:
        scale = max(1e-3, 100.0 * (1.0 - sigma))
        kick = sigma * np.sqrt(2 * STEP / scale) * rng.standard_normal((len(start), steps))
        return _recursion(start, np.exp(-STEP / scale), kick)

    return sample


def sloppy_driver(sloppiness: float, matched: bool) -> Sampler:
    """esmini's SloppyDriver: every 0.75-2.25 s a new target, always on the same side, approached by steering.

    Parameters
    ----------
    matched : bool
        Shift each snippet to the real start, which the controller itself can't do.
    """

    def sample(start: FloatArray, steps: int, rng: np.random.Generator) -> FloatArray:
        n, inner, settle = len(start), 4, 300
        dt = STEP / inner
        offset, heading = np.zeros(n), np.zeros(n)
        old, target, since, lasts = np.zeros(n), np.zeros(n), np.zeros(n), np.full(n, 1.5)
        rows = np.empty((n, steps))
        for k in range((settle + steps) * inner):
            over = since >= lasts
            old = np.where(over, target, old)
            target = np.where(over, 5 * sloppiness * min(sloppiness, 1.0) * rng.uniform(0.5, 1.5, n), target)
            lasts, since = np.where(over, 1.5 * rng.uniform(0.5, 1.5, n), lasts), np.where(over, 0.0, since)
            wanted = old + (target - old) * since / lasts
            turn = (-0.02 * (offset + wanted) - 0.05 * heading) * dt * MEAN_SPEED
            offset = offset + MEAN_SPEED * dt * np.sin(heading + turn)
            heading, since = heading + turn, since + dt
            if k >= settle * inner and (k + 1) % inner == 0:
                rows[:, k // inner - settle] = offset
        return rows - rows[:, :1] + start[:, None] if matched else rows

    return sample


def _recursion(start: FloatArray, keep: float, kick: FloatArray) -> FloatArray:
    from scipy.signal import lfilter

    kick[:, 0] = start
    return lfilter([1.0], [1.0, -keep], kick, axis=1)


# ---- fitting by what is scored ---------------------------------------------------------------------------------------
def best_of(build: Callable[..., Sampler], grids: Sequence[FloatArray], train: Snippets) -> tuple[Sampler, str]:
    """Smallest mean distance on the training snippets: a grid, then two finer ones around its best point."""
    real = snippet_metrics(train.offset)
    start, steps = train.offset[:, 0], train.offset.shape[1]

    def distance(values: tuple[float, ...]) -> float:
        rows = build(*values)(start, steps, np.random.default_rng(1))  # common random numbers
        return metric_distances(real, snippet_metrics(rows)).mean

    axes = [np.asarray(grid) for grid in grids]
    for _ in range(3):
        best = min(itertools.product(*(axis.tolist() for axis in axes)), key=distance)
        axes = [_finer(axis, value) for axis, value in zip(axes, best, strict=True)]
    return build(*best), ", ".join(f"{value:.3g}" for value in best)


def _finer(axis: FloatArray, value: float) -> FloatArray:
    k = int(np.argmin(np.abs(axis - value)))
    return np.linspace(axis[max(k - 1, 0)], axis[min(k + 1, len(axis) - 1)], 5)


# ---- scoring ---------------------------------------------------------------------------------------------------------
@dataclass
class Row:
    """Scores of one model, over the splits."""

    name: str
    distances: list[Distances] = field(default_factory=list)
    spectrum: list[float] = field(default_factory=list)
    auc: float | None = None
    settings: str = ""


def score(rows: dict[str, Row], runs: list[Run], rng: np.random.Generator, split: int) -> None:
    """Fit everything on one half of the drives, score it on the other."""
    drives = np.unique([run.drive for run in runs])
    chosen = set(rng.permutation(drives)[: len(drives) // 2].tolist())
    train_runs = [run for run in runs if run.drive in chosen]
    test_runs = [run for run in runs if run.drive not in chosen]
    train, test = snippets_of(train_runs, SNIPPET, STEP), snippets_of(test_runs, SNIPPET, STEP)
    real = snippet_metrics(test.offset)
    true_spectrum = spectrum([run.offset for run in test_runs], STEP)

    def note(name: str, sampled: FloatArray, free: list[FloatArray] | None, settings: str = "") -> None:
        row = rows.setdefault(name, Row(name))
        row.settings = row.settings or settings
        row.distances.append(metric_distances(real, snippet_metrics(sampled)))
        if free is not None:
            power = spectrum(free, STEP).density + 1e-12
            row.spectrum.append(float(np.sqrt(np.mean((10 * np.log10(power / true_spectrum.density)) ** 2))))
        if split == 0:
            row.auc = told_apart(test.offset, sampled, test.group, test.group)

    for name, (sampler, settings) in _baselines(train).items():
        chance = np.random.default_rng([2, split])
        sampled = sampler(test.offset[:, 0], test.offset.shape[1], chance)
        first, longest = np.array([run.offset[0] for run in test_runs]), max(map(len, test_runs))
        free = [row[: len(run)] for row, run in zip(sampler(first, longest, chance), test_runs, strict=True)]
        note(name, sampled, free, settings)
    for model, name in (("two-level", "two levels (the paper)"), ("best", "ours (`best`)")):
        profile: DriverProfile = fit_runs(train_runs, name=model, model=model)
        note(name, sample_snippets(profile, test, split), sample_runs(profile, test_runs, 100 + split))
    other = snippet_metrics(train.offset)
    floor = rows.setdefault("floor: other real drives", Row("floor: other real drives"))
    floor.distances.append(metric_distances(real, other))
    power = spectrum([run.offset for run in train_runs], STEP).density
    floor.spectrum.append(float(np.sqrt(np.mean((10 * np.log10(power / true_spectrum.density)) ** 2))))


def _baselines(train: Snippets) -> dict[str, tuple[Sampler, str]]:
    centre = float(train.offset.mean())
    sloppy = [np.linspace(0.05, 1.0, 12)]
    spreads = np.geomspace(0.05, 0.6, 7)
    return {
        "lane centre": (lane_centre, ""),
        "constant offset (CARLA)": (constant_offset, ""),
        "SloppyDriver (esmini)": best_of(lambda s: sloppy_driver(s, matched=False), sloppy, train),
        "SloppyDriver, shifted to the start": best_of(lambda s: sloppy_driver(s, matched=True), sloppy, train),
        "lcSigma (SUMO)": best_of(lc_sigma, [np.geomspace(0.01, 0.95, 12)], train),
        "Ornstein-Uhlenbeck": best_of(
            lambda tau, spread: ornstein_uhlenbeck(centre, tau, spread), [np.geomspace(1, 60, 9), spreads], train
        ),
    }


def markdown(rows: dict[str, Row], splits: int) -> str:
    """The table."""
    floor = mean_distances(rows["floor: other real drives"].distances)
    head = ["model", *METRICS, "mean", "mean / floor", "spectrum [dB]", "AUC", "fitted"]
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for row in rows.values():
        mean = mean_distances(row.distances)
        cells = [row.name, *(f"{mean.by_metric[name]:.2f}" for name in METRICS), f"{mean.mean:.3f}"]
        flat = np.mean(row.spectrum) > 60.0  # no movement at all
        cells += [f"{mean.mean / floor.mean:.2f}", "none" if flat else f"{np.mean(row.spectrum):.1f}"]
        cells += ["" if row.auc is None else f"{row.auc:.3f}", row.settings]
        lines.append("| " + " | ".join(cells) + " |")
    note = f"Mean over {splits} random halves of the drives; AUC and fitted numbers on the first."
    return "\n".join([*lines, "", note])


def write_between_markers(path: Path, text: str, marker: str = MARKER) -> None:
    """Put the table into a document, between its two markers."""
    begin, end = f"<!-- {marker}: begin -->", f"<!-- {marker}: end -->"
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    document = path.read_text(encoding="utf-8")
    if not pattern.search(document):
        raise SystemExit(f"{path}: no markers {begin} ... {end}")
    write_atomically(path, pattern.sub(lambda _: f"{begin}\n{text}\n{end}", document))


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("table", type=Path)
    ask.add_argument("--splits", type=int, default=4)
    ask.add_argument("--write", type=Path, help="document with the markers")
    said = ask.parse_args()
    runs = all_runs(read_drives(said.table))
    rng, rows = np.random.default_rng(20240501), {}
    for split in range(said.splits):
        score(rows, runs, rng, split)
    text = markdown(rows, said.splits)
    print(text)
    if said.write is not None:
        write_between_markers(said.write, text)


if __name__ == "__main__":
    main()
