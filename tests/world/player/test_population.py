"""Entities that come and go, trailers, controllers, and actions that don't move anybody."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.stage import (
    STRAIGHT,
    WIDTH,
    Stage,
    after,
    by_entity,
    car,
    entity,
    event,
    lane_change,
    maneuvers,
    on_lane,
    private_action,
    row,
    speed,
    start_of,
    teleport,
    to_lane,
    when,
)
from xosc_lateral.workflows.conversion.load import Played
from xosc_lateral.world.motion.nominal import Activity

EGO = {"Ego": teleport(on_lane(-1, 10.0)) + speed(20.0)}
BOTH = tuple(car(name) for name in ("Ego", "Late"))
GLOBAL = "<GlobalAction>{}</GlobalAction>"


def add(name: str, position: str) -> str:
    inside = f"<AddEntityAction><Position>{position}</Position></AddEntityAction>"
    return GLOBAL.format(f'<EntityAction entityRef="{name}">{inside}</EntityAction>')


def delete(name: str) -> str:
    return GLOBAL.format(f'<EntityAction entityRef="{name}"><DeleteEntityAction/></EntityAction>')


def said(played: Played, words: str) -> bool:
    return any(words in note.what for note in played.motion.notes)


def present(played: Played, name: str) -> tuple[float, float]:
    motion = entity(played, name)
    times = motion.time[motion.activity & Activity.ACTIVE > 0]
    return (round(float(times[0]), 6), round(float(times[-1]), 6))


def test_an_entity_is_there_from_its_adding_to_its_deletion(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(
        maneuvers(
            event(add("Late", on_lane(-2, 300.0)), name="add", trigger=after(2.0)),
            event(delete("Late"), name="delete", trigger=after(4.0)),
        ),
        start=EGO,
        entities=BOTH,
    )
    assert present(played, "Late") == (2.02, 4.0)
    late = entity(played, "Late")
    assert late.y[row(late, 3.0)] == pytest.approx(-1.5 * WIDTH)
    assert late.activity[row(late, 2.02)] & Activity.TELEPORTED
    assert said(played, "'Late' has no init actions")


def test_a_deleted_entity_stops_what_it_was_doing_and_fulfils_nothing(tmp_path: Path) -> None:
    start = EGO | {"Late": teleport(on_lane(-1, 50.0)) + speed(20.0)}
    condition = by_entity('<TraveledDistanceCondition value="100"/>', "Late")
    played = Stage(tmp_path).play(
        maneuvers(
            event(lane_change(to_lane(-2), over=6.0), name="change", trigger=after(1.0)), actors=("Late",), name="a"
        ),
        maneuvers(event(delete("Late"), name="delete", trigger=after(2.0)), name="b"),
        maneuvers(event(speed(1.0), name="never", trigger=when(condition)), name="c"),
        start=start,
    )
    change = next(a for a in played.motion.actions if a.path[-1:] == ("change-0",))
    assert change.end == pytest.approx(2.02, abs=0.021)
    with pytest.raises(StopIteration):
        start_of(played, "never-0")


def test_an_entity_with_a_speed_but_no_place_stands_at_the_origin_and_is_named(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(start=EGO | {"Late": speed(0.0)}, last=1.0)
    late = entity(played, "Late")
    assert (late.x[-1], late.y[-1]) == (0.0, 0.0)
    assert said(played, "'Late' has no initial position")


# ---- trailers --------------------------------------------------------------------------------------------------------
def towing(name: str, trailer: str = "") -> str:
    hitch = '<TrailerHitch dx="-1"/>' if trailer else '<TrailerCoupler dx="3"/>'
    return car(name).replace("</Vehicle>", f"{hitch}{trailer}</Vehicle>")


TRUCK = towing("Truck", '<Trailer><TrailerRef entityRef="Box"/></Trailer>')


def coupling(played: Played) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Distance between hitch and coupler in each row. [m]"""
    truck, box = entity(played, "Truck"), entity(played, "Box")
    hitch = truck.x - np.cos(truck.heading), truck.y - np.sin(truck.heading)
    coupler = box.x + 3.0 * np.cos(box.heading), box.y + 3.0 * np.sin(box.heading)
    return np.hypot(hitch[0] - coupler[0], hitch[1] - coupler[1])


def test_a_trailer_is_drawn_along(tmp_path: Path) -> None:
    change = maneuvers(event(lane_change(to_lane(-2)), trigger=after(1.0)), actors=("Truck",))
    played = Stage(tmp_path).play(
        change,
        start={"Truck": teleport(on_lane(-1, 100.0)) + speed(20.0)},
        entities=(TRUCK, towing("Box")),
        minor=3,
    )
    np.testing.assert_allclose(coupling(played), 0.0, atol=1e-6)
    truck, box = entity(played, "Truck"), entity(played, "Box")
    assert box.y[-1] == pytest.approx(truck.y[-1], abs=0.02)
    assert np.abs(np.diff(box.y)).max() < 0.06
    np.testing.assert_allclose(box.speed, truck.speed)


