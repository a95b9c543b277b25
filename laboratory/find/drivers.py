"""Drivers who are known: movements of many kinds for `fit`, causes of many shapes for `close-loop`.

- fit: do numbers of the drives come back when the profile is sampled; if not, does the closing look say so?
- loop: is the cause named, another in its place (a stand-in), or nothing; is a size that a sentence states the one that
  the refined profile shows when it is sampled at both ends?
"""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import xosc_lateral as xl
from laboratory.find.engine import Finding, Spec
from tests.kit.simulated import movements, preview_driver
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import all_runs
from xosc_lateral.drivers.evaluation.look_words import found_in
from xosc_lateral.drivers.model.effects.base import Acts, ColumnEffect
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import OffsetSampler

MOVEMENTS = (
    "ornstein_uhlenbeck", "heavy_tailed", "reflected", "delayed_control", "clustered", "bursts", "lopsided", "pursuit",
    "oscillating", "sawtooth", "long_memory", "free_play", "zigzag", "rate_limited", "in_regimes",
)  # fmt: skip
# Columns that nobody responds to, and one that follows from the movement; by what a number has to differ, of the mean
# in metres, else the logarithm.
BAITS = ("speed", "phone_ringing", "heart_rate", "fan_level", "gps_accuracy", "lane_departure_warning")
LIKE = {"mean": 0.1, "spread": 0.25, "lateral speed": 0.25, "far": 0.25}
LASTS = (300, 600, 900, 1500)  # Drives whose causes are sought. [s]
FARTHEST, SURE = 2.4, 5.0  # From the centre of a lane of 3.6 m [m]; standard errors, of drives and samples together.


