"""Effects planted in simulated drives: the loop names that one, with its size, and none where none was planted.

Every drive comes from a simulated human who shares nothing with the model. How often it is right over many drives and
sizes is the business of `benchmarks/loop_study.py`; these are single drives with effects that a few tests can afford.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.simulators import plants
from xosc_lateral.driver.series import Drive
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
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_a_planted_effect_is_named(driven: Driven, plant: plants.Plant, expected: tuple[str, tuple[str, ...]]) -> None:
    assert expected in named(traced(driven(101, [plant])))


@pytest.mark.parametrize("seed", [1, 4, 9])
def test_nothing_is_named_where_nothing_was_planted(driven: Driven, seed: int) -> None:
    assert named(traced(driven(seed))) == set()


def test_steering_and_yaw_rate_are_consequences_and_never_causes(driven: Driven) -> None:
    trace = traced(driven(101, [plants.CurveCutting(0.4)]))
    assert {item.column for item in trace.consequences} == {"steering_wheel_angle", "yaw_rate"}
    blamed = {column for _, columns in named(trace) for column in columns}
    assert not blamed & {"steering_wheel_angle", "yaw_rate"}


def test_two_effects_at_once_are_both_named(driven: Driven) -> None:
    found = named(traced(driven(102, [plants.TruckAvoidance(0.3), plants.SpreadBy("rain", 2.2)])))
    assert {("location", ("truck_right",)), ("scale", ("rain",))} <= found


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
