"""How the loop does on borrowed drives: one measured drive's movement beside another drive's road, traffic and weather.

    python -m benchmarks.loop_borrowed FOLDER [--nulls 66] [--repeats 6] [--only truck,rain] [--seed 7]

FOLDER holds drive tables with the columns of `CASES`. What the loop finds in each drive is taken out of its movement;
what is left has nothing to do with another drive's context: a null with the driver's own dynamics and real columns. On
top of it effects are planted, of random size, lag and response (two lags in a row, which no candidate of the loop is).

The oracle knows the quantity and takes the best of some lags and response times; its z is what the data can show. Where
the cause is named, the refined effect is evaluated on the context of a third drive and compared with the truth there,
fifth by fifth of the quantity: its slope (1: fully recovered) and the share of the error that it takes away, beside
those of an effect whose quantity was told and only the size fitted.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from scipy.signal import lfilter

from xosc_lateral.driver.effects import Acts, ColumnEffect, Linear
from xosc_lateral.formats.drives import read_drives
from xosc_lateral.loop.looks import SLOW_S, Look
from xosc_lateral.loop.movement import Coarse, Terms, fit_movement
from xosc_lateral.loop.refine import target_of
from xosc_lateral.loop.sizing import size_effects
from xosc_lateral.loop.strip import bare_movement, effects_share, uninterrupted
from xosc_lateral.loop.timeline import Timeline, join_drives
from xosc_lateral.loop.trace import trace_effects
from xosc_lateral.loop.traced import Trace

Context = Mapping[str, np.ndarray]
Numbers = np.ndarray

LAGS, RESPONSES = np.arange(-2.0, 1.1, 0.5), (0.6, 1.0, 2.0, 3.0, 4.0)
MUSCLES = 0.3
"""Second lag of a planted answer. [s]"""
FOLLOWS = ("steering_wheel_angle", "yaw_rate")
"""Columns that go with the movement, and can't be borrowed."""
ALIKE = {"fine": "scale", "slow": "scale"}


@dataclass(frozen=True)
class Case:
    """A cause: what drives it, and what it acts on."""

    name: str
    kind: str
    columns: tuple[str, ...]
    quantity: Callable[[Context], Numbers]


def near(distance: Numbers) -> Numbers:
    return np.where(np.isfinite(distance), 1.0 / np.maximum(distance, 8.0), 0.0)


def standard(values: Numbers) -> Numbers:
    return (values - np.median(values)) / np.std(values)


def plain(column: str, kind: str) -> Case:
    return Case(f"{kind} {column}", kind, (column,), lambda context: context[column])


CASES = (
    *(plain(column, "location") for column in ("curvature", "truck_right", "car_left", "speed", "illuminance")),
    Case("location leader", "location", ("lead_distance",), lambda context: near(context["lead_distance"])),
    Case(
        "location wind",
        "location",
        ("wind_direction", "wind_speed"),
        lambda context: context["wind_speed"] * np.sin(np.radians(context["wind_direction"])),
    ),
    Case(
        "location truck x lane",
        "location",
        ("lane_index", "truck_right"),
        lambda context: context["truck_right"] * context["lane_index"],
    ),
    Case(
        "location grade threshold",
        "location",
        ("grade",),
        lambda context: (context["grade"] > np.quantile(context["grade"], 0.7)).astype(float),
    ),
    Case(
        "location crossfall saturating",
        "location",
        ("crossfall",),
        lambda context: np.tanh(standard(context["crossfall"])),
    ),
    *(plain(column, "scale") for column in ("rain", "speed", "illuminance", "truck_right", "wind_speed")),
    Case("scale leader", "scale", ("lead_distance",), lambda context: near(context["lead_distance"])),
    Case("scale bend", "scale", ("curvature",), lambda context: np.abs(context["curvature"])),
    *(Case(name, name, (), lambda context: np.zeros(1)) for name in ("step", "drift", "growth", "periodic", "regime")),
)


@dataclass(frozen=True)
class Planted:
    """An effect of some size and timing; `strength` is in [m] or a natural logarithm."""

    case: Case
    size: float
    lag_s: float
    response_s: float
    low: float
    high: float

    def strength(self, context: Context, step: float) -> Numbers:
        unit = (np.nan_to_num(self.case.quantity(context)) - self.low) / (self.high - self.low)
        late = np.clip(np.arange(len(unit)) - round(self.lag_s / step), 0, len(unit) - 1)
        return self.size * lagged(lagged(unit[late], self.response_s, step), MUSCLES, step)


def lagged(values: Numbers, time_constant: float, step: float) -> Numbers:
    keep = np.exp(-step / time_constant)
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=[keep * values[0]])[0])