def numbers(offset: np.ndarray, step: float) -> list[float]:
    """Mean [m] and logarithms of the spread, of the speed between means of 1 s, of the distance of the farthest 5 %."""
    seconds = round(1.0 / step)
    means = offset[: len(offset) // seconds * seconds].reshape(-1, seconds).mean(axis=1)
    away = np.abs(offset - offset.mean())
    return [float(offset.mean()), *np.log([offset.std(), np.diff(means).std(), np.quantile(away, 0.95)]).tolist()]


class Drivers:
    """Tables of drives, and what is made of them."""

    name = "drivers"

    def __init__(self, only: str | None = None) -> None:
        self.only = only

    def make(self, draw: random.Random) -> Spec:
        what = self.only or draw.choices(["fit", "loop"], [4, 1])[0]
        seed = draw.randrange(10**6)
        if what == "fit":
            count, seconds = draw.choice([(4, 400), (8, 200), (12, 120)])
            return {"what": what, "kind": draw.choice(MOVEMENTS), "seed": seed, "count": count, "seconds": seconds}
        kind = draw.choice(sorted(preview_driver.kinds()))
        baits = sorted(draw.sample(BAITS, draw.randint(1, 4)))
        return {"what": what, "kind": kind, "seed": seed, "count": 1, "seconds": draw.choice(LASTS), "baits": baits}

    def look(self, spec: Spec, only: Finding | None = None) -> list[Finding]:
        try:
            found = fitted(spec) if spec["what"] == "fit" else closed(spec)
        except xl.XoscLateralError as error:
            found = [{"kind": f"refused: {str(error)[:80]}", "size": 0.0, "said": True}]
        stage = spec["what"]
        return [{"stage": stage, "context": spec["kind"], "who": spec["kind"], "t": 0.0, **one} for one in found]

    def smaller(self, spec: Spec) -> Iterator[Spec]:
        for bait in spec.get("baits", ()):
            yield {**spec, "baits": [one for one in spec["baits"] if one != bait]}
        if spec["count"] > 4:
            yield {**spec, "count": 4}

    def size(self, spec: Spec) -> float:
        return spec["count"] * spec["seconds"] + 100 * len(spec.get("baits", ()))

    def save(self, spec: Spec, folder: Path) -> None:
        for k, table in enumerate(tables(spec)):
            table.to_csv(folder / f"drive_{k}.csv", index=False)


def tables(spec: Spec) -> list[pd.DataFrame]:
    if spec["what"] == "fit":
        movement, seconds = getattr(movements, spec["kind"]), float(spec["seconds"])
        return [movements.record_movement(movement, seconds, spec["seed"] + k) for k in range(spec["count"])]
    table = preview_driver.simulate(spec["kind"], spec["seed"], float(spec["seconds"])).table
    act = preview_driver.kinds()[spec["kind"]]
    return [table[list(dict.fromkeys(["time", "offset", "lane_width", "curvature", *act.columns, *spec["baits"]]))]]


def fitted(spec: Spec) -> list[Finding]:
    """Numbers of drives that the fitted profile does not show."""
    drives = tables(spec)
    frame = pd.concat([one.assign(drive=f"d{k}") for k, one in enumerate(drives)], ignore_index=True)
    profile: DriverProfile = xl.fit(frame, name="planted")
    step, width = profile.model.step, profile.lane_width
    speed = float(frame["speed"].median()) if "speed" in frame else 30.0
    segment = Segment.even(float(spec["seconds"]), step, width, speed)
    seeds = np.random.SeedSequence(spec["seed"]).spawn(4 * len(drives))
    now = np.array([numbers(OffsetSampler(profile, seed).sample(segment), step) for seed in seeds])
    runs, own = all_runs(xl.read_drives(frame)), dict[str, list[np.ndarray]]()
    for run in runs:
        own.setdefault(run.drive, []).append(run.offset)
    was = np.array([numbers(np.concatenate(parts), step) for parts in own.values()])
    error = np.sqrt(was.var(axis=0, ddof=1) / len(was) + now.var(axis=0, ddof=1) / len(now))
    away = now.mean(axis=0) - was.mean(axis=0)
    lacking = found_in(profile)[1]
    return [
        {"kind": f"{name} does not come back", "size": float(abs(away[k])), "said": bool(lacking)}
        for k, (name, like) in enumerate(LIKE.items())
        if abs(away[k]) > max(like, SURE * error[k])
    ]


def closed(spec: Spec) -> list[Finding]:
    """What is named, and whether sentences are what the profile does."""
    (table,) = tables(spec)
    if table["offset"].abs().max() > FARTHEST:  # this driver has left his lane
        return []
    made = xl.close_loop(table, seed=1)
    findings = made._result.findings
    act, columns = preview_driver.kinds()[spec["kind"]], set[str]()
    right, out = {"curvature", *act.columns}, list[Finding]()
    for one in findings:
        columns |= set(one.columns)
        # a car runs wide in bends by its speed
        if wrong := set(one.columns) - right - ({"speed"} if "curvature" in one.columns else set()):
            alike = any(set(each) <= right for each in one.alike)
            kind = "stand-in" if alike else "wrong cause"
            out.append({"kind": f"{kind}: {'+'.join(sorted(wrong))}", "size": abs(float(one.size_m)), "said": alike})
        stated = one.ends
        effect = one.effects[0] if one.effects and stated is not None and one.passage is None else None
        if isinstance(effect, ColumnEffect) and effect.acts is Acts.LOCATION:
            off = abs(_shown(made.profile, table, stated) - float(stated.change))
            if off > max(0.03, 2.0 * float(stated.error)):
                out.append({"kind": "a sentence is not what is sampled", "size": off, "said": False})
    by_time = spec["kind"] != "bends" and not act.columns
    if not by_time:
        hidden = [one for one in findings if not one.columns]
        out += [
            {"kind": f"nothing hidden acts: {one.kind}", "size": abs(float(one.size_m)), "said": False}
            for one in hidden
        ]
    missed = all(one.columns for one in findings) if by_time else bool(act.columns) and not columns & set(act.columns)
    if missed:
        acts, size = _planted(spec)
        looks = [one for one in made._result.shown if one.what in (act.columns or ("time",)) and one.acts == acts]
        told = not looks or any(one.smallest is None or one.smallest > size for one in looks)
        out.append({"kind": "the cause is not named", "size": size, "said": told})
    return out


def _planted(spec: Spec) -> tuple[str, float]:
    """What the planted cause acts on, and its change between its ends in this drive. [m], or a factor"""
    drive = preview_driver.simulate(spec["kind"], spec["seed"], float(spec["seconds"]))
    act, time = drive.act, preview_driver.STEP * np.arange(len(drive.context["speed"]))
    values = act.camera(time) if act.camera else (act.target or act.log_spread)(drive.context, time)
    low, high = np.quantile(values, [0.05, 0.95])
    return ("mean", high - low) if act.target or act.camera else ("spread", float(np.exp(high - low)))


def _shown(profile: DriverProfile, table: pd.DataFrame, ends: Any) -> float:
    """How far a profile's mean moves between two ends of a column, everything else as it is in the drive. [m]"""
    step, n = profile.model.step, 600
    time = step * np.arange(n)
    usual = {
        name: np.full(n, float(table[name].median())) for name in table if name not in ("time", "offset", "lane_width")
    }
    width, means = np.full(n, float(table["lane_width"].median())), []
    for end in (ends.low, ends.high):
        context = usual | {name: np.full(n, value) for name, value in end.items()}
        segment = Segment(time, width, context.get("speed", np.full(n, 26.0)), context)
        seeds = np.random.SeedSequence(3).spawn(8)
        means.append(np.mean([OffsetSampler(profile, seed).sample(segment)[n // 3 :].mean() for seed in seeds]))
    return float(means[1] - means[0])
