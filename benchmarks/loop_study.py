"""How often the loop names the right cause, and how often it names one where there is none, on simulated drives.

    python -m benchmarks.loop_study [--seeds 4] [--duration 3000] [--only curve] [--nulls 20] [--movements 8] [--second]

The simulator is the one of the tests (a human with intermittent, satisficing steering; no relative of the model). The
oracle knows the columns, the shape and the kind, and takes the best of the response times: its z is what the data can
show at all. `--movements` also counts how often something is named in movements that no driver model made. `--second`
also drives the same driver a second time and scores the refined profile on that drive.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from tests.simulators import movements, plants
from tests.simulators.driver_simulator import Drive, simulate_drive
from xosc_lateral.driver.effects import (
    Acts,
    ColumnEffect,
    Factor,
    Form,
    Levels,
    Linear,
    Nearness,
    Product,
    Saturating,
    Threshold,
)
from xosc_lateral.driver.series import Drive as Measured
from xosc_lateral.formats.drives import read_drives
from xosc_lateral.loop.close import LoopResult, close_loop
from xosc_lateral.loop.looks import SLOW_S, Look
from xosc_lateral.loop.movement import Coarse, Terms, fit_movement
from xosc_lateral.loop.refine import target_of
from xosc_lateral.loop.residual import cells_of, expected, own_runs
from xosc_lateral.loop.sizing import size_effects
from xosc_lateral.loop.timeline import join_drives
from xosc_lateral.loop.trace import trace_effects
from xosc_lateral.loop.traced import Trace

MOVEMENTS = ("wandering", "heavy_tailed", "reflected", "delayed_control", "clustered")

RESPONSES = (0.3, 1.0, 2.0, 3.0, 4.0, 6.0)


@dataclass(frozen=True)
class Case:
    """One planted effect and what an oracle would look for."""

    name: str
    plant: Callable[[], list[plants.Plant]]
    kind: str
    columns: tuple[str, ...] = ()
    oracle: tuple[ColumnEffect, ...] = ()


def linear(column: str) -> tuple[ColumnEffect, ...]:
    return (Linear(acts=Acts.LOCATION, column=column),)


WIND = (
    Product(
        acts=Acts.LOCATION,
        factors=(Factor(column="wind_speed"), Factor(column="wind_direction", form=Form.SINE, at=360.0)),
    ),
)

CASES = (
    Case("curve 0.25", lambda: [plants.CurveCutting(0.25)], "location", ("curvature",), linear("curvature")),
    Case("curve 0.15", lambda: [plants.CurveCutting(0.15)], "location", ("curvature",), linear("curvature")),
    Case("truck 0.25", lambda: [plants.TruckAvoidance(0.25)], "location", ("truck_right",), linear("truck_right")),
    Case("truck 0.15", lambda: [plants.TruckAvoidance(0.15)], "location", ("truck_right",), linear("truck_right")),
    Case("wind 0.25", lambda: [plants.SideWind(0.25)], "location", ("wind_speed", "wind_direction"), WIND),
    Case(
        "lane habit",
        lambda: [plants.LaneHabit()],
        "location",
        ("lane_index",),
        (Levels(acts=Acts.LOCATION, column="lane_index", levels=(1.0, 2.0)),),
    ),
    Case(
        "grade threshold",
        lambda: [plants.ShiftBy(("grade",), 0.25, plants.Response(plants.threshold(1.0), lag=1.0))],
        "location",
        ("grade",),
        (Threshold(acts=Acts.LOCATION, column="grade", at=1.0),),
    ),
    Case(
        "crossfall saturating",
        lambda: [plants.ShiftBy(("crossfall",), 0.25, plants.Response(plants.saturating(1.0), lag=1.0))],
        "location",
        ("crossfall",),
        (Saturating(acts=Acts.LOCATION, column="crossfall", middle=0.0, scale=1.0),),
    ),
    Case(
        "truck x lane",
        lambda: [plants.ShiftBy(("truck_right", "lane_index"), 0.3, plants.Response(lag=1.0))],
        "location",
        ("truck_right", "lane_index"),
        (Product(acts=Acts.LOCATION, factors=(Factor(column="truck_right"), Factor(column="lane_index"))),),
    ),
    Case(
        "rain spread 1.6",
        lambda: [plants.SpreadBy("rain", 1.6)],
        "scale",
        ("rain",),
        (Linear(acts=Acts.SPREAD, column="rain"),),
    ),
    Case(
        "near leader spread 0.6",
        lambda: [plants.SpreadBy("lead_distance", 1.7)],
        "scale",
        ("lead_distance",),
        (Nearness(acts=Acts.SPREAD, column="lead_distance", presence=True),),
    ),
    Case(
        "restoring by rain",
        lambda: [plants.RestoringBy("rain", 0.5)],
        "dynamics",
        ("rain",),
        (Linear(acts=Acts.RATE, column="rain"),),
    ),
    Case("fatigue 2", lambda: [plants.Fatigue(2.0)], "scale"),
    Case("wander 0.2", lambda: [plants.TargetWander(0.2)], "drift"),
    Case("sensor drift 0.4", lambda: [plants.SensorDrift(0.4)], "drift"),
    Case("weave 0.1", lambda: [plants.Weave(0.1, 12.0)], "periodic"),
    Case("distraction", lambda: [plants.Distraction()], "regime"),
    Case("camera step 0.3", lambda: [plants.CameraStep(0.3)], "step"),
)


def measured(drive: Drive, folder: Path) -> list[Measured]:
    path = folder / "drive.parquet"
    drive.table.to_parquet(path)
    return read_drives([path])


def oracle_z(case: Case, coarse: Coarse) -> float:
    """Square root of the best chi-square over responses and lags of the true quantity; nan for hidden effects."""
    best = 0.0
    for effect in case.oracle:
        looks = {Acts.LOCATION: (Look.LOCATION,), Acts.SPREAD: (Look.SPREAD, Look.SLOW), Acts.RATE: (Look.PACE,)}
        for look in looks[effect.acts]:
            # squares of overlapping averages count once in so many
            apart = SLOW_S if look is Look.SLOW else 1
            target = target_of(look, coarse, fit_movement(coarse, Terms()))
            for response in RESPONSES:
                for lag in (-2.0, -1.0, 0.0, 1.0, 2.0):
                    answer = coarse.answer(replace(effect, response_s=response, lag_s=lag))
                    best = max(best, target.gain(answer) / apart)
    return float(np.sqrt(best)) if case.oracle else float("nan")


def named(case: Case, trace: Trace) -> tuple[bool, str]:
    """Whether the planted cause is among the findings, and all that was found."""
    words, right = [], False
    for found in trace.found:
        columns = found.candidate.columns if found.candidate else ()
        kind = {
            "growth": "scale",
            "fine": "scale",
            "slow": "scale",
            "wander": "step" if trace.final.terms.step_at is not None else "drift",
        }.get(found.look, found.look)
        right |= kind == case.kind and set(columns) == set(case.columns)
        lag = found.candidate.effect.lag_s if found.candidate else ""
        words.append(f"{kind} {'*'.join(columns)} {lag} p={found.p_value:.0e}")
    return right, "; ".join(words) or "nothing"


def second_drive(case: Case, result: LoopResult, drive: Drive, seed: int, duration: float, folder: Path) -> str:
    """Error of the conditional mean by the planted quantity on another drive of the same driver.

    Of the base, of the refined profile, and of a profile that was told the effect (shape, lag and response; the size is
    fitted): the last is what knowing the effect in advance would give.
    """
    other = simulate_drive(duration, seed + 5000, driver=drive.truth.driver, effects=drive.truth.effects)
    timeline = join_drives(measured(other, folder))
    coarse = Coarse.of(timeline)
    cells = cells_of(timeline, {"planted": _quantity(case.oracle[0], coarse)})
    group = ("mean" if case.kind == "location" else "spread") + " by planted"
    real = cells.describe(timeline.offset, timeline.valid)[group]
    first = result.trace.coarse
    told = size_effects(first, fit_movement(first, Terms(location=(best_oracle(case, first),)))).effects
    errors, spans = [], []
    for effects in ((), result.refined.effects, told):
        profile = replace(result.base, effects=effects)
        own = expected(cells, own_runs(profile, timeline, np.random.SeedSequence(1)), timeline.valid)[group]
        centre = (real - real.mean()) - (own - own.mean())
        errors.append(100.0 * float(np.sqrt(np.mean(centre**2))))
        spans.append(100.0 * float(own[-1] - own[0]))
    return (
        f"| second drive {group}: base {errors[0]:.1f}, refined {errors[1]:.1f}, told {errors[2]:.1f} cm; first to "
        f"last fifth: measured {100 * (real[-1] - real[0]):.1f}, refined {spans[1]:.1f}, told {spans[2]:.1f} cm |"
    )


def best_oracle(case: Case, coarse: Coarse) -> ColumnEffect:
    """The true quantity at its best response time and lag."""
    target = target_of(Look.LOCATION, coarse, fit_movement(coarse, Terms()))
    tried = [
        replace(case.oracle[0], response_s=response, lag_s=lag)
        for response in RESPONSES
        for lag in (-2.0, -1.0, 0.0, 1.0, 2.0)
    ]
    return max(tried, key=lambda effect: target.gain(coarse.answer(effect)))


def _quantity(effect: ColumnEffect, coarse: Coarse) -> np.ndarray:
    return np.nan_to_num(effect.quantity(coarse.context)[:, 0])


def main() -> None:
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("--seeds", type=int, default=3)
    ask.add_argument("--nulls", type=int, default=20)
    ask.add_argument("--duration", type=float, default=3000.0)
    ask.add_argument("--only", default="")
    ask.add_argument("--movements", type=int, default=0)
    ask.add_argument("--second", action="store_true")
    said = ask.parse_args()
    with TemporaryDirectory() as name:
        folder = Path(name)
        silent = 0
        for seed in range(said.nulls):
            trace, took = _traced(simulate_drive(said.duration, seed).table, folder)
            _, words = named(CASES[0], trace)
            silent += not trace.found
            print(f"null {seed}: {words} ({took:.0f} s)", flush=True)
        if said.nulls:
            print(f"silent on {silent} of {said.nulls} drives without an effect\n", flush=True)
        if said.movements:
            silent_on_movements(said.movements, said.duration, folder)
        seen = right_of_seen = 0
        for case in CASES:
            if said.only not in case.name:
                continue
            for seed in range(100, 100 + said.seeds):
                drive = simulate_drive(said.duration, seed, effects=case.plant())
                drives = measured(drive, folder)
                coarse = Coarse.of(join_drives(drives))
                z = oracle_z(case, coarse)
                started = time.perf_counter()
                after = ""
                if said.second and case.oracle:
                    result = close_loop(drives, seed=1)
                    trace = result.trace
                    after = second_drive(case, result, drive, seed, said.duration, folder)
                else:
                    trace = trace_effects(coarse, np.random.SeedSequence(1))
                right, words = named(case, trace)
                took = time.perf_counter() - started
                if z >= 5:
                    seen, right_of_seen = seen + 1, right_of_seen + right
                verdict = f"oracle z {z:.1f}: {'RIGHT' if right else 'wrong'}: {words} {after}"
                print(f"{case.name} {seed}: {verdict} ({took:.0f} s)", flush=True)
        print(f"right cause in {right_of_seen} of {seen} drives on which the oracle has z >= 5")


def silent_on_movements(seeds: int, duration: float, folder: Path) -> None:
    """Count how often nothing is named in movements without any driver."""
    kinds = {name: (getattr(movements, name), None) for name in MOVEMENTS} | {"5 cm": (movements.wandering, 0.05)}
    silent = 0
    for name, (movement, resolution) in kinds.items():
        for seed in range(seeds):
            table = movements.record_movement(movement, duration, seed, resolution=resolution)
            trace, took = _traced(table, folder)
            silent += not trace.found
            print(f"{name} {seed}: {named(CASES[0], trace)[1]} ({took:.0f} s)", flush=True)
    print(f"silent on {silent} of {seeds * len(kinds)} movements without a driver\n", flush=True)


def _traced(table: pd.DataFrame, folder: Path) -> tuple[Trace, float]:
    path = folder / "drive.parquet"
    table.to_parquet(path)
    coarse = Coarse.of(join_drives(read_drives([path])))
    started = time.perf_counter()
    return trace_effects(coarse, np.random.SeedSequence(1)), time.perf_counter() - started


if __name__ == "__main__":
    main()
