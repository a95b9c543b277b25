"""Sample a population, fit it, sample the fit: what comes back? Long runs and short ones.

    python -m laboratory.round_trips [--seeds 10] [--profile motorway] [--write PAGE.md]
    python -m laboratory.round_trips --acceptance [--write PAGE.md]

`--acceptance`: sets of drives from shipped profiles and planted ones (the drivers of `rural` further apart, calmer,
livelier ...), by a number of drives, their length and the sensor's noise. Wander is the deviation of means of 60 s
(short drives: of half their length) within a drive; all are ratios of the fit to its own drives.

Logarithms of standard deviations of the fit less those of its own sample, which takes the sample's luck out; the spread
less the profile's own, with the sample's drivers in place of all; mean over the seeds, with the standard error.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from laboratory.markers import show
from xosc_lateral.drivers.drives.drive import STEP, Drive
from xosc_lateral.drivers.fitting.fitting import fit_profile
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


SETS = {
    "rural": (
        ("rural", {}),
        [(9, 600.0, 0.0), (4, 900.0, 0.0), (9, 600.0, 0.05), (40, 200.0, 0.03), (60, 60.0, 0.0), (100, 40.0, 0.0)],
    ),
    "motorway": (
        ("motorway", {}),
        [(9, 600.0, 0.0), (40, 300.0, 0.05), (30, 120.0, 0.0), (60, 60.0, 0.0), (200, 40.0, 0.0)],
    ),
    "one vehicle": (("motorway-vehicle-1", {}), [(1, 1800.0, 0.0)]),
    "drivers far apart": (("rural", {"between_drivers": 3.0}), [(9, 600.0, 0.0)]),
    "drivers alike": (("rural", {"between_drivers": 0.1}), [(9, 600.0, 0.0)]),
    "wide": (("motorway", {"coarse": 1.4}), [(20, 300.0, 0.0)]),
    "calm": (("motorway", {"coarse": 0.6}), [(20, 300.0, 0.0)]),
    "lively above 0.4 Hz": (("rural", {"fine": 2.0}), [(9, 600.0, 0.0)]),
    "volatile": (("rural", {"volatility": 3.0}), [(20, 300.0, 0.0)]),
}
"""Profiles, what of them is multiplied by how much, and drives, seconds and noise [m] of each set."""
BANDS = ((0.02, 0.1), (0.1, 0.4), (0.4, 0.6), (0.6, 1.2))


def planted(name: str, factors: dict[str, float]) -> tuple[AutoregressiveModel, float]:
    """A shipped profile's model with parts of it multiplied, and its lane width. [m]"""
    profile = read_profile(find_profile(name))
    model: AutoregressiveModel = profile.model
    for part, factor in factors.items():
        if part == "between_drivers":
            model = replace(model, between_drivers=factor * model.between_drivers)
        elif part == "coarse":
            model = replace(model, coarse=replace(model.coarse, scale=factor * model.coarse.scale))
        elif part == "fine":
            model = replace(model, fine=replace(model.fine, damping=factor * model.fine.damping))
        else:
            model = replace(model, coarse_volatility=model.coarse_volatility.scaled(factor))
    return model, profile.lane_width


def wander(runs: FloatArray, seconds: float) -> float:
    """Deviation of means of a length within a run, of runs of shape (drivers, n)."""
    size = round(min(60.0, 0.5 * seconds) / STEP)
    means = runs[:, : runs.shape[1] // size * size].reshape(len(runs), -1, size).mean(axis=2)
    return float(np.sqrt(means.var(axis=1, ddof=1).mean()))


def powers(runs: FloatArray) -> FloatArray:
    """Of each band of `BANDS`, mean over the runs."""
    spectrum = (np.abs(np.fft.rfft((runs - runs.mean(axis=1, keepdims=True)) * np.hanning(runs.shape[1]))) ** 2).mean(
        axis=0
    )
    at = np.fft.rfftfreq(runs.shape[1], STEP)
    return np.array([spectrum[(at >= low) & (at < high)].sum() for low, high in BANDS])


def there_and_back(
    name: str, factors: dict[str, float], drives: int, seconds: float, noise: float, seed: int
) -> list[float]:
    """Ratios of wander, deviation within a drive, between drives and in bands; the mean's change. [-], [m]"""
    model, width = planted(name, factors)
    runs, _ = sample(model, drives, round(seconds / STEP), seed)
    noisy = runs + np.random.default_rng(seed).normal(0.0, noise / width, runs.shape)
    time, whole = STEP * np.arange(runs.shape[1], dtype=np.float64), np.full(runs.shape[1], width)
    recorded = [Drive(name=str(k), time=time, offset=width * run, lane_width=whole) for k, run in enumerate(noisy)]
    fitted = fit_profile(recorded, name="again").model
    back, _ = sample(fitted, 600, runs.shape[1], 10_000 + seed)
    return [
        wander(back, seconds) / wander(runs, seconds),
        float(np.sqrt(back.var(axis=1).mean() / runs.var(axis=1).mean())),
        float(back.mean(axis=1).std() / runs.mean(axis=1).std(ddof=1)) if drives > 1 else np.nan,
        *np.sqrt(powers(back) / powers(runs)),
        width * (fitted.mean - float(runs.mean())),
    ]


def acceptance(seeds: int) -> str:
    """A row for each set: medians over the seeds, and the least and largest wander."""
    bands = [f"{low:g} to {high:g} Hz" for low, high in BANDS]
    lines = [
        f"| drives of | set | wander | least, largest | within | between | {' | '.join(bands)} |",
        "|---" * 10 + "|",
    ]
    for title, ((name, factors), sets) in SETS.items():
        for drives, seconds, noise in sets:
            found = np.array(
                [there_and_back(name, factors, drives, seconds, noise, seed) for seed in range(1, 1 + seeds)]
            )
            middle = np.median(found, axis=0)
            said = f"{drives} of {seconds:g} s" + (f", {100.0 * noise:g} cm noise" if noise else "")
            numbers = " | ".join("" if np.isnan(value) else f"{value:.2f}" for value in middle[1:-1])
            lines.append(
                f"| {title} | {said} | {middle[0]:.2f} | {found[:, 0].min():.2f}, {found[:, 0].max():.2f} | {numbers} |"
            )
            print(lines[-1], flush=True)
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--profile", default="motorway")
    parser.add_argument("--write", type=Path, help="page with the markers")
    parser.add_argument("--acceptance", action="store_true", help="sets of drives of shipped and of planted profiles")
    args = parser.parse_args()
    if args.acceptance:
        show(acceptance(args.seeds), args.write, "acceptance")
        return
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
