"""Maneuver laws: lane changes of a recording as figures, and scenarios varied by them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lxml import etree
from msgspec.structs import replace

import xosc_lateral as xl
from examples.driver_simulator import simulate_drive
from tests.extras.recordings.test_importers_tracks import WIDTH, two_lanes_each_way, world
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.drivers.model.profile import Maneuvers
from xosc_lateral.extras.recordings.reconstruct import BEFORE, read_maneuvers
from xosc_lateral.files.openscenario.distribution import read_distribution

XSD = Path(__file__).resolve().parents[2] / "data/xsd/OpenSCENARIO-1.2.0.xsd"
DRIFT = 0.2
"""By which planted drivers move away from the marking before they cross it. [m]"""


def changing(number: int, duration: float, *, left: bool, ahead: float) -> pd.DataFrame:
    """A vehicle that changes lanes 20 s after it appears, in so many seconds, behind another one."""
    time = np.arange(0.0, 40.0, 0.1)
    side, start = (1.0 if left else -1.0), 20.0
    share = 0.5 - 0.5 * np.cos(np.pi * np.clip((time - start) / duration, 0.0, 1.0))
    drift = DRIFT * np.sin(np.pi * np.clip((time - start + 8.0) / 8.0, 0.0, 1.0)) ** 2
    t = (-5.25 if left else -1.75) + side * (WIDTH * share - drift) + 0.02 * np.sin(2.0 * np.pi * time / 7.0)
    leader = np.full(len(time), -5.25 if left else -1.75) + 0.02 * np.sin(2.0 * np.pi * time / 9.0)
    rows = []
    for name, s, y in ((f"v{number}", 100.0 + 30.0 * time, t), (f"l{number}", 104.5 + ahead + 28.0 * time, leader)):
        px, py = world(s, y)
        rows.append(pd.DataFrame({"time": time + 60.0 * number, "id": name, "x": px, "y": py, "psi": 0.3}))
    return pd.concat(rows)


DURATIONS = np.linspace(5.0, 9.0, 24)
AHEAD = 60.0 + 4.0 * (7 * np.arange(24) % 24)
"""Of the leader, which loses 2 m/s for 20 s until the begin. [m]"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("changes")
    rows = [changing(k, one, left=k % 4 > 0, ahead=float(AHEAD[k])) for k, one in enumerate(DURATIONS)]
    pd.concat(rows).to_csv(folder / "tracks.csv", index=False)
    return folder / "tracks.csv", two_lanes_each_way(folder)


@pytest.fixture(scope="module")
def found(recording: tuple[Path, Path]) -> Maneuvers:
    return read_maneuvers(*recording)


def test_lane_changes_of_a_recording_are_those_that_were_driven(found: Maneuvers) -> None:
    assert found.changes == 24 and found.behind.value == 1.0 and found.given_up.value == 0.0
    assert abs(found.gap.value / np.exp(np.log(AHEAD - 40.0).mean()) - 1.0) < 0.05
    assert abs(found.duration(0.0, 50.0) - np.median(DURATIONS)) < 0.6
    assert found.gap_exponent.low < 0.0 < found.gap_exponent.high
    assert found.spread_behind.low < np.std(np.log(DURATIONS)) < found.spread_behind.high
    assert found.left.low < 0.75 < found.left.high
    keeping = (48.0 * 40.0 - DURATIONS.sum()) / 3600.0
    assert abs(found.hours / keeping - 1.0) < 0.05 and abs(found.rate.value * found.hours - 24.0) < 0.1
    for side in ("left", "right"):
        assert abs(found.end[side].mean.value) < 0.1 and abs(found.speed_change[side].mean.value) < 0.1


def test_the_way_before_is_that_of_the_drivers_by_side(found: Maneuvers) -> None:
    planted = DRIFT * np.sin(np.pi * (BEFORE + 8.0) / 8.0) ** 2
    for side, sign in (("left", -1.0), ("right", 1.0)):
        away = np.array(found.before[side]) - sign * planted
        assert np.abs(away[BEFORE < -1.0]).max() < 0.08, side  # where a change begins is known to half a second


