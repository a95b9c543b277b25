"""Whose place it is: drivers in the library of esmini, beside the same scenario without them."""

from __future__ import annotations

import ctypes
import os
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.extras.live.call import LiveRun, live_esmini
from xosc_lateral.extras.live.esmini import EsminiTraffic
from xosc_lateral.extras.live.esmini_library import open_player
from xosc_lateral.workflows.profiles.profiles import read_profile

CASES = Path(__file__).resolve().parents[4] / "shared" / "cases" / "live"
REAL = os.environ.get("ESMINI_LIBRARY")
pytestmark = [
    pytest.mark.skipif(not REAL, reason="ESMINI_LIBRARY names no library of esmini"),
    pytest.mark.skipif(not CASES.is_dir(), reason="no shared cases"),
]


def run(name: str, seconds: float, folder: Path = CASES) -> LiveRun:
    return live_esmini(folder / f"{name}.xosc", REAL, seed=1, duration=seconds)


def own(result: LiveRun, name: str) -> pd.DataFrame:
    frame = result.to_frame()
    return frame[frame.name == name]


def test_cars_that_stand_stay_where_they_are() -> None:
    result = run("t17_standing", 5.0)
    for name in ("S", "S2"):
        rows = own(result, name)
        assert rows.speed.abs().max() == 0.0 and np.ptp(rows.x) < 1e-9 and np.ptp(rows.y) < 1e-9
        assert np.ptp(rows.h) < 1e-9 and rows.steered.all()
    assert not result.warnings and own(result, "A").offset.std() > 0.02


def test_a_car_and_its_trailer_keep_to_the_lane_that_they_changed_to() -> None:
    with_trailer, alone = run("t1_trailer_lc", 13.0), run("t2_car_lc", 13.0)
    ends = [own(one, "Cv").y.iloc[-1] for one in (with_trailer, alone)]
    assert abs(ends[0] + 5.625) < 0.6 and ends[0] == pytest.approx(ends[1], abs=0.1)
    assert "not driven, it is pulled: 'Cv+'" in with_trailer.notes and not with_trailer.warnings


def test_a_lane_that_ends_throws_nobody() -> None:
    frame = run("t5_lanedrop", 14.0).to_frame()
    for _, rows in frame.groupby("name"):
        y = rows.y.to_numpy()[::5]  # the road runs along x
        assert np.abs(np.diff(y, 2)).max() / 0.05**2 < 1.5


def test_an_action_that_begins_at_0_s_has_its_vehicle(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(CASES, tmp_path / "live"))
    path = folder / "t2_car_lc.xosc"
    text = path.read_text()
    assert text.count('<SimulationTimeCondition value="5" rule="greaterThan"/>') == 1
    path.write_text(text.replace('value="5" rule="greaterThan"', 'value="0" rule="greaterOrEqual"'))
    result = run("t2_car_lc", 6.0, folder)
    rows = own(result, "Cv")
    assert not rows.steered[rows.time < 3.9].any() and rows.steered[rows.time > 4.1].all()
    assert not result.warnings and np.abs(np.diff(rows.y)).max() < 0.02


def test_who_is_moved_by_something_else_is_left_alone_until_that_rests() -> None:
    path = CASES / "t2_car_lc.xosc"
    player = open_player(REAL, path)
    raw = ctypes.CDLL(REAL)
    raw.SE_ReportObjectLateralPosition.argtypes = [ctypes.c_int, ctypes.c_double]
    traffic = EsminiTraffic(player, path, read_profile("motorway"), seed=1)
    places, steered = [], []
    for k in range(500):
        traffic.steer(0.01)
        steered.append(traffic.moves["O"][1])
        assert player.SE_StepDT(0.01) == 0
        traffic.settle(0.01)
        state = traffic.states()["O"]
        if 200 <= k < 300:  # a function of somebody's own: aside by half a metre within a second
            raw.SE_ReportObjectLateralPosition(state.id, state.t + 0.015 if k == 200 else places[-1] + 0.005)
        places.append(traffic.states()["O"].t)
    player.SE_Close()
    assert all(steered[:201]) and not any(steered[202:300]) and all(steered[330:])
    assert np.abs(np.diff(places)).max() < 0.02
    (line,) = traffic.warnings
    assert line.startswith("vehicle 'O': moved sideways from 2.0") and "\n" not in line
