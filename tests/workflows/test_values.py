"""Results are values: each is copied and pickled, says the same afterwards, and has a table with units and files."""

from __future__ import annotations

import copy
import pickle
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import xosc_lateral as xl
from tests.extras.recordings.test_reconstruct import ROAD
from tests.kit.jam import jam
from tests.kit.sumo_run import write_run
from xosc_lateral.workflows.profiles.profiles import find_uses
from xosc_lateral.workflows.result import Result


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario, drives, a recording with its road."""
    folder = tmp_path_factory.mktemp("values")
    xl.write_template("cut-in", folder)
    made = xl.sample("motorway", duration=240.0, speed=30.0, seed=1).to_frame()
    made.assign(lane_width=3.6, speed=30.0).to_csv(folder / "drive.csv", index=False)
    jam(1, 0.0, vehicles=6, lasting=60.0)[0].to_csv(folder / "rec.csv", index=False)
    (folder / "road.xodr").write_text(ROAD)
    return folder


RESULTS: dict[str, Callable[[Path], Result]] = {
    "play": lambda at: xl.play(at / "cut-in.xosc", time_limit=3.0),
    "segments": lambda at: xl.segments(at / "cut-in.xosc", time_limit=3.0),
    "convert": lambda at: xl.convert((at / "cut-in.xosc").read_bytes(), road=at / "cut-in.xodr", time_limit=3.0),
    "convert to a file": lambda at: xl.convert(at / "cut-in.xosc", at / "made.xosc", time_limit=3.0, force=True),
    "convert_many": lambda at: xl.convert_many(at / "cut-in.xosc", at / "out", time_limit=3.0, show="nothing"),
    "verify": lambda at: xl.verify(xl.convert(at / "cut-in.xosc", at / "v.xosc", time_limit=3.0, force=True).output),
    "vary": lambda at: xl.vary(at / "cut-in.xosc", at / "varied", like="motorway", count=1, force=True),
    "sample": lambda at: xl.sample("rural", duration=20.0),
    "sample like": lambda at: xl.sample("rural", like=at / "drive.csv"),
    "evaluate": lambda at: xl.evaluate("rural", at / "drive.csv", classify=False),
    "check": lambda at: xl.check(at / "drive.csv"),
    "check of a frame": lambda at: xl.check(pd.read_csv(at / "drive.csv")),
    "list_profiles": lambda at: xl.list_profiles(),
    "compare_profiles": lambda at: xl.compare_profiles("rural", "motorway-vehicle-1"),
    "import": lambda at: xl.import_drives("tracks", at / "rec.csv", road=at / "road.xodr"),
    "reconstruct": lambda at: xl.reconstruct(at / "rec.csv", road=at / "road.xodr"),
    "detect": lambda at: xl.detect(at / "drive.csv", detectors="lateral-speed"),
    "sight": lambda at: xl.detect(at / "rec.csv", road=at / "road.xodr", sight=True),
    "cut-ins": lambda at: xl.detect(at / "cut-in.xosc", like="motorway", count=2),
    "plan_loop": lambda at: xl.plan_loop(at / "drive.csv"),
    "close_loop": lambda at: xl.close_loop(at / "drive.csv", seed=1),
    "profile uses": lambda at: find_uses("motorway", RESULTS["convert_many"](at).folder),
    "dossier": lambda at: xl.dossier("motorway"),
    "live run": lambda at: live(at),
}


def live(at: Path) -> Result:
    """A run of SUMO, where it is installed."""
    for module in ("libsumo", "sumo"):
        pytest.importorskip(module, reason="the extra sumo is not installed")
    return xl.live_sumo(write_run(at, end=5.0, cars=1800), seed=1)


@pytest.mark.pages
@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_a_value(name: str, inputs: Path, tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        result: Any = RESULTS[name](inputs)
    frame = result.to_frame()
    for again in (copy.copy(result), copy.deepcopy(result), pickle.loads(pickle.dumps(result))):
        assert str(again) == str(result) and again.to_dict() == result.to_dict()
        pd.testing.assert_frame_equal(again.to_frame(), frame)
    assert all(
        str(column).isidentifier() or "=" in str(column) for column in frame.columns if name != "compare_profiles"
    )
    assert set(frame.attrs["units"]) <= set(frame.columns)
    assert {"time", "offset", "start"} & set(frame.columns) <= set(frame.attrs["units"])
    shown = result._repr_html_()
    assert shown.startswith("<pre>") and ("<svg" in shown) == (getattr(result, "plot", None) is not None)
    if name != "reconstruct":  # which writes a scenario
        assert len(pd.read_parquet(result.write(tmp_path / "table.parquet"))) == len(frame)
