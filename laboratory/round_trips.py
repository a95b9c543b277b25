"""Sample a population, fit it, sample the fit: what comes back? Long runs and short ones.

    python -m laboratory.round_trips [--seeds 10] [--profile motorway] [--write PAGE.md]

Logarithms of standard deviations of the fit less those of its own sample, which takes the sample's luck out; the spread
less the profile's own, with the sample's drivers in place of all; mean over the seeds, with the standard error.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from laboratory.markers import show
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.drivers.fitting.models.autoregressive_fit import fit_autoregressive
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.files.profiles import find_profile, read_profile

FloatArray = NDArray[np.float64]
KINDS = {"300 runs of a minute": (300, 60.0), "40 runs of ten minutes": (40, 600.0)}
CHANGES = (1.0, 5.0, 10.0, 20.0, 30.0)
SNIPPET = 51
MANY, MINUTE = 4000, 301
"""Drivers and samples that a model's own numbers are taken from."""


def sample(model: AutoregressiveModel, drivers: int, n: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Relative offsets, shape (drivers, n), and what each driver moves about."""
    stream = model.stream(np.random.SeedSequence(seed), drivers=drivers)
    return np.ascontiguousarray(sum(stream.take(n)).T), np.asarray(stream.mean)


def numbers(runs: FloatArray) -> FloatArray:
    """Logarithms of the rms change over each time, and the mean log spread of snippets."""
    changes = [runs[:, round(lag / STEP) :] - runs[:, : -round(lag / STEP)] for lag in CHANGES]
    snippets = runs[:, : runs.shape[1] // SNIPPET * SNIPPET].reshape(-1, SNIPPET)
    return np.array([*(0.5 * np.log((one**2).mean()) for one in changes), np.log(snippets.std(axis=1)).mean()])


def trip(model: AutoregressiveModel, drivers: int, seconds: float, variance: float, seed: int) -> list[float]:
    runs, means = sample(model, drivers, round(seconds / STEP), seed + 5000)
    fitted = fit_autoregressive(list(runs), [str(k) for k in range(drivers)])
    back, _ = sample(fitted, MANY // 2, MINUTE, 20_000 + seed)
    own = means.var(ddof=1)
    expected = variance - model.between_drivers**2 + own
    between = (fitted.between_drivers**2 - own) / model.between_drivers**2
    return [*(numbers(back) - numbers(runs)).tolist(), 0.5 * float(np.log(back.var() / expected)), float(between)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    model = read_profile(find_profile(args.profile)).model
    variance = float(sample(model, MANY, MINUTE, 99)[0].var())
    heads = [*(f"change over {lag:g} s" for lag in CHANGES), "spread of 10 s, typical", "spread of all"]
    lines = [f"| sampled | {' | '.join(heads)} | variance between drivers |", "|---" * (len(heads) + 2) + "|"]
    for name, (drivers, seconds) in KINDS.items():
        found = np.array([trip(model, drivers, seconds, variance, seed) for seed in range(args.seeds)])
        errors = found.std(axis=0, ddof=1) / np.sqrt(len(found))
        cells = [f"{value:+.1%} ± {error:.1%}" for value, error in zip(found.mean(axis=0), errors, strict=True)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    show("\n".join(lines), args.write, "round-trips")


if __name__ == "__main__":
    main()
