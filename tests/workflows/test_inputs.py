"""What users hand in, in whatever form: the same drives, the same profile, and every input named with its hash."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import xosc_lateral as xl
from tests.kit.jam import ROAD, jam
from xosc_lateral.base.errors import FormatError, NotEnoughDataError, XoscLateralError
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.workflows.result import as_paths, given_drives, given_profile, naming

SECONDS = 40.0


def frame(offset: float = 0.1, seed: int = 1) -> pd.DataFrame:
    """Somebody who keeps a decimetre to the left and moves by two decimetres."""
    time = np.arange(0.0, SECONDS, 0.05)
    rng = np.random.default_rng(seed)
    place = offset + 0.2 * np.sin(2.0 * np.pi * time / 15.0 + rng.uniform(0.0, 6.0))
    return pd.DataFrame({"time": time, "offset": place, "lane_width": 3.5, "speed": 30.0, "grade": np.cos(time / 9.0)})


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("given") / "drive.csv"
    frame().to_csv(path, index=False)
    return path


def same(one: Drive, other: Drive) -> None:
    for name in ("time", "offset", "lane_width", "speed"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), name)
    assert one.context.keys() == other.context.keys()
    for name, values in one.context.items():
        np.testing.assert_array_equal(values, other.context[name], name)


# ---- drives ----------------------------------------------------------------------------------------------------------
def test_a_path_its_name_its_frame_and_its_drive_are_the_same_drive(table: Path) -> None:
    (drive,) = given_drives(table).drives
    for form in (str(table), [table], (str(table),), pd.read_csv(table), drive, [drive]):
        (other,) = given_drives(form).drives
        same(drive, other)


def test_a_file_is_named_with_the_hash_of_its_bytes_and_a_frame_with_one_of_its_values(table: Path) -> None:
    given = given_drives([table, frame(seed=2)])
    assert given.inputs["drive.csv"] == hashlib.sha256(table.read_bytes()).hexdigest()
    assert given.inputs["DataFrame 2"] == given_drives(frame(seed=2)).inputs["DataFrame"]
    assert given.files == (table,)
    assert given_drives(frame()).inputs.keys() == {"DataFrame"}


def test_drives_of_one_name_get_names_that_differ(table: Path) -> None:
    names = [drive.name for drive in given_drives([frame(), frame(seed=2), table]).drives]
    assert len(set(names)) == 3


def test_columns_of_other_names_and_units_are_read_as_what_they_are(table: Path) -> None:
    foreign = frame().rename(columns={"offset": "links_cm", "speed": "v"})
    foreign["links_cm"] *= 100.0
    foreign["v"] *= 3.6
    given = given_drives(foreign, {"offset": "links_cm:cm", "speed": "v:km/h"})
    (plain,) = given_drives(frame()).drives
    (drive,) = given.drives
    np.testing.assert_allclose(drive.offset, plain.offset, atol=1e-9)
    np.testing.assert_allclose(drive.speed, 30.0)


@pytest.mark.parametrize(
    ("change", "alike"),
    [
        (lambda table: table, True),
        (lambda table: table.copy(), True),
        (lambda table: table.assign(offset=table["offset"] + 1e-6), False),
        (lambda table: table.rename(columns={"grade": "slope"}), False),
        (lambda table: table.drop(columns="grade"), False),
        (lambda table: table[["offset", "time", "lane_width", "speed", "grade"]], False),
        (lambda table: table.iloc[:-1], False),
    ],
    ids=["itself", "a copy", "a micrometre", "another name", "a column less", "another order", "a row less"],
)
def test_the_hash_of_a_frame_changes_with_whatever_is_in_it(change, alike: bool) -> None:
    (hashed,), (plain,) = (given_drives(one).inputs.values() for one in (change(frame()), frame()))
    assert (hashed == plain) is alike


@pytest.mark.parametrize(("rows", "verb"), [(1, xl.read_drives), (60, lambda path: xl.fit(path, name="made"))])
def test_a_drive_that_is_too_short_is_refused_and_its_file_named(tmp_path: Path, rows: int, verb) -> None:
    """Two rows are a drive; 3 s of one are nothing to fit."""
    path = tmp_path / "short.csv"
    frame().iloc[:rows].to_csv(path, index=False)
    with pytest.raises(NotEnoughDataError, match=r"short\.csv"):
        verb(path)


def test_who_finds_too_little_is_told_the_files_three_at_most(tmp_path: Path) -> None:
    paths = [tmp_path / f"{name}.csv" for name in "abcde"]
    for number, path in enumerate(paths):
        frame(seed=number).to_csv(path, index=False)
    given = given_drives(paths)
    with pytest.raises(NotEnoughDataError, match=r"a\.csv.*b\.csv.*c\.csv and 2 more: no turn"), naming(given):
        raise NotEnoughDataError("no turn")
    with pytest.raises(NotEnoughDataError, match=r"^\S*a\.csv has no turn$"), naming(given):  # it is named already
        raise NotEnoughDataError(f"{paths[0]} has no turn")


def test_a_drive_that_came_from_nowhere_has_no_name_to_put_before_it() -> None:
    given = given_drives(given_drives(frame()).drives)
    assert (dict(given.inputs), given.files) == ({}, ())
    with pytest.raises(NotEnoughDataError, match=r"^no turn$"), naming(given):
        raise NotEnoughDataError("no turn")


FORMS = {
    "path": lambda path: path,
    "text": str,
    "list": lambda path: [path],
    "URL": lambda path: path.as_uri(),
    "pattern": lambda path: str(path.parent / "driv*.csv"),
    "folder": lambda path: path.parent / "parts",
    "folder of CSV": lambda path: path.parent / "csv",
    "bytes": lambda path: path.read_bytes(),
    "frame": pd.read_csv,
    "dict": lambda path: pd.read_csv(path).to_dict("list"),
    "Arrow": lambda path: pa.table(dict(pd.read_csv(path))),
    "lazy": lambda path: Foreign(pa.table(dict(pd.read_csv(path)))),
    "polars": lambda path: pytest.importorskip("polars", reason="polars is not installed").read_csv(path),
    "polars, lazy": lambda path: pytest.importorskip("polars", reason="polars is not installed").scan_csv(path),
    "Drive": lambda path: xl.read_drives(path)[0],
    "Drives": lambda path: xl.read_drives(path),
    "result": lambda path: xl.import_drives("table", path),
}
"""What stands for drives, made of the path of their table."""


class Foreign:
    """A lazy frame as polars has them: it is collected, and gives Arrow's stream."""

    def __init__(self, table: pa.Table) -> None:
        self.table = table

    def collect(self) -> Foreign:
        return self

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.table.__arrow_c_stream__(requested_schema)


