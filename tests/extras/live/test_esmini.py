"""Drivers in esmini: a stand-in of its library, and the library itself where `ESMINI_LIBRARY` names one."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl
from tests.kit.esmini_stand_in import StandIn
from tests.kit.scenario_files import (
    action,
    entity,
    event,
    private,
    scenario_text,
    speed_action,
    story,
    teleport,
    time_condition,
    write_scenario,
)
from tests.kit.stage import follow, polyline
from xosc_lateral.base.errors import SimulationError
from xosc_lateral.cli import main
from xosc_lateral.extras.live.call import live_esmini
from xosc_lateral.extras.live.esmini import EsminiTraffic, lateral_actions
from xosc_lateral.extras.live.esmini_library import OBJECT_STATE, EsminiLibrary, ObjectState, open_player
from xosc_lateral.extras.live.esmini_places import Ledger
from xosc_lateral.extras.live.loop import SAME_DURATION, later_actions
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.workflows.profiles.profiles import read_profile
from xosc_lateral.world.motion.driver_clock import LARGEST_TURN_RATE

CUT_IN = Path(__file__).resolve().parents[3] / "templates" / "cut-in.xosc"
REAL = os.environ.get("ESMINI_LIBRARY")
needs_esmini = pytest.mark.skipif(not REAL, reason="ESMINI_LIBRARY names no library of esmini")


@pytest.fixture(params=["stand-in", pytest.param("esmini", marks=needs_esmini)])
def library(request: pytest.FixtureRequest) -> Any:
    return StandIn() if request.param == "stand-in" else REAL


def test_vehicles_are_where_their_drivers_say_and_maneuvers_stay_as_written(library: Any) -> None:
    run = live_esmini(CUT_IN, library, ego=["Ego"], seed=3, duration=20.0, step=0.02)
    frame = run.to_frame()
    own = frame[frame.steered]
    assert np.abs(own.offset - own.driver).max() < 0.01
    assert set(own.name) == {"CutIn", "Truck"} and not run.warnings
    assert own.offset[own.name == "CutIn"].std() > 0.02
    ego = frame[frame.name == "Ego"]
    assert ego.offset.abs().max() < 1e-6
    cut_in = frame[frame.name == "CutIn"]
    maneuver = cut_in[~cut_in.steered]
    assert 3.5 < maneuver.time.max() - maneuver.time.min() < 4.5  # its lane change, and nothing else
    assert {cut_in.lane.iloc[0], cut_in.lane.iloc[-1]} == {-1, -2}
    # the driver's lateral speed runs out at the maneuver's start: direction of the path there
    start = cut_in[(cut_in.time > maneuver.time.min() - 0.1) & (cut_in.time < maneuver.time.min() + 1.0)]
    turned = np.abs(np.diff(np.unwrap(np.arctan2(np.diff(start.y), np.diff(start.x)))))
    assert turned.max() < LARGEST_TURN_RATE * 0.02
    # back to the driver without a kink: direction of the path after the maneuver
    back = cut_in[cut_in.time > maneuver.time.max() - 0.03]
    turned = np.abs(np.diff(np.unwrap(np.arctan2(np.diff(back.y), np.diff(back.x)))))
    road = np.abs(np.diff(np.unwrap(back.h)))[1:]
    assert (turned - road).max() < LARGEST_TURN_RATE * 0.02


@pytest.mark.pages
def test_an_offset_is_led_out_where_a_trajectory_starts_without_it(library: Any, tmp_path: Path) -> None:
    """In the middle of the lane from 4 s on, for 10 s."""
    at = [f'<LanePosition roadId="1" laneId="-1" s="{s}"/>' for s in range(150, 401, 10)]
    way = polyline(*((0.4 * k, one) for k, one in enumerate(at)))
    text = scenario_text(
        entities=entity("Car"), init=private("Car", teleport(), speed_action("25")), stop=time_condition(12),
        stories=story(event("way", action("way", follow(way)), time=4.0), actors=("Car",)),
    )  # fmt: skip
    run = live_esmini(write_scenario(tmp_path, text), library, ego=["none"], seed=3, duration=12.0, step=0.01)
    frame = run.to_frame()
    assert not run.warnings and frame.steered[frame.time < 3.9].all()
    own = frame.offset.to_numpy()
    assert abs(own[399]) > 0.05 and np.abs(own[1100:]).max() < 1e-6
    assert np.abs(np.diff(own[::5], 2)).max() / 0.05**2 < 1.0


def test_a_run_is_a_trace_with_the_road_and_where_everybody_was(library: Any, tmp_path: Path) -> None:
    pytest.importorskip("osi_utilities", reason="the extra osi is not installed")
    run = live_esmini(CUT_IN, library, ego=["Ego"], seed=3, duration=14.0, step=0.1)
    trace = run.write_osi(tmp_path / "run.mcap")
    drives = xl.import_drives("osi", trace).to_frame()
    both = run.to_frame().round({"time": 3}).merge(
        drives.assign(name=drives.drive.str.partition("#")[0]).round({"time": 3}), on=["name", "time"]
    )  # fmt: skip
    assert len(both) > 0.4 * len(run.to_frame())  # ends and lane changes are cut
    np.testing.assert_allclose(both.offset_y, both.offset_x, atol=1e-3)
    np.testing.assert_allclose(both.speed_y, both.speed_x, atol=0.02)


def test_the_same_seed_gives_the_same_run_and_another_one_another(library: Any) -> None:
    if isinstance(library, StandIn):
        one, two, other = (live_esmini(CUT_IN, StandIn(), seed=seed, duration=1.0).to_frame() for seed in (1, 1, 2))
    else:
        one, two, other = (live_esmini(CUT_IN, library, seed=seed, duration=1.0).to_frame() for seed in (1, 1, 2))
    pd.testing.assert_frame_equal(one, two)
    assert np.abs(one.offset - other.offset).max() > 0.01


def test_lateral_actions_are_those_of_the_storyboard() -> None:
    found = lateral_actions(read_scenario(CUT_IN))
    assert found["Story::Act::CutInGroup::CutInManeuver::CutInEvent::CutInEventAction"] == {"CutIn"}
    assert found["Init Truck TeleportAction"] == {"Truck"}
    assert not any("SlowDown" in path for path in found)


def test_a_vehicle_that_says_nonsense_is_left_alone_and_the_others_drive_on() -> None:
    player = StandIn()
    open_player(player, CUT_IN)
    traffic = EsminiTraffic(player, CUT_IN, read_profile("motorway"), ego="Ego")
    traffic.steer(0.01)
    player.broken["Truck"] = {"x": float("nan")}
    for _ in range(3):
        player.SE_StepDT(0.01)
        moves = traffic.steer(0.01)
    assert traffic.warnings == ["vehicle 'Truck': x is nan; it is left alone"]
    assert traffic.moves.keys() == {"Ego", "CutIn"} and moves.steered.tolist() == [False, True]
    player.broken.clear()
    player.gone.add("CutIn")
    player.SE_StepDT(0.01)
    traffic.steer(0.01)
    assert traffic.moves.keys() == {"Ego", "Truck"}


def test_who_is_added_again_begins_anew_in_the_middle_of_its_lane() -> None:
    player = StandIn()
    open_player(player, CUT_IN)
    traffic = EsminiTraffic(player, CUT_IN, read_profile("motorway"), ego="Ego")
    player.offset["Truck"] = 0.6  # what a maneuver leaves
    traffic.steer(0.01)
    player.gone.add("Truck")
    player.SE_StepDT(0.01)
    traffic.steer(0.01)
    player.gone.clear()
    player.offset["Truck"] = 0.0
    for _ in range(200):
        player.SE_StepDT(0.01)
        traffic.steer(0.01)
    assert abs(traffic.moves["Truck"][0]) < 0.3


def test_an_ego_by_its_name_is_not_driven_which_is_said_and_none_drives_it():
    run = live_esmini(CUT_IN, StandIn(), seed=3, duration=1.0, step=0.1)
    assert [note for note in run.notes if "'Ego'" in note] == [
        "not driven, it is under test by its name (--ego none drives everybody): 'Ego'"
    ]
    frame = run.to_frame()
    assert not frame[frame.name == "Ego"].steered.any() and frame[frame.name == "CutIn"].steered.any()
    everybody = live_esmini(CUT_IN, StandIn(), ego=["none"], seed=3, duration=1.0, step=0.1).to_frame()
    assert everybody[everybody.name == "Ego"].steered.any()


def test_an_ego_that_nobody_drives_and_names_that_nobody_has_are_said() -> None:
    player = StandIn()
    player.broken["Ego"] = {"ctrl_type": 1, "x": 5.0, "y": 1.0}
    run = live_esmini(CUT_IN, player, seed=3, duration=1.0, step=0.1)
    assert run.warnings[-1].startswith("'Ego' stood all the time: its controller waits for another program")
    with pytest.raises(SimulationError, match=r"no vehicle 'Trcuk' in the scenario \(vehicles: CutIn, Ego, Truck\)"):
        live_esmini(CUT_IN, StandIn(), profiles={"Trcuk": "motorway"}, duration=1.0)


@pytest.mark.pages
def test_neighbours_give_way_to_the_ego_where_it_really_is() -> None:
    ends = {}
    for aside in (0.0, 0.6):  # the ego leans to the left, towards who overtakes it
        player = StandIn()
        open_player(player, CUT_IN)
        traffic = EsminiTraffic(player, CUT_IN, read_profile("motorway-vehicle-1"), ego="Ego", seed=1)
        found = {}
        while player.SE_GetSimulationTime() < 11.0:
            traffic.steer(0.04)
            player.SE_StepDT(0.04)
            player.offset["Ego"] = aside
            states = traffic.states()
            found[states["CutIn"].s - states["Ego"].s] = traffic.offset_of(states["CutIn"])
        ends[aside] = found
    beside = min(ends[0.0], key=abs)
    assert ends[0.6][beside] - ends[0.0][beside] > 0.1
    assert ends[0.6][min(ends[0.6])] == pytest.approx(ends[0.0][min(ends[0.0])], abs=0.1)


class Lacking:
    SE_Init = staticmethod(lambda *_: 0)


class OtherStates(StandIn):
    """An older structure: it ends before ours does."""

    def SE_GetObjectState(self, number: int, address: int) -> int:
        whole = (ctypes.c_ubyte * ctypes.sizeof(ObjectState))()
        super().SE_GetObjectState(number, ctypes.addressof(whole))
        ctypes.memmove(address, whole, ctypes.sizeof(ObjectState) - 32)
        return 0


def test_what_is_no_library_of_esmini_3_is_refused_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for player, scenario, words in (
        (tmp_path / "none.so", CUT_IN, "no library that can be loaded"),
        (Lacking(), CUT_IN, "has no function SE_StepDT"),
        (StandIn(), CUT_IN.with_suffix(".xodr"), "can't open it"),
        (OtherStates(), CUT_IN, "another SE_ScenarioObjectState than the"),
    ):
        with pytest.raises(SimulationError, match=words) as caught:
            live_esmini(scenario, player, duration=1.0)
        assert "\n" not in str(caught.value)
    with pytest.raises(SimulationError, match=r"no vehicle 'Nobody' .*CutIn, Ego, Truck"):
        live_esmini(CUT_IN, StandIn(), ego=["Nobody"], duration=1.0)
    assert main(["live", "esmini", str(CUT_IN), "--player-library", str(tmp_path / "none.so")]) == 1
    assert capsys.readouterr().err.count("\n") == 1
    assert main(["live", "esmini", str(tmp_path / "no.xosc"), "--player-library", "x.so"]) == 1
    assert "no.xosc: no such file" in capsys.readouterr().err


@needs_esmini
@pytest.mark.parametrize("factor", [0.8, 1.0, 1.2])
def test_with_an_external_ego_every_trigger_fires_as_without_drivers(factor: float) -> None:
    fired = []
    for driven in (False, True):
        player = open_player(REAL, CUT_IN)
        library = ctypes.CDLL(REAL)
        library.SE_ReportObjectRoadPos.argtypes = [
            ctypes.c_int, ctypes.c_uint32, ctypes.c_int, ctypes.c_double, ctypes.c_double,
        ]  # fmt: skip
        library.SE_ReportObjectSpeed.argtypes = [ctypes.c_int, ctypes.c_double]
        events: list[tuple[float, str, int]] = []

        def note(
            name: bytes, _kind: int, state: int, path: bytes, player: EsminiLibrary = player, to: Any = events
        ) -> None:
            to.append((player.SE_GetSimulationTime(), path.decode(), state))

        profile = read_profile("motorway")
        traffic = EsminiTraffic(player, CUT_IN, profile, ego="Ego", seed=1, on_element=note)
        ego = traffic.states()["Ego"]
        s, speed = ego.s, ego.speed
        for k in range(3000):
            if k > 100:
                speed += float(np.clip(factor * ego.speed - speed, -0.03, 0.03))
            s += speed * 0.01
            library.SE_ReportObjectRoadPos(ego.id, ego.road, ego.lane, 0.0, s)
            library.SE_ReportObjectSpeed(ego.id, speed)
            if driven:
                traffic.steer(0.01)
            if player.SE_StepDT(0.01) != 0 or player.SE_GetQuitFlag() == 1:
                break
        player.SE_Close()
        fired.append([(time, path, state) for time, path, state in events if path and not path.startswith("Init")])
    (plain, ours) = fired
    assert [event[1:] for event in plain] == [event[1:] for event in ours]
    assert plain or factor > 1.0  # nobody cuts in before who drives away
    assert all(abs(a[0] - b[0]) <= 0.1 for a, b in zip(plain, ours, strict=True))


BORDER = Path(__file__).resolve().parents[4] / "shared" / "cases" / "reactive" / "d1_border.xosc"


@needs_esmini
@pytest.mark.skipif(not BORDER.is_file(), reason="no shared cases")
@pytest.mark.parametrize("seed", [1, 2])
def test_a_vehicle_that_drifts_over_a_marking_stays_where_it_is(seed: int) -> None:
    """Its lane is another one then; nobody puts it a lane aside."""
    run = live_esmini(BORDER, REAL, ego=["Ego"], seed=seed, duration=15.0, step=0.01)
    frame = run.to_frame()
    for name in ("T", "U"):
        own = frame[frame.name == name]
        assert np.abs(np.diff(own.y)).max() < 0.01, name


def test_an_action_that_takes_longer_or_less_long_than_as_written_is_said() -> None:
    """The cut-in's lane change takes 4 s."""
    path = "Story::Act::CutInGroup::CutInManeuver::CutInEvent::CutInEventAction"
    for over, is_said in ((4.0, False), (4.0 + 0.9 * SAME_DURATION, False), (4.0 + 1.1 * SAME_DURATION, True),
                          (4.0 - 0.9 * SAME_DURATION, False), (4.0 - 1.1 * SAME_DURATION, True)):  # fmt: skip
        said = later_actions(CUT_IN, {path: [(10.0, 10.0 + over)], "Story::gone": [(1.0, 9.0)]}, 18.0)
        assert len(said) == is_said
        for line in said:
            assert line.startswith("lateral action 'CutInEventAction' at 10.00 s took ")
            assert line.endswith("from where the driver was, 4.00 s without drivers")
    assert later_actions(CUT_IN, {}, 18.0) == []


