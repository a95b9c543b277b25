"""How often the closing look of `fit` doubts a profile that is fitted to drives of its own kind.

    python -m laboratory.closing_null [--seeds FIRST LAST] [--results FILE.jsonl]

Profiles that were fitted once are sampled, recorded by a sensor, fitted again, and looked at: kinds, layouts of drives
and sensors take turns with the seed. Least differences (`fitting.closing.LIKE`) were set on seeds 1000 to 1035, looked
at once on 2000 to 2029 (2 of 30 doubted, by the skewness of lateral speed, whose difference went from 0.35 to 0.5), and
are reported on 3000 to 3099.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Drive, all_runs
from xosc_lateral.drivers.fitting.closing import Look, look
from xosc_lateral.drivers.fitting.fitting import driver_runs, fit_profile
from xosc_lateral.drivers.model.core.autoregressive.model import AutoregressiveModel
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import OffsetSampler
from xosc_lateral.files.profiles import find_profile, read_profile

STEP = 0.2
LAYOUTS = ((16, 200.0), (40, 90.0), (4, 900.0), (10, 400.0))
"""Drives, and how long each is. [s]"""
NOISES = (0.0, 0.02, 0.0, 0.05)
"""Standard deviation of the sensor's white error on rows at 5 Hz. [m]"""


def kinds() -> dict[str, DriverProfile]:
    """Populations and drivers, each as `fit` makes it of sampled drives, so that a fit can be true."""
    shipped = {name: read_profile(find_profile(name)) for name in ("motorway", "rural", "motorway-vehicle-1")}
    plain = {name: replace(profile, effects=(), beside={}) for name, profile in shipped.items()}
    model = plain["motorway"].model
    assert isinstance(model, AutoregressiveModel)
    coarse, fine = model.coarse_volatility, model.fine_volatility
    bursts = replace(model, coarse_volatility=replace(coarse, within=coarse.within + 0.4, correlation_time=0.5))
    even = replace(model, coarse_volatility=replace(coarse, within=0.0), fine_volatility=replace(fine, within=0.0))
    wide = replace(model, coarse=replace(model.coarse, scale=1.4 * model.coarse.scale))
    made = {"bursts": bursts, "even": even, "wide": wide}
    every = plain | {name: replace(plain["motorway"], model=each) for name, each in made.items()}
    return {name: fit_profile(recorded(one, 1, 60, 200.0, 0.0), name=name) for name, one in every.items()}


def recorded(profile: DriverProfile, seed: int, count: int, seconds: float, noise: float) -> list[Drive]:
    """Drives of a profile through a sensor."""
    segment = Segment.even(seconds, STEP, profile.lane_width, 30.0)
    drives = []
    for k, child in enumerate(np.random.SeedSequence(seed).spawn(count)):
        driven, error = OffsetSampler(profile, child).sample(segment), np.random.default_rng(child.spawn(1)[0])
        offset = driven + noise * error.normal(size=len(driven))
        width, speed = np.full(len(driven), profile.lane_width), np.full(len(driven), 30.0)
        whole = np.zeros(len(driven), dtype=np.int64)
        drives.append(Drive(f"d{k}", segment.time, offset, width, {"speed": speed}, run=whole))
    return drives


def null(seed: int, of: dict[str, DriverProfile]) -> tuple[str, Look]:
    """One fit to drives of its own kind, and the look at it."""
    name = list(of)[seed % len(of)]
    count, seconds = LAYOUTS[seed // len(of) % len(LAYOUTS)]
    noise = NOISES[(seed // len(of) + seed) % len(NOISES)]
    drives = recorded(of[name], seed, count, seconds, noise)
    fitted = fit_profile(drives, name=name)
    runs, _ = driver_runs(all_runs(drives), drives)
    return f"{name}, {count} drives of {seconds:g} s, {noise:g} m", look(fitted, runs)


def results(first: int, last: int) -> Iterator[dict[str, Any]]:
    """A row for each seed."""
    of = kinds()
    for seed in range(first, last + 1):
        what, found = null(seed, of)
        lack, chance = np.round(found.lack, 4).tolist(), np.round(found.chance, 4).tolist()
        numbers = {name: [*both] for name, *both in zip(found.names, lack, chance, strict=True)}
        yield {"seed": seed, "what": what, "lacking": found.lacking, "numbers": numbers}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs=2, default=(3000, 3099))
    parser.add_argument("--results", type=Path)
    args = parser.parse_args()
    rows = []
    for row in results(*args.seeds):
        rows.append(row)
        if row["lacking"]:
            print(f"{row['seed']} ({row['what']}): {', '.join(row['lacking'])}", flush=True)
        if args.results:
            with args.results.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")
    doubted = sum(bool(row["lacking"]) for row in rows)
    print(f"{doubted} of {len(rows)} doubted; {dict(Counter(name for row in rows for name in row['lacking']))}")


if __name__ == "__main__":
    main()