def bare_movements(folder: Path) -> dict[str, Timeline]:
    """Every drive with what the loop finds in it taken out."""
    bare = {}
    for path in sorted(path for path in folder.iterdir() if path.name.endswith((".parquet", ".csv.gz", ".csv"))):
        timeline = join_drives(read_drives([path]))
        coarse = Coarse.of(timeline)
        final = trace_effects(coarse, np.random.SeedSequence(1)).final
        share = effects_share(coarse, final, size_effects(coarse, final))
        mean = float((timeline.offset - share.location)[timeline.valid].mean())
        offset = np.zeros(len(timeline))
        for rows in uninterrupted(timeline.valid):
            offset[rows] = bare_movement(timeline, share, rows, mean)
        bare[path.name.split(".")[0]] = replace(timeline, offset=offset)
    return bare


def borrowed(driver: Timeline, world: Timeline) -> Timeline:
    """Movement of one drive, context of another."""
    n = min(len(driver), len(world)) // 5 * 5
    context = {name: values[:n] for name, values in world.context.items() if name not in FOLLOWS}
    cut = {name: getattr(driver, name)[:n] for name in ("drive", "time", "offset", "valid", "lane_width")}
    return replace(driver, **cut, context=MappingProxyType(context), levels=world.levels)


def plant(case: Case, drive: Timeline, rng: np.random.Generator) -> tuple[Timeline, Planted | None, str]:
    """The drive with the effect, the effect if columns cause it, and its size in words."""
    inside, offset, n = drive.valid, drive.offset, len(drive)
    mean = offset[inside].mean()
    if not case.columns:
        moved, words = _hidden(case.name, drive, mean, rng)
        return replace(drive, offset=np.where(inside, moved, 0.0)), None, words
    seen = np.nan_to_num(case.quantity(drive.context))[inside]
    low, high = np.quantile(seen, [0.05, 0.95])
    if high <= low:
        low, high = seen.min(), seen.max()
    sign = rng.choice([-1.0, 1.0])
    size = rng.uniform(0.08, 0.3) if case.kind == "location" else np.log(rng.uniform(1.2, 2.0))
    planted = Planted(case, sign * size, rng.uniform(-1.5, 0.8), rng.uniform(0.7, 2.5), float(low), float(high))
    strength = planted.strength(drive.context, drive.step)
    strength = strength - strength[inside].mean()
    moved = offset + strength if case.kind == "location" else mean + (offset - mean) * np.exp(strength)
    words = f"{planted.size:+.2f} lag {planted.lag_s:+.1f} response {planted.response_s:.1f}"
    assert len(moved) == n
    return replace(drive, offset=np.where(inside, moved, 0.0)), planted, words


def _hidden(name: str, drive: Timeline, mean: float, rng: np.random.Generator) -> tuple[Numbers, str]:
    n, step, offset = len(drive), drive.step, drive.offset
    share = np.arange(n) / n
    if name == "step":
        size, at = rng.uniform(0.12, 0.35), rng.uniform(0.25, 0.75)
        return offset + size * (share > at), f"{size:.2f}"
    if name == "drift":
        size, correlation = rng.uniform(0.1, 0.25), rng.uniform(300.0, 900.0)
        walk = lfilter([1.0], [1.0, -np.exp(-step / correlation)], rng.normal(size=n))
        return offset + size * standard(np.asarray(walk)), f"{size:.2f} m {correlation:.0f} s"
    if name == "growth":
        factor = rng.uniform(1.3, 2.2)
        return mean + (offset - mean) * factor**share, f"{factor:.2f}"
    if name == "periodic":
        amplitude, period = rng.uniform(0.03, 0.1), rng.uniform(8.0, 30.0)
        return offset + amplitude * np.sin(
            2.0 * np.pi * step / period * np.arange(n)
        ), f"{amplitude:.2f} {period:.0f} s"
    factor, on, at, loud = rng.uniform(1.6, 2.6), False, 0, np.zeros(n)
    while at < n:
        length = int(rng.exponential(40.0 if on else 90.0) / step) + 1
        loud[at : at + length] = on
        at, on = at + length, not on
    return mean + (offset - mean) * factor ** lagged(loud, 0.6, step), f"{factor:.2f}"


def told(planted: Planted, drive: Timeline) -> tuple[float, ColumnEffect]:
    """The oracle's z, and its effect with the size fitted."""
    context = {**drive.context, "truth": np.nan_to_num(planted.case.quantity(drive.context))}
    coarse = Coarse.of(replace(drive, context=MappingProxyType(context)))
    location = planted.case.kind == "location"
    effect = Linear(acts=Acts.LOCATION if location else Acts.SPREAD, column="truth")
    plain_fit, best, chosen = fit_movement(coarse, Terms()), 0.0, effect
    for look in (Look.LOCATION,) if location else (Look.SPREAD, Look.SLOW):
        target = target_of(look, coarse, plain_fit)
        apart = SLOW_S if look is Look.SLOW else 1
        for response in RESPONSES:
            for lag in LAGS:
                timed = replace(effect, lag_s=float(lag), response_s=response)
                gain = target.gain(coarse.answer(timed)) / apart
                best, chosen = (gain, timed) if gain > best else (best, chosen)
    terms = Terms(location=(chosen,)) if location else Terms(spread=(chosen,))
    sized = size_effects(coarse, fit_movement(coarse, terms)).effects[0]
    assert isinstance(sized, ColumnEffect)
    return float(np.sqrt(best)), sized