@pytest.fixture(scope="module")
def profile(found: Maneuvers, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("profiles") / "mine.json"
    xl.write_profile(replace(xl.read_profile("motorway"), name="mine", maneuvers=found), path)
    return path


def test_a_profile_keeps_its_maneuvers_and_one_without_is_as_it_was(profile: Path, found: Maneuvers, capsys) -> None:
    assert xl.read_profile(profile).maneuvers == found
    assert "maneuvers" not in xl.read_profile("rural").to_dict()
    assert main(["profiles", "show", str(profile)]) == 0
    assert "24 lane changes" in capsys.readouterr().out


def test_a_scenario_is_varied_in_the_parameters_that_it_has(profile: Path, tmp_path: Path) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path / "first")
    made = xl.vary(scenario, tmp_path / "varied", like=profile, count=4, seed=3)
    assert list(made.durations) == ["lane_change_time"]
    schema = etree.XMLSchema(etree.parse(str(XSD)))
    for path in (made.scenario, made.distribution):
        schema.assertValid(etree.parse(str(path)))
    again = xl.vary(scenario, tmp_path / "again", like=profile, count=4, seed=3)
    assert again.distribution.read_bytes() == made.distribution.read_bytes()
    (part,) = read_distribution(made.distribution).distribution.parts  # what `convert` makes variants of
    drawn = [float(one["lane_change_time"]) for one in part.sets]
    assert drawn == np.round(made.durations["lane_change_time"], 3).tolist()


def test_a_lane_change_without_a_parameter_gets_one(profile: Path, tmp_path: Path) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path)
    scenario.write_text(scenario.read_text().replace('value="$lane_change_time"', 'value="4"'))
    made = xl.vary(scenario, tmp_path / "varied", like=profile, count=3)
    ((name, values),) = made.durations.items()
    played = xl.play(made.scenario, parameters={name: values[0]})
    plain = xl.play(scenario)
    assert "CutIn" in name
    rows = [one.to_frame().query("name == 'CutIn'") for one in (played, plain)]
    lasts = [np.ptp(one["time"][one["offset_t"].abs() > 0.01]) for one in rows]
    assert abs(lasts[0] - lasts[1] - (values[0] - 4.0)) < 0.3
    unchanged = xl.play(made.scenario).to_frame()
    pd.testing.assert_frame_equal(unchanged, plain.to_frame())  # the default is what was written


def test_no_lane_change_gets_milder_unless_that_is_asked_for(tmp_path: Path) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path / "first", lane_change_time="2")
    made = xl.vary(scenario, tmp_path / "varied", like="motorway", count=200, seed=1)
    (change,) = made.changes
    assert change.about_itself and change.written == 2.0 < change.law[0]
    spread = xl.read_profile("motorway").maneuvers.spread_alone.value
    assert abs(np.median(change.durations) / 2.0 - 1.0) < 4.0 * spread / np.sqrt(200)
    assert abs(np.std(np.log(change.durations)) / spread - 1.0) < 0.2
    assert "varied about itself" in str(made) and "as written" in str(made)
    (theirs,) = xl.vary(scenario, tmp_path / "theirs", like="motorway", count=200, seed=1, replace=True).changes
    assert not theirs.about_itself
    np.testing.assert_allclose(np.quantile(theirs.durations, [0.05, 0.5, 0.95]), theirs.law, rtol=0.1)


