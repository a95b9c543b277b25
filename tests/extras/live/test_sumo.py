"""Drivers in a SUMO that is really run, and its FCD output read as drives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import xosc_lateral as xl
from tests.kit.sumo_run import write_run
from xosc_lateral.base.errors import FormatError, SimulationError
from xosc_lateral.cli import main
from xosc_lateral.extras.live.verbs import FCD_COLUMNS

pytest.importorskip("libsumo", reason="the extra sumo is not installed")
pytest.importorskip("sumo", reason="the extra sumo is not installed")
pytestmark = pytest.mark.filterwarnings("ignore")  # libsumo's, about the pyarrow that is installed

END = 60.0
"""[s]"""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with drivers: SUMO's FCD output, and our own states."""
    folder = tmp_path_factory.mktemp("sumo")
    config = write_run(folder, end=END, cars=1800)
    words = ["live", "sumo", str(config), "--seed", "1", "-q", "--fcd-output", str(folder / "fcd.xml")]
    assert main([*words, "--states", str(folder / "states.csv")]) == 0
    return folder


def test_in_sumos_own_output_vehicles_are_where_their_drivers_say(run: Path) -> None:
    import pandas as pd

    states = pd.read_csv(run / "states.csv")
    own = states[states.steered]
    away = np.abs(own.offset - own.driver)
    assert own.name.nunique() > 10 and len(own) > 0.7 * len(states)
    assert np.quantile(away, 0.9) < 0.02 and away.max() < 0.4
    table = xl.import_drives("fcd", run / "fcd.xml", net=run / "run.net.xml").to_frame()
    states["time"] = (states.time - 0.1).round(2)  # SUMO writes a step under the time at which it began
    both = states.merge(table, left_on=["name", "time"], right_on=["drive", "time"])
    assert len(both) > 0.9 * len(states)
    np.testing.assert_allclose(both.offset_x, both.offset_y, atol=0.011)  # SUMO writes centimetres
    assert set(table.lane_width) == {3.75} and set(table.lane_count) == {2}
    assert set(table.is_truck) == {0.0, 1.0}


def test_left_hand_traffic_keeps_its_sides(tmp_path: Path) -> None:
    """Along x, offsets to the left are at larger y, in SUMO's output and in ours."""
    import pandas as pd

    config = write_run(tmp_path, end=30.0, cars=1800, left_hand=True)
    words = ["live", "sumo", str(config), "--seed", "1", "-q", "--fcd-output", str(tmp_path / "fcd.xml")]
    assert main([*words, "--states", str(tmp_path / "states.csv")]) == 0
    states = pd.read_csv(tmp_path / "states.csv")
    own = states[states.steered & (states.road == "e0")]
    away = np.abs(own.offset - own.driver)
    assert len(own) > 500 and np.quantile(away, 0.9) < 0.02
    centre = {0: 5.625, 1: 1.875}  # of SUMO's lanes, counted from the left kerb: left of the edge's line
    np.testing.assert_allclose(own.offset, own.y - own.lane.map(centre), atol=0.02)
    table = xl.import_drives("fcd", tmp_path / "fcd.xml", net=tmp_path / "run.net.xml").to_frame()
    states["time"] = (states.time - 0.1).round(2)
    both = states.merge(table, left_on=["name", "time"], right_on=["drive", "time"])
    assert len(both) > 0.9 * len(states)
    np.testing.assert_allclose(both.offset_x, both.offset_y, atol=0.011)
    np.testing.assert_array_equal(both.lane_index, 1 - both.lane)