def test_a_trailer_that_is_let_go_rolls_on_by_itself(tmp_path: Path) -> None:
    let_go = private_action("<TrailerAction><DisconnectTrailerAction/></TrailerAction>")
    played = Stage(tmp_path).play(
        maneuvers(event(let_go, speed(30.0), trigger=after(2.0)), actors=("Truck",)),
        start={"Truck": teleport(on_lane(-1, 100.0)) + speed(20.0)},
        entities=(TRUCK, towing("Box")),
        minor=3,
    )
    gap = coupling(played)
    truck = entity(played, "Truck")
    assert gap[row(truck, 2.0)] == pytest.approx(0.0, abs=1e-6)
    box = entity(played, "Box")
    assert truck.x[-1] - box.x[-1] == pytest.approx(4.0 + 10.0 * 8.0, abs=0.5)
    assert box.speed[-1] == pytest.approx(20.0)


@pytest.mark.parametrize("kind", ["euclidianDistance", "longitudinal"])
def test_free_space_to_a_vehicle_counts_from_the_trailer_that_it_draws(tmp_path: Path, kind: str) -> None:
    near = (
        f'<RelativeDistanceCondition entityRef="Truck" relativeDistanceType="{kind}" value="5" freespace="true" '
        'rule="lessThan"/>'
    )
    brake = event(speed(0.0), name="brake", trigger=when(by_entity(near)))
    played = Stage(tmp_path).play(
        maneuvers(brake),
        start=EGO | {"Truck": teleport(on_lane(-1, 60.0))},
        entities=(car("Ego"), TRUCK, towing("Box")),
        minor=3,
    )
    # Ego's front is 4 m ahead of it, the trailer's end 5 m behind the truck: nearer than 5 m from x = 46 on.
    assert start_of(played, "brake-0") == pytest.approx(1.8, abs=0.021)


# ---- controllers and what does not move -----------------------------------------------------------------------------
def test_an_assigned_controller_is_named_and_the_default_driver_drives(tmp_path: Path) -> None:
    controller = (
        '<ObjectController><Controller name="acc"><Properties><Property name="p" value="1"/></Properties></Controller>'
        "</ObjectController></ScenarioObject>"
    )
    activate = private_action(
        '<ControllerAction><ActivateControllerAction longitudinal="true" lateral="true"/></ControllerAction>'
    )
    played = Stage(tmp_path).play(
        start={"Ego": EGO["Ego"] + activate}, entities=(car("Ego").replace("</ScenarioObject>", controller),)
    )
    assert said(played, "controller")
    assert entity(played).x[-1] == pytest.approx(10.0 + 20.0 * entity(played).time[-1])


def test_actions_that_move_nobody_are_recorded_with_their_times(tmp_path: Path) -> None:
    hide = private_action('<VisibilityAction graphics="false" traffic="true" sensors="true"/>')
    light = private_action(
        '<AppearanceAction><LightStateAction><LightType><VehicleLight vehicleLightType="brakeLights"/></LightType>'
        '<LightState mode="on"/></LightStateAction></AppearanceAction>'
    )
    custom = '<UserDefinedAction><CustomCommandAction type="beep">x</CustomCommandAction></UserDefinedAction>'
    played = Stage(tmp_path).play(
        maneuvers(
            event(hide, name="hide", trigger=after(1.0)),
            event(light, name="light", trigger=after(2.0)),
            event(custom, name="custom", trigger=after(3.0)),
        )
    )
    assert [round(start_of(played, f"{name}-0"), 6) for name in ("hide", "light", "custom")] == [1.0, 2.0, 3.0]
    assert {a.actor for a in played.motion.actions} >= {"Ego"}


def test_traffic_that_a_simulator_would_make_is_named(tmp_path: Path) -> None:
    swarm = GLOBAL.format("<TrafficAction><TrafficStopAction/></TrafficAction>")
    played = Stage(tmp_path, STRAIGHT).play(maneuvers(event(swarm)))
    assert said(played, "vehicles")


def test_an_entity_that_is_added_again_has_its_old_speed(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(
        maneuvers(
            event(delete("Ego"), name="delete", trigger=after(1.0)),
            event(add("Ego", on_lane(-1, 500.0)), name="add", trigger=after(2.0)),
        ),
        start=EGO,
    )
    motion = entity(played)
    assert motion.speed[row(motion, 3.0)] == 20.0
    assert motion.x[row(motion, 3.0)] == pytest.approx(500.0 + 20.0, abs=0.5)