VERBS = {
    "read_drives": lambda drives, coarse: xl.read_drives(drives),
    "check": lambda drives, coarse: xl.check(drives).read.drives,
    "sample": lambda drives, coarse: xl.sample(coarse, like=drives),
    "evaluate": lambda drives, coarse: xl.evaluate(coarse, drives, classify=False),
    "detect": lambda drives, coarse: xl.detect(drives, detectors="lateral-speed").tallies,
    "fit": lambda drives, coarse: xl.fit(drives, model="two-level"),
    "plan_loop": lambda drives, coarse: xl.plan_loop(drives),
    "import": lambda drives, coarse: xl.import_drives("table", drives),
    "close_loop": lambda drives, coarse: xl.close_loop(drives, coarse, seed=1),
    "compare_profiles": lambda drives, coarse: xl.compare_profiles(coarse, xl.fit(drives, model="two-level")),
}


@pytest.fixture(scope="module")
def long_table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("forms")
    made = xl.sample("motorway", duration=240.0, speed=30.0, seed=1).to_frame()
    made.assign(lane_width=3.6, speed=30.0).to_csv(folder / "drive.csv", index=False)
    for name in ("parts", "csv"):
        (folder / name).mkdir()
    (folder / "csv" / "drive.csv").write_bytes((folder / "drive.csv").read_bytes())
    made.assign(lane_width=3.6, speed=30.0).to_parquet(folder / "parts" / "drive.parquet")
    return folder / "drive.csv"


