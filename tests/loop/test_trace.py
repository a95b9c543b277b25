"""Effects planted in simulated drives: the loop names that one, with its size, and none where none was planted.

Every drive comes from a simulated human who shares nothing with the model. How often it is right over many drives and
sizes is the business of `benchmarks/loop_study.py`; these are single drives with effects that a few tests can afford.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.simulators import plants
from tests.simulators.driver_simulator import Driver
from tests.simulators.movements import held, in_regimes, record_movement
from xosc_lateral.driver.effects import ColumnEffect, Levels, Product, Saturating, Threshold
from xosc_lateral.driver.series import Drive
from xosc_lateral.formats.drives import read_drives
from xosc_lateral.loop.movement import Coarse
from xosc_lateral.loop.timeline import join_drives
from xosc_lateral.loop.trace import trace_effects
from xosc_lateral.loop.traced import Trace

Driven = Callable[..., list[Drive]]


def traced(drives: list[Drive], **options: object) -> Trace:
    return trace_effects(Coarse.of(join_drives(drives)), np.random.SeedSequence(1), **options)  # type: ignore[arg-type]


def named(trace: Trace) -> set[tuple[str, tuple[str, ...]]]:
    looks = {"slow": "scale"}  # the spread of the slower movement is a spread all the same
    return {
        (looks.get(found.look, found.look), tuple(sorted(found.candidate.columns)) if found.candidate else ())
        for found in trace.found
    }


@pytest.mark.parametrize(
    ("plant", "expected"),
    [
        (plants.CurveCutting(0.4), ("location", ("curvature",))),
        (plants.TruckAvoidance(0.3), ("location", ("truck_right",))),
        (plants.SideWind(0.4), ("location", ("wind_direction", "wind_speed"))),
        (plants.SpreadBy("rain", 2.2), ("scale", ("rain",))),
        (plants.Fatigue(2.5), ("growth", ())),
        (plants.Weave(0.15, 12.0), ("periodic", ())),
        (plants.CameraStep(0.6), ("wander", ())),
        (plants.SensorDrift(1.2), ("wander", ())),
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_a_planted_effect_is_named(driven: Driven, plant: plants.Plant, expected: tuple[str, tuple[str, ...]]) -> None:
    assert expected in named(traced(driven(101, [plant])))


@pytest.mark.parametrize(
    ("plant", "shape"),
    [
        (plants.ShiftBy(("truck_right", "lane_index"), 0.5, plants.Response(lag=1.0)), Product),
        (plants.ShiftBy(("grade",), 0.4, plants.Response(plants.threshold(2.0), lag=1.0)), Threshold),
        (plants.ShiftBy(("grade",), 0.4, plants.Response(plants.saturating(1.0), lag=1.0)), Saturating),
        (plants.LaneHabit((0.3, -0.3, 0.3)), Levels),
    ],
    ids=["product", "threshold", "saturating", "levels"],
)
def test_a_shift_is_named_by_its_column_and_its_shape(
    driven: Driven, plant: plants.Plant, shape: type[ColumnEffect]
) -> None:
    trace = traced(driven(401, [plant], 2400.0))
    assert ("location", tuple(sorted(plant.columns))) in named(trace)
    found = next(found for found in trace.found if found.candidate and set(found.candidate.columns) <= {*plant.columns})
    assert found.candidate is not None
    assert isinstance(found.candidate.effect, shape)


def test_an_answer_that_lags_is_told_from_one_that_does_not(driven: Driven) -> None:
    trace = traced(driven(401, [plants.TruckAvoidance(0.5, lag=4.0)], 2000.0))
    found = next(found for found in trace.found if found.candidate and found.candidate.columns == ("truck_right",))
    assert found.candidate is not None
    assert found.candidate.effect.lag_s + found.candidate.effect.response_s == pytest.approx(4.0, abs=1.5)


def test_a_step_is_told_from_a_drift_and_dated(driven: Driven) -> None:
    trace = traced(driven(403, [plants.CameraStep(0.6, at=0.45)], 2400.0))
    assert ("wander", ()) in named(trace)
    at = trace.final.terms.step_at
    assert at is not None
    assert trace.coarse.time[at] == pytest.approx(0.45 * 2400.0, abs=10.0)


def test_a_spread_by_a_car_ahead_is_named(driven: Driven) -> None:
    drives = driven(402, [plants.SpreadBy("lead_distance", 4.0)], driver=Driver())
    assert ("scale", ("lead_distance",)) in named(traced(drives))


def test_a_camera_that_shakes_by_a_column_is_fine_noise(driven: Driven) -> None:
    trace = traced(driven(402, [plants.ShakyCamera("grade", 0.04)], 1500.0, driver=Driver()))
    assert ("fine", ("grade",)) in named(trace)


def test_regimes_of_loudness_are_named(tmp_path: Path) -> None:
    path = tmp_path / "drive.parquet"
    record_movement(in_regimes, 2400.0, 1).to_parquet(path)
    assert named(traced(read_drives([path]))) == {("regime", ())}


def test_a_pull_to_the_middle_by_a_column_is_blamed_on_that_column(tmp_path: Path) -> None:
    """A stronger pull makes the slow movement smaller: to name either is right."""
    path = tmp_path / "drive.parquet"
    record_movement(held, 2400.0, 2, told_of="speed").to_parquet(path)
    assert named(traced(read_drives([path]))) & {("dynamics", ("speed",)), ("scale", ("speed",))}


def test_steering_and_yaw_rate_are_consequences_and_never_causes(driven: Driven) -> None:
    trace = traced(driven(101, [plants.CurveCutting(0.4)]))
    assert {item.column for item in trace.consequences} == {"steering_wheel_angle", "yaw_rate"}
    blamed = {column for _, columns in named(trace) for column in columns}
    assert not blamed & {"steering_wheel_angle", "yaw_rate"}


def test_two_effects_at_once_are_both_named(driven: Driven) -> None:
    both = [plants.TruckAvoidance(0.3), plants.SpreadBy("lead_distance", 4.0)]
    found = named(traced(driven(402, both, driver=Driver())))
    assert {("location", ("truck_right",)), ("scale", ("lead_distance",))} <= found


def test_a_companion_of_the_cause_is_not_blamed(driven: Driven) -> None:
    drives = driven(103, [plants.TruckAvoidance(0.35), plants.Companion("truck_right", correlation=0.9)])
    found = named(traced(drives))
    assert ("location", ("truck_right",)) in found
    assert not any("companion" in columns for _, columns in found)


def test_an_effect_whose_column_is_missing_is_blamed_on_no_other(driven: Driven) -> None:
    found = named(traced(driven(104, [plants.TruckAvoidance(0.3)], drop=["truck_right"])))
    assert not any(look == "location" for look, _ in found)


def test_a_column_that_is_left_out_is_not_looked_at(driven: Driven) -> None:
    trace = traced(driven(101, [plants.TruckAvoidance(0.3)]), excluded=["truck_right"])
    assert not any("truck_right" in columns for _, columns in named(trace))
    assert "truck_right" in trace.unused


def test_same_seed_same_trace(driven: Driven) -> None:
    drives = driven(101, [plants.TruckAvoidance(0.3)], duration=1500.0)
    first, second = traced(drives), traced(drives)
    assert [found.p_value for found in first.found] == [found.p_value for found in second.found]
    assert [tried.p_value for tried in first.tried] == [tried.p_value for tried in second.tried]
