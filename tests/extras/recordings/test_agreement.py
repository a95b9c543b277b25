"""The same traffic through every door: who is next to whom, how fast sideways and when lanes change is one answer."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.kit.doors import STEP, fcd, highd, osi_trace
from tests.kit.motion import entity_context
from tests.kit.stage import lanes, line, map_of, road, section
from xosc_lateral import import_drives, reconstruct
from xosc_lateral.base.arrays import rate
from xosc_lateral.drivers.drives.lane_changes import RATE_WINDOW, Course
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, views_of
from xosc_lateral.extras.detect.sources import SourceSettings, sources_of
from xosc_lateral.extras.live.moment import OpenDriveRoads, Places, look_around
from xosc_lateral.extras.recordings.reconstruct import Reconstruction
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.road.network import RoadNetwork

LENGTH, LANE, BEGIN, DURATION = 4.5, 3.5, 20.0, 5.0
PEAK = 0.5 * np.pi * LANE / DURATION  # of the lateral speed [m/s]
MOMENTS = (8.0, 14.0, 32.0, 44.0)  # at which all are amid their lanes [s]
BORDER = 1000.0  # from one road to the next, where a ramp comes in from the right [m]
NEAR = ("lead_distance", "left_distance", "right_distance")
HANDS = ("right", "left")


def traffic(hand: str, *, ramp: bool = False) -> pd.DataFrame:
    """At 30 m/s a car changes lanes in front of another; one is ahead in each lane; one may come from a ramp."""
    time, side = STEP * np.arange(600), -1.0 if hand == "right" else 1.0
    share = 0.5 - 0.5 * np.cos(np.pi * np.clip((time - BEGIN) / DURATION, 0.0, 1.0))
    cars = [
        (250.0, 30.0, 1.5 - share), (310.0, 30.0, 1.5), (205.0, 30.0, 0.5), (330.0, 30.5, 0.5), (130.0, 29.5, 1.5),
        *([(290.0, 30.0, 2.5)] if ramp else []),
    ]  # fmt: skip
    parts = [
        pd.DataFrame({"id": k, "time": time, "x": x + v * time, "y": side * LANE * y, "length": LENGTH, "width": 1.8,
                      "class": "car"}) for k, (x, v, y) in enumerate(cars)
    ]  # fmt: skip
    return pd.concat(parts, ignore_index=True)


def road_file(folder: Path, hand: str, *, ramp: bool = False) -> Path:
    """Two lanes along x on the side that they are driven on; with a ramp that ends where a third begins."""
    side, rule = (-1, "RHT") if hand == "right" else (1, "LHT")

    def of(*ids: int) -> str:
        return section(*((lanes(*sorted(ids)[::-1]), "")[::side]))

    first = of(side, 2 * side)
    path = folder / f"road_{hand}_{ramp}.xodr"
    if not ramp:
        path.write_text(map_of(road("1", line(length=4000.0), 4000.0, sections=first, rule=rule)))
        return path
    to, back = ('<{} elementType="road" elementId="{}" contactPoint="{}"/>'.format(*one) for one in (
        ("successor", "2", "start"), ("predecessor", "1", "end")))  # fmt: skip
    onto = section(*((lanes(side, links={side: (None, 3 * side)}), "")[::side]))
    wide = of(side, 2 * side, 3 * side).replace(f'<predecessor id="{3 * side}"/>', "")
    path.write_text(map_of(
        road("1", line(length=BORDER), BORDER, sections=first, rule=rule, link=to),
        road("2", line(BORDER, length=3000.0), 3000.0, sections=wide, rule=rule, link=back),
        road("3", line(y=2.0 * side * LANE, length=BORDER), BORDER, sections=onto, rule=rule, link=to),
    ))  # fmt: skip
    return path


def truth(rows: pd.DataFrame, moment: float) -> dict[int, list[float]]:
    """Free space to who is next ahead, and nearest on the left and on the right, by looking at every pair. [m]"""
    here = rows[np.isclose(rows["time"], moment)]
    is_ramp = (here["y"].abs() > 2.0 * LANE) & (here["x"] < BORDER)  # nothing lies beside it yet
    found = {}
    for one in here.itertuples():
        near = []
        for aside in (0.0, LANE, -LANE):
            others = here[np.isclose(here["y"], one.y + aside, atol=0.1) & (here["id"] != one.id)]
            others = others[is_ramp[others.index] == is_ramp[one.Index]]
            apart = others["x"] - one.x
            apart = apart[apart > 0.0] if aside == 0.0 else apart.abs()
            near.append(float(max(apart.min() - LENGTH, 0.0)) if (apart < 200.0 + LENGTH).any() else np.inf)
        found[int(one.id)] = near
    return found


def agrees(found: dict[int, list[float]], wanted: dict[int, list[float]], accuracy: float, what: str) -> None:
    for number, near in wanted.items():
        for seen, there in zip(found[number], near, strict=True):
            nobody = not np.isfinite(there) and not np.isfinite(seen)
            assert nobody or abs(seen - there) < accuracy, f"{what}: {number}: {found[number]}, {near}"


def imports(rows: pd.DataFrame, folder: Path, hand: str, *, ramp: bool) -> Iterator[tuple[str, pd.DataFrame]]:
    """Drive tables of every door that reads this traffic."""
    there = road_file(folder, hand, ramp=ramp)
    rows.to_csv(folder / "tracks.csv", index=False)
    yield "tracks", import_drives("tracks", folder / "tracks.csv", road=there, keep_cut=True).to_frame()
    if not ramp:
        yield "osi", import_drives("osi", osi_trace(rows, folder), road=there, keep_cut=True).to_frame()
    if hand == "right" and not ramp:
        yield "levelx", import_drives("levelx", highd(rows, folder), keep_cut=True).to_frame()
        output, net = fcd(rows, folder)
        (folder / "types.rou.xml").write_text(f'<routes><vType id="car" length="{LENGTH}"/></routes>')
        made = import_drives("fcd", output, net=net, types=folder / "types.rou.xml", keep_cut=True)
        yield "fcd", made.to_frame()


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("ramp", [False, True])
def test_imports_agree(hand: str, ramp: bool, tmp_path: Path) -> None:
    rows = traffic(hand, ramp=ramp)
    for door, table in imports(rows, tmp_path, hand, ramp=ramp):
        number = table["drive"].str.extract(r"(\d+)$")[0].astype(int)
        for moment in MOMENTS:
            here = table[np.isclose(table["time"], moment)]
            found = {k: here.loc[number == k, list(NEAR)].iloc[0].tolist() for k in number.unique()}
            agrees(found, truth(rows, moment), 0.05, f"{door} {moment}")
        mover = table[number == 0]
        (change,) = _changes(*(mover[name].to_numpy() for name in ("time", "offset", "lane_width")))
        _is_planted(*change, hand, door)
        if door != "fcd":  # of simulated traffic nothing is cut but junctions
            cut = mover.loc[mover["state"] == "lane change", "time"]
            _is_planted(cut.min() + 1.0, cut.max() - 1.0, None, hand, f"{door}, cut")


def _changes(time: np.ndarray, offset: np.ndarray, width: np.ndarray) -> list[tuple[float, float, int]]:
    course = Course.of(time, offset, width, 1.8)
    assert abs(np.abs(course.rate).max() - PEAK) < 0.01 * PEAK
    return [(time[one.first], time[one.last], one.lanes) for one in course.maneuvers() if one.lanes]


def _is_planted(begin: float, end: float, lanes_to_left: int | None, hand: str, what: str) -> None:
    assert abs(begin - BEGIN) < 0.7 and abs(end - BEGIN - DURATION) < 0.7, f"{what}: {begin} to {end} s"
    assert lanes_to_left in (None, 1 if hand == "right" else -1), what


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("ramp", [False, True])
def test_detect_agrees(hand: str, ramp: bool, tmp_path: Path) -> None:
    rows, there = traffic(hand, ramp=ramp), road_file(tmp_path, hand, ramp=ramp)
    rows.to_csv(tmp_path / "tracks.csv", index=False)
    (source,) = sources_of(tmp_path / "tracks.csv", SourceSettings(road=there))
    (scene,) = source.scenes()
    views = views_of(scene, PERFECT_SENSOR, 0)
    side = 1 if hand == "right" else -1
    (mover,) = (view for view in views if view.track.name == "0" and view.side == side)
    (change,) = mover.truth.changes
    time = mover.track.time
    _is_planted(time[change.begin], time[change.end], change.side, hand, "detect")
    assert abs(mover.lateral_speed.max() - PEAK) < 0.01 * PEAK
    asked = 0
    for view in views:
        for moment in MOMENTS:
            here = rows[np.isclose(rows["time"], moment)]
            x, y = here.loc[here["id"] == int(view.track.name), ["x", "y"]].iloc[0]
            others = here[np.isclose(here["y"], y + LANE * view.side, atol=0.1)]
            gaps = x - others["x"] - LENGTH  # negative: beside
            gaps = gaps[(gaps > -2.0 * LENGTH) & (gaps < 150.0 - LENGTH)]
            gap = view.observer.gap[np.argmin(np.abs(view.track.time - moment))]
            assert np.isnan(gap) if gaps.empty else abs(gap - gaps.min()) < 0.05, (view.track.name, view.side, moment)
            asked += 1
    assert asked >= 8


@pytest.fixture(scope="module")
def remade(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[pd.DataFrame, Path, Reconstruction]]:
    """What `reconstruct` makes of the traffic on either hand."""
    made = {}
    for hand in HANDS:
        folder, rows = tmp_path_factory.mktemp(hand), traffic(hand, ramp=True)
        rows.to_csv(folder / "tracks.csv", index=False)
        found = reconstruct(folder / "tracks.csv", road=road_file(folder, hand, ramp=True))
        found.write(folder / "made")
        made[hand] = rows, next((folder / "made").glob("*.xosc")), found
    return made


@pytest.mark.parametrize("hand", HANDS)
def test_reconstruct_agrees(hand: str, remade: dict[str, tuple[pd.DataFrame, Path, Reconstruction]]) -> None:
    rows, _, found = remade[hand]
    (plan,) = (plan for plan in found.plans if plan.changes)
    (change,) = plan.changes
    assert plan.vehicle.name == "0"
    _is_planted(change.start, change.end, change.lanes, hand, "reconstruct")
    (met,) = (one for one in found.encounters if one.kind == "lane change")
    here = rows[np.isclose(rows["time"], BEGIN + 0.5 * DURATION)]
    x, y = here.loc[here["id"] == 0, ["x", "y"]].iloc[0]
    others = here[np.isclose(here["y"], y + 0.5 * LANE * (1 if hand == "right" else -1), atol=0.1)]
    apart = others.set_index("id")["x"] - x
    for beside, gap in ((met.ahead, apart[apart > 0].min()), (met.behind, -apart[apart < 0].max())):
        assert beside is not None and abs(beside.gap - (gap - LENGTH)) < 0.3


@pytest.mark.parametrize("hand", HANDS)
def test_played_and_live_agree(hand: str, remade: dict[str, tuple[pd.DataFrame, Path, Reconstruction]]) -> None:
    """As a conversion sees it, at many moments, and as drivers in a running player do, at one."""
    rows, scenario, _ = remade[hand]
    played = play_scenario(scenario, step=0.02, time_limit=60.0)
    motion, network = played.motion, played.network
    numbers = [int(one.name.removeprefix("V")) for one in motion.entities]
    for moment in MOMENTS:
        row = int(np.argmin(np.abs(motion.entities[0].time - moment)))
        seen = [entity_context(motion, network, k, np.array([row])) for k in range(len(numbers))]
        wanted = truth(rows, moment)
        for what, found in (("play", seen), ("live", _live(motion, network, row))):
            agrees({number: [float(found[k][name][0]) for name in NEAR] for k, number in enumerate(numbers)},
                   wanted, 1.0, f"{what} {moment}")  # fmt: skip
    mover = motion.entities[numbers.index(0)]
    speed = np.abs(rate(mover.y, 0.02, RATE_WINDOW)).max()
    assert abs(speed - PEAK) < 0.05 * PEAK


def _live(motion: NominalMotion, network: RoadNetwork, row: int) -> list[dict[str, np.ndarray]]:
    columns = [np.array([getattr(one, name)[row] for one in motion.entities])
               for name in ("x", "y", "heading", "road", "lane", "s")]  # fmt: skip
    sizes = [np.array([getattr(one.box, name) for one in motion.entities]) for name in ("length", "width", "center_x")]
    offset = np.array([one.offset[row] for one in motion.entities])
    found = look_around(OpenDriveRoads(network), Places(*columns, *sizes), offset, np.zeros(len(offset), dtype=bool))
    return [{name: values[k : k + 1] for name, values in found.items()} for k in range(len(offset))]
