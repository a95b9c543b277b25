"""What `evaluate` says of drivers whose recording is known: their own profile, a fit to other drives of it, wrong ones.

    python -m laboratory.evaluate_planted [--seeds 0 1 ...] [--noise METRES ...] [--rates HZ ...]
        [--whole]

Drivers of `motorway` are recorded by sensors of white noise at several rates. Right are the profile that they were
sampled from, and one fitted to as many others through the same sensor; wrong are drivers who keep 0.35 m more to the
left, move 1.5 times as far, or have three times the power above 0.3 Hz. They are judged by power and place; `--whole`:
by all that `evaluate` compares, classifiers too.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

import numpy as np
from msgspec.structs import replace

from tests.kit.upsampled import upsample
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Drive, all_runs
from xosc_lateral.drivers.evaluation.scores import score_profile, verdict
from xosc_lateral.drivers.evaluation.spectra import BOTH
from xosc_lateral.drivers.fitting.fitting import driver_runs, fit_profile
from xosc_lateral.drivers.model.effects import Adapted
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import OffsetSampler
from xosc_lateral.files.profiles import find_profile, read_profile
from xosc_lateral.workflows.profiles.evaluation_page import judged, verdict_in_words

STEP = 0.2
COUNT, SECONDS, SPEED = 40, 200.0, 30.0
"""Drives, how long each is [s], and how fast [m/s]."""


def recorded(profile: DriverProfile, seed: int, noise: float, rate: float, count: int = COUNT) -> list[Drive]:
    """Drives of a profile through a sensor with white noise [m] at a rate [Hz], a multiple of 5 Hz."""
    segment, drives = Segment.even(SECONDS, STEP, profile.lane_width, SPEED), []
    for k, child in enumerate(np.random.SeedSequence(seed).spawn(count)):
        driven = upsample(OffsetSampler(profile, child).sample(segment), round(rate * STEP))
        offset = driven + noise * np.random.default_rng(child.spawn(1)[0]).normal(size=len(driven))
        width, speed = np.full(len(driven), profile.lane_width), np.full(len(driven), SPEED)
        whole = np.zeros(len(driven), dtype=np.int64)
        drives.append(Drive(f"d{k}", np.arange(len(driven)) / rate, offset, width, {"speed": speed}, run=whole))
    return drives


def wrong_drivers(profile: DriverProfile) -> dict[str, DriverProfile]:
    """Each with one thing wrong."""
    changes = {"0.35 m to the left": Adapted(shift=0.35), "1.5 times as far": Adapted(spread=1.5, fine=1.5)}
    return {name: replace(profile, effects=(*profile.effects, each)) for name, each in changes.items()} | {
        "1.8 times as restless": replace(profile, effects=(*profile.effects, Adapted(fine=1.8)))
    }


def said(
    profile: DriverProfile, drives: Sequence[Drive], seed: int = 0, *, whole: bool = False
) -> tuple[dict[str, str], str]:
    """Of driver and recording, as `evaluate` judges them, and its words."""
    runs = all_runs(drives)
    _, sensor = driver_runs(runs, drives)
    if whole:
        scores = score_profile(replace(profile, sensor=sensor), runs, seed=seed)
        return {of: judged(scores, of) for of in BOTH}, verdict_in_words(scores)
    found = verdict(replace(profile, sensor=sensor), runs, seed)
    return {of: found.judged(of) for of in BOTH}, found.in_words()


def cases(noise: float, rate: float, seed: int, whole: bool) -> Iterator[tuple[str, dict[str, str], str]]:
    """Who is judged, what is said of him, and the words."""
    truth = replace(read_profile(find_profile("motorway")), effects=(), beside={})
    drives = recorded(truth, seed, noise, rate)
    fitted = fit_profile(recorded(truth, seed + 1000, noise, rate), name="fitted")
    for name, profile in {"itself": truth, "fitted to others": fitted, **wrong_drivers(truth)}.items():
        yield name, *said(profile, drives, whole=whole)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--noise", type=float, nargs="+", default=[0.01, 0.03, 0.05])
    parser.add_argument("--rates", type=float, nargs="+", default=[5.0, 10.0, 20.0, 50.0])
    parser.add_argument("--whole", action="store_true")
    args = parser.parse_args()
    for noise in args.noise:
        for rate in args.rates:
            for seed in args.seeds:
                for name, verdicts, words in cases(noise, rate, seed, args.whole):
                    print(f"{noise:g} m, {rate:g} Hz, seed {seed}, {name}: {verdicts}: {words}", flush=True)


if __name__ == "__main__":
    main()