def test_a_rate_is_varied_as_a_rate(tmp_path: Path) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path / "first")
    text = scenario.read_text()
    dynamics = 'value="$lane_change_time" dynamicsDimension="time"'
    assert dynamics in text
    scenario.write_text(text.replace(dynamics, 'value="0.7" dynamicsDimension="rate"'))
    made = xl.vary(scenario, tmp_path / "varied", like="motorway", count=3, seed=1)
    (change,) = made.changes
    assert change.is_rate and change.parameter.endswith("_rate")
    for rate, duration in zip(change.values, change.durations, strict=True):
        rows = xl.play(made.scenario, parameters={change.parameter: rate})._played.motion
        (action,) = (one for one in rows.actions if "CutInEvent" in one.path)
        assert action.end - action.start == pytest.approx(duration, abs=0.05)


def test_a_profile_with_rows_of_an_older_version_is_read_as_their_law(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    led, n = rng.random(200) < 0.5, 200
    gap = np.where(led, np.exp(rng.normal(4.0, 0.8, n)), np.nan)
    duration = np.exp(np.where(led, 1.5 + 0.15 * np.log(np.where(led, gap, 1.0)), 2.1) + rng.normal(0.0, 0.2, n))
    columns = {"duration": duration, "gap": gap, "speed": np.full(n, 30.0), "speed_change": rng.normal(1.0, 2.0, n)}
    values = xl.read_profile("motorway").to_dict() | {"maneuvers": {
        "changes": 500, "hours": 10.0, "aborted": 25, "left": (rng.random(n) < 0.5).tolist(), "recording": "old",
        "sample": {name: [None if np.isnan(one) else one for one in rows.tolist()] for name, rows in columns.items()},
        "before": {"left": [0.0, 0.1]},
    }}  # fmt: skip
    path = tmp_path / "motorway.json"
    path.write_text(json.dumps(values))
    law = xl.read_profile(path).maneuvers
    assert law is not None and law.changes == 500 and law.rate.value == 50.0
    assert law.gap_exponent.low < 0.15 < law.gap_exponent.high
    assert abs(law.duration(0.0, 30.0) / np.exp(1.5 + 0.15 * np.log(30.0)) - 1.0) < 0.06
    assert law.given_up.value == pytest.approx(25 / 525, abs=1e-4) and law.before == {"left": (0.0, 0.1)}
    path.write_text(json.dumps(values | {"maneuvers": {"sample": {}, "changes": 1}}))
    with pytest.raises(FormatError, match=r"motorway\.json: maneuvers: no smoothed sample"):
        xl.read_profile(path)


def test_speeds_change_beside_lane_changes_where_the_vehicle_keeps_its_own(profile: Path, tmp_path: Path) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path / "first")
    made = xl.vary(scenario, tmp_path / "varied", like=profile, count=2, speeds=True)
    ((name, changes),) = made.speed_changes.items()
    etree.XMLSchema(etree.parse(str(XSD))).assertValid(etree.parse(str(made.scenario)))
    (duration,) = made.durations
    speeds = []
    for change in (0.0, 2.0):
        rows = xl.play(made.scenario, parameters={duration: 6.0, name: change}).to_frame().query("name == 'CutIn'")
        begin = rows["time"][rows["offset_t"].abs() > 1e-3].iloc[0]
        speeds.append(np.interp(begin + np.array([0.0, 5.9]), rows["time"], rows["speed"]))
    assert speeds[0] == pytest.approx([35.0, 35.0], abs=1e-6)
    assert speeds[1] == pytest.approx([35.0, 37.0], abs=0.02)
    assert {float(one[name]) for one in read_distribution(made.distribution).distribution.parts[0].sets} == set(changes)


def test_a_vehicle_ahead_is_found_in_lanes_that_run_against_the_road(tmp_path: Path) -> None:
    road = two_lanes_each_way(tmp_path)
    rows = [changing(k, one, left=k % 2 > 0, ahead=90.0) for k, one in enumerate(DURATIONS)]
    turned = pd.concat(rows)  # half a turn about a place on the reference line: the other carriageway
    x, y = world(np.array([700.0]), np.array([0.0]))
    turned["x"], turned["y"], turned["psi"] = 2 * x[0] - turned["x"], 2 * y[0] - turned["y"], turned["psi"] + np.pi
    turned.to_csv(tmp_path / "tracks.csv", index=False)
    found = read_maneuvers(tmp_path / "tracks.csv", road)
    assert found.changes == len(DURATIONS) and found.behind.value == 1.0


