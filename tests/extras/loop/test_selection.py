"""Effects planted in simulated drives: the loop names that one, with its size, and none where none was planted.

Every drive comes from a simulated human who shares nothing with the model. How often it is right over many drives and
sizes is the business of laboratory/identification_study.py; these are single drives that a few tests can afford.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from examples.driver_simulator.simulator import Driver, simulate_drive
from tests.kit import simulated as plants
from tests.kit.selected import named, selected
from tests.kit.simulated.movements import held, in_regimes, record_movement
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.model.effects import ColumnEffect, Levels, Product, Saturating, Threshold
from xosc_lateral.extras.loop.identify import usable_columns
from xosc_lateral.extras.loop.selection import Selection
from xosc_lateral.extras.loop.terms.column import ColumnTerm
from xosc_lateral.extras.loop.terms.time import StepTerm
from xosc_lateral.extras.loop.timeline import join_drives
from xosc_lateral.files.drives import read_drives

Driven = Callable[..., list[Drive]]
pytestmark = pytest.mark.pages  # the loop in short: `test_every_finding`


def effect_of(selection: Selection, columns: tuple[str, ...]) -> ColumnEffect:
    terms = [one.term for one in selection.accepted if isinstance(one.term, ColumnTerm)]
    return next(term.effect for term in terms if set(term.columns) == {*columns})


@pytest.mark.parametrize(
    ("plant", "expected"),
    [
        (plants.curve_cutting(0.4), ("location", ("curvature",))),
        (plants.truck_avoidance(0.3), ("location", ("truck_right",))),
        (plants.SideWind(0.4), ("location", ("wind_direction", "wind_speed"))),
        (plants.Fatigue(2.5), ("scale", ())),
        (plants.CyclicTarget(0.15, 12.0), ("periodic", ())),
        (plants.CameraStep(0.6), ("step", ())),
    ],
    ids=lambda value: getattr(value, "kind", ""),
)
def test_a_planted_effect_is_named(driven: Driven, plant: plants.Plant, expected: tuple[str, tuple[str, ...]]) -> None:
    assert expected in named(selected(driven(101, [plant])))


def test_a_planted_spread_is_named(driven: Driven) -> None:
    assert ("scale", ("rain",)) in named(selected(driven(103, [plants.SpreadBy("rain", 4.0)])))


@pytest.mark.parametrize(
    ("plant", "shape", "seconds"),
    [
        (plants.ShiftBy(("truck_right", "lane_index"), 0.5, plants.SimulatedResponse(lag=1.0)), Product, 2400.0),
        (plants.ShiftBy(("grade",), 0.4, plants.SimulatedResponse(plants.threshold(2.0), lag=1.0)), Threshold, 2400.0),
        (
            plants.ShiftBy(("grade",), 0.4, plants.SimulatedResponse(plants.saturating(1.0), lag=1.0)),
            Saturating,
            2400.0,
        ),
        (
            plants.LanePreference((0.3, -0.3, 0.3)),
            Levels,
            3600.0,
        ),  # lanes change seldom: what they do rests on few rows
    ],
    ids=["product", "threshold", "saturating", "levels"],
)
def test_a_shift_is_named_by_its_column_and_its_shape(
    driven: Driven, plant: plants.Plant, shape: type[ColumnEffect], seconds: float
) -> None:
    selection = selected(driven(401, [plant], seconds))
    assert ("location", tuple(sorted(plant.columns))) in named(selection)
    assert isinstance(effect_of(selection, plant.columns), shape)


def test_a_response_that_lags_is_told_from_one_that_does_not(driven: Driven) -> None:
    effect = effect_of(selected(driven(401, [plants.truck_avoidance(0.5, lag=4.0)], 2000.0)), ("truck_right",))
    assert effect.lag_s + effect.response_s == pytest.approx(4.0, abs=1.5)


def test_a_step_is_told_from_a_drift_and_dated(driven: Driven) -> None:
    selection = selected(driven(403, [plants.CameraStep(0.6, at=0.45)], 2400.0))
    (step,) = [one.term for one in selection.accepted if isinstance(one.term, StepTerm)]
    assert selection.final.coarse.time[step.at] == pytest.approx(0.45 * 2400.0, abs=10.0)


def test_a_spread_by_a_car_ahead_is_named(driven: Driven) -> None:
    drives = driven(402, [plants.SpreadBy("lead_distance", 4.0)], driver=Driver())
    assert ("scale", ("lead_distance",)) in named(selected(drives))


def test_a_camera_that_shakes_by_a_column_is_fine_noise(driven: Driven) -> None:
    selection = selected(driven(402, [plants.ShakyCamera("grade", 0.04)], 1500.0, driver=Driver()))
    (one,) = [one for one in selection.accepted if one.term.columns == ("grade",)]
    assert one.term.component == "fine_noise"


def test_regimes_of_loudness_are_named(tmp_path: Path) -> None:
    path = tmp_path / "drive.parquet"
    record_movement(in_regimes, 2400.0, 1).to_parquet(path)
    assert named(selected(read_drives([path]))) == {("regime", ())}


def test_a_pull_to_the_middle_by_a_column_is_blamed_on_that_column(tmp_path: Path) -> None:
    """A stronger pull makes the movement smaller."""
    path = tmp_path / "drive.parquet"
    record_movement(held, 2400.0, 2, told_of="speed").to_parquet(path)
    assert ("scale", ("speed",)) in named(selected(read_drives([path])))


def test_steering_and_yaw_rate_are_consequences_and_never_causes(driven: Driven) -> None:
    feedback = usable_columns(join_drives(driven(101, [plants.curve_cutting(0.4)]))).feedback
    assert {one.column for one in feedback} == {"steering_wheel_angle", "yaw_rate"}
    assert not any(one.doubtful for one in feedback)


def test_two_effects_at_once_are_both_named(driven: Driven) -> None:
    both = [plants.truck_avoidance(0.3), plants.SpreadBy("lead_distance", 4.0)]
    found = named(selected(driven(402, both, driver=Driver())))
    assert {("location", ("truck_right",)), ("scale", ("lead_distance",))} <= found


def test_a_companion_of_the_cause_is_not_blamed(driven: Driven) -> None:
    drives = driven(103, [plants.truck_avoidance(0.35), plants.Companion("truck_right", correlation=0.9)])
    found = named(selected(drives))
    assert ("location", ("truck_right",)) in found
    assert not any("companion" in columns for _, columns in found)


def test_an_effect_whose_column_is_missing_is_blamed_on_no_other(driven: Driven) -> None:
    found = named(selected(driven(104, [plants.truck_avoidance(0.3)], drop=["truck_right"])))
    assert not any(look == "location" for look, _ in found)


def test_a_column_that_is_left_out_is_not_looked_at(driven: Driven) -> None:
    drives = driven(101, [plants.truck_avoidance(0.3)])
    assert not any("truck_right" in columns for _, columns in named(selected(drives, excluded=["truck_right"])))
    assert "truck_right" in usable_columns(join_drives(drives), ["truck_right"]).unused


def test_same_seed_same_selection(driven: Driven) -> None:
    drives = driven(101, [plants.truck_avoidance(0.3)], duration=900.0)
    first, second = selected(drives), selected(drives)
    assert first.rejected
    assert [one.p_value for one in first.accepted] == [one.p_value for one in second.accepted]
    assert [one.p_value for one in first.rejected] == [one.p_value for one in second.rejected]


def test_names_order_and_units_of_columns_change_nothing(tmp_path: Path) -> None:
    table = simulate_drive(1500.0, 101, effects=[plants.SideWind(0.5)]).table.drop(columns=["lead_distance"])
    own = ["time", "distance_left", "distance_right", "speed", "lane_index"]
    context = [name for name in table if name not in own]
    secret = {name: f"{chr(122 - index)}_{index}" for index, name in enumerate(context)}
    disguised = table[own].join(table[context[::-1]].rename(columns=secret) * 7.0)
    outcomes = []
    for number, one in enumerate((table, disguised)):
        path = tmp_path / f"{number}.parquet"
        one.to_parquet(path)
        outcomes.append(named(selected(read_drives([path]))))
    assert outcomes[0]
    translated = {(kind, tuple(sorted(secret.get(name, name) for name in columns))) for kind, columns in outcomes[0]}
    assert translated == outcomes[1]