def test_a_trace_shows_the_lanes_and_where_everybody_was(run: Path, tmp_path: Path) -> None:
    pytest.importorskip("osi_utilities", reason="the extra osi is not installed")
    words = ["live", "sumo", str(run / "run.sumocfg"), "--duration", "10", "--states", str(tmp_path / "states.csv")]
    assert main([*words, "--osi", str(tmp_path / "trace.mcap"), "-q"]) == 0
    import pandas as pd

    states = pd.read_csv(tmp_path / "states.csv")
    table = xl.import_drives("osi", tmp_path / "trace.mcap").to_frame()
    states["time"] = (states.time - 0.1).round(2)  # the trace's own begins at its first message
    both = states.merge(table.assign(name=table.drive, time=table.time.round(2)), on=["name", "time"])
    assert len(both) > 30
    np.testing.assert_allclose(both.offset_y, both.offset_x, atol=0.006)  # SUMO's lanes lie at centimetres
    np.testing.assert_allclose(both.lane_width, 3.75, atol=0.011)


def lane_changes(fcd: Path) -> int:
    """Number of them in FCD output: the same edge, another lane."""
    table = xl.import_drives("fcd", fcd, net=fcd.parent / "run.net.xml").to_frame()
    return int((table.groupby("drive").lane_index.diff().abs() > 0).sum())


def test_lane_changes_stay_sumos_and_the_spread_its_drivers(run: Path) -> None:
    import pandas as pd

    from xosc_lateral.extras.live.sumo import start

    words = [
        "-c",
        str(run / "run.sumocfg"),
        "--fcd-output",
        str(run / "alone.xml"),
        "--fcd-output.attributes",
        FCD_COLUMNS,
    ]
    sumo = start(words)
    while sumo.simulation.getTime() < END:
        sumo.simulationStep()
    sumo.close()
    alone, ours = (lane_changes(run / name) for name in ("alone.xml", "fcd.xml"))
    assert alone > 10 and abs(ours - alone) <= 0.3 * alone
    states = pd.read_csv(run / "states.csv")
    speeds = [xl.import_drives("fcd", run / name).to_frame().speed.mean() for name in ("alone.xml", "fcd.xml")]
    assert speeds[1] > 0.99 * speeds[0]  # nobody is kept behind whom he would overtake
    # nobody is left between two lanes
    off = states[(states.offset.abs() > 1.0) & ~states.steered].groupby("name").time.agg(np.ptp)
    assert off.max() < 15.0


def test_the_same_over_traci(tmp_path: Path) -> None:
    import sumo
    import traci

    found = []
    config = write_run(tmp_path, end=6.0)
    program = str(Path(sumo.SUMO_HOME) / "bin" / "sumo")
    for connect in ("libsumo", "traci"):
        if connect == "libsumo":
            from xosc_lateral.extras.live.sumo import start

            connection = start(["-c", str(config)])
        else:
            traci.start([program, "-c", str(config), "--no-step-log"], label="drivers")
            connection = traci.getConnection("drivers")
        traffic = xl.SumoTraffic(connection, xl.read_profile("motorway"), seed=1)
        for _ in range(60):
            traffic.steer()
            connection.simulationStep()
        found.append(dict(traffic.moves))
        connection.close()
    assert len(found[0]) > 2 and found[0].keys() == found[1].keys()
    for name, (offset, steered) in found[0].items():
        assert found[1][name] == (pytest.approx(offset, abs=1e-9), steered)


class Lying:
    """SUMO, of whose vehicles one says nonsense and another vanishes."""

    def __init__(self, connection: Any) -> None:
        self.connection, self.vehicle = connection, self
        self.nonsense: set[str] = set()
        self.gone: set[str] = set()

    def __getattr__(self, name: str) -> Any:
        whole = self.connection if hasattr(self.connection, name) else self.connection.vehicle
        return getattr(whole, name)

    def getIDList(self) -> list[str]:
        return [name for name in self.connection.vehicle.getIDList() if name not in self.gone]

    def getPosition(self, name: str) -> tuple[float, float]:
        x, y = self.connection.vehicle.getPosition(name)
        return (float("nan"), y) if name in self.nonsense else (x, y)