def elsewhere(planted: Planted, trace: Trace, oracle: ColumnEffect, world: Timeline) -> str:
    """Refined and told effects against the truth on another drive's context."""
    context = Coarse.of(world).context
    acts = Acts.LOCATION if planted.case.kind == "location" else Acts.SPREAD
    effects = [effect for effect in size_effects(trace.coarse, trace.final).effects if isinstance(effect, ColumnEffect)]
    refined = [np.zeros(len(world))]
    refined += [effect.weighed(effect.answer(world.step, context)) for effect in effects if effect.acts is acts]
    quantity = np.nan_to_num(planted.case.quantity(world.context))
    truth = planted.strength(world.context, world.step)
    knowing = oracle.strength(world.step, {"truth": np.clip(quantity, planted.low, planted.high)})
    assert knowing is not None
    groups = _fifths(quantity[world.valid])
    means = [_group_means(values[world.valid], groups) for values in (truth, np.sum(refined, axis=0), knowing)]
    slopes = [float(own @ means[0] / (means[0] @ means[0])) for own in means[1:]]
    gains = [1.0 - float(np.linalg.norm(own - means[0]) / np.linalg.norm(means[0])) for own in means[1:]]
    return f"elsewhere slope {slopes[0]:.2f} gain {gains[0]:.2f}, told {slopes[1]:.2f} {gains[1]:.2f}"


def _fifths(values: Numbers) -> Numbers:
    different = np.unique(values)
    edges = np.unique(np.quantile(values, [0.2, 0.4, 0.6, 0.8])) if len(different) > 5 else different[:-1]
    return np.searchsorted(edges, values, side="left")


def _group_means(values: Numbers, groups: Numbers) -> Numbers:
    """About the overall mean, weighted so that their squares add up to the variance between groups."""
    there = [groups == group for group in np.unique(groups)]
    return np.array([np.sqrt(one.mean()) * (values[one].mean() - values.mean()) for one in there])


def words_of(trace: Trace) -> str:
    words = []
    for found in trace.found:
        shape = f"{'*'.join(found.candidate.columns)} {found.candidate.effect.shape}" if found.candidate else ""
        words.append(f"{found.look} {shape} p={found.p_value:.0e}")
    return "; ".join(words) or "nothing"


def named(case: Case, trace: Trace) -> bool:
    wander = "step" if trace.final.terms.step_at is not None else "drift"
    found = {
        (
            {**ALIKE, "wander": wander}.get(found.look, found.look),
            tuple(sorted(found.candidate.columns)) if found.candidate else (),
        )
        for found in trace.found
    }
    return (case.kind, case.columns) in found


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("folder", type=Path)
    ask.add_argument("--nulls", type=int, default=66)
    ask.add_argument("--repeats", type=int, default=6)
    ask.add_argument("--only", default="")
    ask.add_argument("--seed", type=int, default=7)
    said = ask.parse_args()
    drives = bare_movements(said.folder)
    rng = np.random.default_rng(said.seed)
    names = sorted(drives)
    silent = 0
    pairs = [(first, second) for first in names for second in names if first != second]
    for first, second in [pairs[index] for index in rng.permutation(len(pairs))[: said.nulls]]:
        trace = trace_effects(Coarse.of(borrowed(drives[first], drives[second])), np.random.SeedSequence(1))
        silent += not trace.found
        print(f"null {first} x {second}: {words_of(trace)}", flush=True)
    print(f"silent on {silent} of {said.nulls} drives without an effect\n", flush=True)
    seen = right_of_seen = extra = planted_drives = 0
    for case in (case for case in CASES if any(part in case.name for part in said.only.split(","))):
        for repeat in range(said.repeats):
            own = np.random.default_rng([said.seed, CASES.index(case), repeat])
            first, second, third = (names[index] for index in own.choice(len(names), 3, replace=False))
            drive, planted, words = plant(case, borrowed(drives[first], drives[second]), own)
            z, oracle = told(planted, drive) if planted else (float("nan"), None)
            started = time.perf_counter()
            trace = trace_effects(Coarse.of(drive), np.random.SeedSequence(1))
            took = time.perf_counter() - started
            right = named(case, trace)
            after = (
                elsewhere(planted, trace, oracle, borrowed(drives[first], drives[third]))
                if right and planted and oracle
                else ""
            )
            planted_drives, extra = planted_drives + 1, extra + (len(trace.found) > right)
            if z >= 5.0:
                seen, right_of_seen = seen + 1, right_of_seen + right
            verdict = f"{'RIGHT' if right else 'wrong'}: {words_of(trace)} | {after}"
            print(f"{case.name} {words} on {first} x {second}: z {z:.1f}: {verdict} ({took:.0f} s)", flush=True)
    print(f"right cause on {right_of_seen} of {seen} drives on which the oracle has z >= 5")
    print(f"something else named on {extra} of {planted_drives} drives with an effect")


if __name__ == "__main__":
    main()