def test_what_cannot_be_varied_is_refused_in_a_line(profile: Path, tmp_path: Path, capsys) -> None:
    scenario, _ = xl.write_template("jam-end", tmp_path)
    assert main(["vary", str(scenario), "--like", str(profile), "-o", str(tmp_path / "a")]) == 1
    assert "no lane change with a duration" in capsys.readouterr().err
    assert main(["vary", str(scenario), "--like", "rural", "-o", str(tmp_path / "a")]) == 1
    assert "holds no maneuvers" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


def test_drivers_move_before_a_lane_change_whose_begin_they_know(
    profile: Path, found: Maneuvers, tmp_path: Path
) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path)
    own = xl.read_profile(profile)

    def moved(driver: xl.DriverProfile, **settings: object) -> pd.Series:
        rows = xl.convert(scenario, profile=driver, seed=3, neighbours="none", **settings).to_frame()
        return rows[rows["name"] == "CutIn"].set_index("time")["deviation"]

    without = replace(own, maneuvers=None)
    (change,) = (one for one in xl.play(scenario)._played.motion.actions if "CutInEvent" in one.path)
    difference = moved(own, ego=["none"]) - moved(without, ego=["none"])
    time = difference.index.to_numpy() - change.start
    way = np.array(found.before["right"])
    expected = np.interp(time, BEFORE, way) * (0.5 + 0.5 * np.cos(np.pi * np.clip(time / 4.0, 0.0, 1.0)))
    assert difference.max() > 0.7 * DRIFT  # to the left, before a change to the right
    assert np.abs(difference - expected).max() < 0.03
    assert not difference[(time < -8.3) | (time > 4.3)].abs().gt(1e-3).any()
    # a vehicle under test decides when it begins: nobody knows that before
    assert (moved(own, ego=["Ego"]) == moved(without, ego=["Ego"])).all()
    # nor does anybody move who does not move in his lane
    assert not moved(own, only=["Ego"], ego=["none"]).abs().max() > 1e-9


@pytest.mark.pages
def test_in_reactive_outputs_they_do_where_the_begin_is_known(profile: Path, tmp_path: Path) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path)
    own = xl.read_profile(profile)
    (change,) = (one for one in xl.play(scenario)._played.motion.actions if "CutInEvent" in one.path)

    def played(driver: xl.DriverProfile, name: str, ego: str) -> pd.Series:
        settings = {"profile": driver, "seed": 3, "neighbours": "none", "mode": "lane-offset"}
        made = xl.convert(scenario, tmp_path / f"{name}.xosc", ego=[ego], **settings)
        rows = xl.play(tmp_path / f"{name}.xosc").to_frame()
        assert made.modes["CutIn"] == "lane-offset"
        return rows[rows["name"] == "CutIn"].set_index("time")["offset_t"]

    without = replace(own, maneuvers=None)
    difference = played(own, "own", "none") - played(without, "without", "none")
    assert difference[difference.index < change.start].max() > 0.6 * DRIFT
    assert difference[difference.index > change.start + 6.0].abs().max() < 0.02
    assert (played(own, "reacts", "Ego") == played(without, "still", "Ego")).all()  # it begins by a distance to Ego


@pytest.mark.pages
def test_fit_holds_the_law_of_a_recording(recording: tuple[Path, Path], found: Maneuvers) -> None:
    drives = simulate_drive(400.0, seed=5).table
    path, road = recording
    fitted = xl.fit(drives, maneuvers=path, road=road)
    assert fitted.maneuvers == found and path.name in fitted.provenance.inputs
    assert xl.fit(drives, maneuvers=found).maneuvers == found