def test_a_vehicle_that_says_nonsense_or_vanishes_is_left_alone_and_the_others_drive_on(run: Path) -> None:
    from xosc_lateral.extras.live.sumo import start

    lying = Lying(start(["-c", str(run / "run.sumocfg")]))
    traffic = xl.SumoTraffic(lying, xl.read_profile("motorway"), seed=1)
    for step in range(120):
        if step == 100:
            lying.nonsense, lying.gone = {"cars.0"}, {"cars.1"}
        traffic.steer()
        lying.connection.simulationStep()
    lying.connection.close()
    assert traffic.warnings == ["vehicle 'cars.0': a number that is none; it is left alone"]
    assert len(traffic.moves) > 2 and not {"cars.0", "cars.1"} & traffic.moves.keys()
    assert all(np.isfinite(offset) for offset, _ in traffic.moves.values())


@pytest.mark.pages
def test_a_road_may_be_empty_for_a_while(tmp_path: Path) -> None:
    config = write_run(tmp_path, end=140.0)
    cars = "".join(f'<vehicle id="v{t}" route="r" depart="{t}" departSpeed="max"/>' for t in (0, 90))
    (tmp_path / "run.rou.xml").write_text(f'<routes><route id="r" edges="e0"/>{cars}</routes>')
    states = xl.live_sumo(config, duration=140.0).to_frame()
    gone = states.time[states.name == "v0"].max()
    assert gone < 90.0
    with pytest.raises(SimulationError, match=r"no vehicle 'v1' until 5 s; there were v0"):
        xl.live_sumo(config, duration=5.0, ego=["v1"])
    assert states[states.name == "v90"].steered.iloc[1:].all()
    assert states[states.name == "v90"].offset.std() > 0.01


def test_nobody_collides_and_drivers_differ(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["live", "sumo", str(run / "run.sumocfg"), "--seed", "1", "--duration", "30"]) == 0
    said = capsys.readouterr()
    assert "warning" not in said.err and "vehicles driven by motorway" in said.out


def test_fcd_output_is_fitted(run: Path) -> None:
    assert main(["import", "fcd", str(run / "fcd.xml"), "-o", str(run / "drives.parquet"), "-q"]) == 0
    drives = xl.read_drives(run / "drives.parquet")
    assert len(drives) > 8
    assert all(np.abs(one.lane_width - 3.75).max() < 0.05 for one in drives), "as lane changes show it"
    assert all(np.isfinite(one.offset).all() for one in drives)


def test_what_is_no_good_is_said_in_a_line(run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "off").mkdir()
    plain = write_run(tmp_path / "off", sublane=0.0)
    assert main(["live", "sumo", str(plain)]) == 1
    assert "sublane model is off" in capsys.readouterr().err
    assert main(["live", "sumo", str(tmp_path / "none.sumocfg")]) == 1
    bad = "<configuration><input><net-file value='none.net.xml'/></input></configuration>"
    (tmp_path / "bad.sumocfg").write_text(bad)
    assert main(["live", "sumo", str(tmp_path / "bad.sumocfg")]) == 1
    for text, words in (
        (
            "<fcd-export><timestep time='0'><vehicle id='a' lane='e_0' pos='1' speed='2'/></timestep></fcd-export>",
            "posLat",
        ),
        ("<fcd-export><timestep time='x'/></fcd-export>", "time='x'"),
        ("<fcd-export>", "not XML"),
        (
            "<fcd-export>"
            + "".join(
                f"<timestep time='{k}'><vehicle id='a' lane='e_x' pos='1' posLat='0' speed='2'/></timestep>"
                for k in "01"
            )
            + "</fcd-export>",
            r"fcd\.xml: can't be imported: .*'x'",
        ),
    ):
        (tmp_path / "fcd.xml").write_text(text)
        with pytest.raises(FormatError, match=words):
            xl.import_drives("fcd", tmp_path / "fcd.xml")
    assert issubclass(SimulationError, xl.XoscLateralError)