def test_the_room_to_the_middle_of_a_road_is_that_beside_the_innermost_lane() -> None:
    """Lanes of 3.5 m beside lane 0, two to the right and one to the left."""
    ledger = Ledger(read_opendrive(CUT_IN.parents[1] / "tests" / "data" / "xodr" / "valid" / "straight.xodr"), print)
    states = np.zeros(6, dtype=OBJECT_STATE)
    states["road"], states["s"] = (7, 7, 7, 7, 7, 8), 300.0
    states["lane"], states["t"] = (-1, -2, -1, 1, 1, -1), (-1.75, -5.0, 0.4, 1.75, -0.2, -1.75)
    np.testing.assert_allclose(ledger.room_to_middle(states), [1.75, 5.0, -0.4, 1.75, -0.2, np.inf])


@needs_esmini
@pytest.mark.skipif(not BORDER.is_file(), reason="no shared cases")
@pytest.mark.parametrize("seed", [2, 3])
def test_a_short_lateral_action_leaves_no_rest_of_the_driver_that_is_dropped_at_once(seed: int) -> None:
    """Swerves of two seconds, in which the lateral speed from before has not run out when they end."""
    run = live_esmini(BORDER.with_name("a09_rep_swerve.xosc"), REAL, ego=["Ego"], seed=seed, duration=30.0, step=0.01)
    own = run.to_frame()
    assert np.abs(np.diff(own[own.name == "T"].y)).max() < 0.012


@needs_esmini
def test_an_output_under_an_own_ego_goes_as_the_page_says(tmp_path: Path) -> None:
    """`examples/own_ego.py` in a process of its own, beside what docs/how_to/esmini.md shows of it."""
    root = Path(__file__).resolve().parents[3]
    page = (root / "docs" / "how_to" / "esmini.md").read_text(encoding="utf-8")
    run = subprocess.run(
        [sys.executable, str(root / "examples" / "own_ego.py"), str(tmp_path)],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    shown = [line for line in page.splitlines() if " s: ego " in line]
    assert shown
    assert [line for line in run.stdout.splitlines() if " s: ego " in line] == shown
