"""Where outputs go and what they may replace: our own files, never an input, nor somebody else's without force."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pandas as pd
import pytest

import xosc_lateral as xl
from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.output_paths import claim, is_folder, is_own, output_file, output_folder, template_mark
from xosc_lateral.files.source import file_hash

SUFFIXES = (".csv", ".csv.gz", ".parquet")


# ---- paths -----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("given", ["out/", "there"])
def test_a_folder_means_the_usual_name_in_it(tmp_path: Path, given: str) -> None:
    (tmp_path / "there").mkdir()
    output = f"{tmp_path}/{given}"
    assert is_folder(output)
    assert output_file(output, "usual.csv", SUFFIXES) == Path(output) / "usual.csv"
    assert output_folder(output) == Path(output)


@pytest.mark.parametrize("name", ["a.csv", "a.CSV", "a.csv.gz", "a.b.parquet"])
def test_a_name_with_a_known_ending_is_taken_as_it_is(tmp_path: Path, name: str) -> None:
    assert output_file(tmp_path / name, "usual.csv", SUFFIXES) == tmp_path / name
    assert not is_folder(tmp_path / name)


@pytest.mark.parametrize(("name", "told"), [("a.xlsx", r"\.xlsx"), ("a", "without suffix"), ("a.gz", r"\.gz")])
def test_another_ending_is_refused_with_those_that_can_be_written(tmp_path: Path, name: str, told: str) -> None:
    with pytest.raises(FormatError, match=rf"{told}.*\.csv or \.csv\.gz or \.parquet"):
        output_file(tmp_path / name, "usual.csv", SUFFIXES)


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "a").write_text("")
    with pytest.raises(FormatError, match="expected a folder"):
        output_folder(tmp_path / "a")


# ---- what may be replaced --------------------------------------------------------------------------------------------
FOREIGN = {
    "theirs.xosc": b"<OpenSCENARIO/>",
    "theirs.xodr": b"<OpenDRIVE/>",
    "theirs.json": b'{"package": "another-package 1.0"}',
    "list.json": b"[1, 2]",
    "broken.json": b'{"package": "xosc-lateral',
    "deep.json": b"[" * 100_000,
    "theirs.csv": b"time,offset\n0,0.1\n",
    "theirs.html": b"<html></html>",
    "theirs.txt": b"notes",
}


@pytest.mark.parametrize("name", FOREIGN)
def test_what_somebody_else_wrote_is_replaced_by_force_only(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(FOREIGN[name])
    assert not is_own(path)
    with pytest.raises(FormatError, match="was not written by xosc-lateral; --force replaces it"):
        claim([path])
    claim([path], force=True)
    claim([None, tmp_path / "new.csv"])


@pytest.fixture(scope="module")
def ours(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """One file of every kind that this package writes."""
    folder = tmp_path_factory.mktemp("ours")
    scenario, road = xl.write_template("cut-in", folder)
    found = {"template": scenario, "template's road": road}
    played, offsets = xl.play(scenario, time_limit=2.0), xl.sample("motorway", duration=20.0, seed=1)
    for suffix in ("csv", "csv.gz", "parquet"):
        found[f"played {suffix}"] = played.write(folder / f"played.{suffix}")
        found[f"offsets {suffix}"] = offsets.write(folder / f"offsets.{suffix}")
    found["view"] = played.write_page(folder / "view.html")
    found["profile"] = xl.write_profile(xl.read_profile("motorway"), folder / "mine.json")
    found["converted"] = folder / "converted.xosc"
    xl.convert(scenario, found["converted"], seed=1, time_limit=2.0)
    return found


KINDS = [
    "template",
    "template's road",
    *(f"{what} {suffix}" for what in ("played", "offsets") for suffix in ("csv", "csv.gz", "parquet")),
    "view",
    "profile",
    "converted",
]


@pytest.mark.parametrize("kind", KINDS)
def test_what_this_package_wrote_it_may_replace_unless_it_is_an_input(ours: dict[str, Path], kind: str) -> None:
    path = ours[kind]
    assert is_own(path)
    claim([path])
    with pytest.raises(FormatError, match="input"):
        claim([path], [path], force=True)


def test_an_edited_template_and_an_edited_table_are_their_editors(ours: dict[str, Path], tmp_path: Path) -> None:
    scenario = tmp_path / "edited.xosc"
    scenario.write_bytes(ours["template"].read_bytes().replace(b"author=", b"author =", 1))
    assert not is_own(scenario)
    for name in ("offsets.csv", "offsets.csv.json"):
        (tmp_path / name).write_bytes((ours["offsets csv"].parent / name).read_bytes())
    table = tmp_path / "offsets.csv"
    assert is_own(table)
    rows = pd.read_csv(table)
    rows["offset"] += 0.1
    rows.to_csv(table, index=False)
    assert not is_own(table)


def test_a_table_is_ours_by_the_hash_beside_it(tmp_path: Path) -> None:
    table, beside = tmp_path / "t.csv.gz", tmp_path / "t.csv.gz.json"
    table.write_bytes(gzip.compress(b"time\n0\n"))
    for values, own in (
        ({"package": "xosc-lateral 0.1", "sha256": file_hash(table)}, True),
        ({"package": "xosc-lateral 0.1", "sha256": "0" * 64}, False),
        ({"package": "other 0.1", "sha256": file_hash(table)}, False),
        ([], False),
    ):
        beside.write_text(json.dumps(values))
        assert is_own(table) is own


def test_an_empty_file_is_nobodys(tmp_path: Path) -> None:
    for name in ("a.xosc", "a.csv", "a.parquet"):
        (tmp_path / name).touch()
        assert is_own(tmp_path / name)


def test_the_mark_of_a_template_holds_whatever_white_space_ends_the_text(tmp_path: Path) -> None:
    text = "<OpenDRIVE/>"
    for end in ("", "\n", "\n\n  "):
        path = tmp_path / "t.xodr"
        path.write_text((text + end).rstrip() + "\n" + template_mark(text + end))
        assert is_own(path)
        path.write_text("<OpenDRIVE />\n" + template_mark(text))
        assert not is_own(path)