@pytest.mark.pages
@pytest.mark.parametrize("form", FORMS)
def test_every_verb_takes_drives_in_every_form(long_table: Path, form: str) -> None:
    coarse = xl.read_profile("rural")
    for verb, call in VERBS.items():
        assert call(FORMS[form](long_table), coarse), verb


@pytest.mark.parametrize("form", ["path", "URL", "bytes", "frame", "result"])
def test_a_recording_and_its_road_are_taken_in_every_form(tmp_path: Path, form: str) -> None:
    """And wherever drives are wanted."""
    table, _ = jam(1, 0.0, vehicles=6, lasting=60.0)
    table.to_csv(tmp_path / "rec.csv", index=False)
    (tmp_path / "road.xodr").write_text(ROAD)
    recording = FORMS["frame" if form == "result" else form](tmp_path / "rec.csv")
    road = FORMS["path" if form in ("frame", "result") else form](tmp_path / "road.xodr")
    assert len(xl.reconstruct(recording, road=road).to_frame()) == 6
    made = xl.import_drives("tracks", recording, road=road)
    drives = given_drives(recording, road=road).drives
    assert sum(map(len, drives)) == len(made.to_frame())


# ---- profiles, paths, roads ------------------------------------------------------------------------------------------
def test_a_profile_by_its_name_by_its_path_and_as_itself_is_one(tmp_path: Path) -> None:
    profile = given_profile("motorway")
    assert given_profile(profile) is profile
    path = xl.write_profile(profile, tmp_path / "copy.json")
    assert given_profile(path).to_dict() == profile.to_dict()
    assert given_profile("copy", tmp_path).to_dict() == profile.to_dict()


def test_one_path_and_several_are_a_tuple_of_paths(tmp_path: Path) -> None:
    assert as_paths("a") == as_paths(Path("a")) == as_paths(["a"]) == (Path("a"),)
    assert as_paths(()) == ()
    assert as_paths([tmp_path, "b"]) == (tmp_path, Path("b"))


def test_a_road_or_a_folder_of_roads_that_is_not_there_is_refused(tmp_path: Path) -> None:
    for road, folders in ((tmp_path / "no.xodr", ()), (None, tmp_path / "none")):
        with pytest.raises(FormatError, match="no such"):
            xl.play(tmp_path / "any.xosc", road=road, road_path=folders)


# ---- verbs that take them --------------------------------------------------------------------------------------------
def test_exactly_one_thing_says_what_offsets_are_for(table: Path) -> None:
    for words in ({}, {"like": table, "duration": 10.0}, {"context": table, "like": table}):
        with pytest.raises(ValueError, match="one of like, context and duration"):
            xl.sample("motorway", **words)


def test_the_left_hand_of_a_fit_is_the_only_thing_that_its_word_changes() -> None:
    drives = [frame(seed=seed) for seed in range(6)]
    right, left = (xl.fit(drives, name="made", model="two-level", left_hand=side) for side in (False, True))
    assert (right.left_hand, left.left_hand) == (False, True)
    assert {**right.to_dict(), "left_hand": None} == {**left.to_dict(), "left_hand": None}
    assert set(right.provenance.inputs) == {f"DataFrame {number}" for number in range(1, 7)}


def test_a_model_that_nobody_knows_is_refused_by_name() -> None:
    with pytest.raises((ValueError, XoscLateralError), match="three-level"):
        xl.fit(frame(), name="made", model="three-level")
