"""Scenarios, batches and outputs in a storage of fsspec: read and written there as in a folder."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

import xosc_lateral as xl
from xosc_lateral.cli import app

fsspec = pytest.importorskip("fsspec")

TEMPLATES = Path(__file__).resolve().parents[3] / "templates"
NAMES = ("cut-in", "curves")
BRIEFLY = {"seed": 1, "mode": "trajectory", "time_limit": 2.0}


@pytest.fixture
def store():
    """A bucket of scenarios, whose roads lie beside their folder."""
    files = fsspec.filesystem("memory")
    files.pipe(
        {
            f"/bucket/{'db' if suffix == 'xosc' else 'xodr'}/{name}.{suffix}": text
            for name in NAMES
            for suffix in ("xosc", "xodr")
            for text in [(TEMPLATES / f"{name}.{suffix}").read_bytes().replace(b'filepath="', b'filepath="../xodr/')]
        }
    )
    yield files
    files.rm("/bucket", recursive=True)


@pytest.fixture
def folder(store, tmp_path: Path) -> Path:
    """The same on a disk."""
    for name in store.find("/bucket"):
        path = tmp_path / name.lstrip("/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(store.cat(name))
    return tmp_path / "bucket"


def batch(*places: object, **options):
    return xl.convert_many(*places, workers=0, **BRIEFLY, **options)


def run(*words: str):
    return CliRunner().invoke(app, words)


def here(folder: Path) -> dict[str, object]:
    """What lies in a folder, by name."""
    found = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return comparable(found)


def there(store, place: str) -> dict[str, object]:
    return comparable({name.removeprefix(f"{place}/"): store.cat(name) for name in store.find(place)})


def comparable(files: dict[str, bytes]) -> dict[str, object]:
    """Without times, and without warnings, which name the place."""
    files.pop("timings.parquet", None)
    rows = files.pop("manifest.parquet", None)
    frame = None if rows is None else pd.read_parquet(BytesIO(rows)).drop(columns="warnings").astype(str)
    return {**files, "rows": None if frame is None else frame.to_dict("records")}


def test_one_scenario(store, folder: Path) -> None:
    bucket = "memory://bucket"
    made = xl.convert(f"{bucket}/db/cut-in.xosc", f"{bucket}/out/a.xosc", **BRIEFLY, report=f"{bucket}/a.html")
    xl.convert(folder / "db/cut-in.xosc", folder / "out/a.xosc", **BRIEFLY)
    assert store.cat("/bucket/out/a.xosc") == made.data == (folder / "out/a.xosc").read_bytes()
    assert b"../xodr/cut-in.xodr" in made.data
    assert store.cat("/bucket/a.html").startswith(b"<!DOCTYPE html>")
    store.pipe("/bucket/out/b.xosc", b"<mine/>")
    with pytest.raises(xl.FormatError, match=r"^memory://bucket/out/b.xosc: exists and was not written"):
        xl.convert(f"{bucket}/db/cut-in.xosc", f"{bucket}/out/b.xosc")
    assert store.cat("/bucket/out/b.xosc") == b"<mine/>"


def test_variations_of_a_scenario_that_lies_here(store, folder: Path) -> None:
    made = xl.vary(folder / "db/cut-in.xosc", "memory://bucket/varied", like="motorway", count=1)
    assert store.exists("/bucket/varied/cut-in.xosc") and made.distribution.name == "cut-in-like-motorway.xosc"


def test_what_is_not_there(store) -> None:
    with pytest.raises(xl.FormatError, match=r"^nowhere://a.xosc: nowhere:// is not read"):
        xl.play("nowhere://a.xosc")
    with pytest.raises(xl.FormatError, match=r"^memory://bucket/none.xosc: no file is called so"):
        xl.play("memory://bucket/none.xosc")
    store.pipe("/bucket/db/lost.xosc", store.cat("/bucket/db/curves.xosc").replace(b"curves.xodr", b"gone.xodr"))
    with pytest.raises(xl.FormatError, match=r"^memory://bucket/db/lost.xosc:\d+: .*gone.xodr"):
        xl.play("memory://bucket/db/lost.xosc")


def test_a_road_that_changed_is_read_again(store) -> None:
    before = xl.play("memory://bucket/db/curves.xosc").to_frame()
    store.pipe("/bucket/xodr/curves.xodr", store.cat("/bucket/xodr/curves.xodr").replace(b'a="3.75"', b'a="3.25"'))
    after = xl.play("memory://bucket/db/curves.xosc").to_frame()
    assert not before.equals(after)


@pytest.mark.parametrize("what", ["db", "db/*.xosc", "list.csv"])
def test_a_batch_leaves_there_what_it_leaves_on_a_disk(store, folder: Path, what: str) -> None:
    table = b"scenario,variants,seed\ndb/cut-in.xosc,2,5\ndb/curves.xosc,1,\n"
    store.pipe("/bucket/list.csv", table)
    (folder / "list.csv").write_bytes(table)
    for place in ("memory://bucket", str(folder)):
        done = batch(f"{place}/{what}", f"{place}/out", report=f"{place}/pages")
        assert done.failed == 0, done.to_frame()["error"].tolist()
        assert done.headline().startswith(f"{place}/out: ")
    assert there(store, "/bucket/out") == here(folder / "out")
    assert there(store, "/bucket/pages").keys() == here(folder / "pages").keys()
    again = batch(f"memory://bucket/{what}", "memory://bucket/out")
    assert set(again.to_frame()["state"]) == {"up to date"}


def test_parts_leave_what_one_run_leaves(store, folder: Path) -> None:
    batch(folder / "db", folder / "out", variants=2)
    for part in (2, 1, 3):
        batch("memory://bucket/db", "memory://bucket/out", variants=2, shard=f"{part}/3")
    assert not store.exists("/bucket/out/manifest.parquet")
    whole = batch("memory://bucket/db", "memory://bucket/out", variants=2)
    assert set(whole.to_frame()["state"]) == {"up to date"}
    assert there(store, "/bucket/out") == here(folder / "out")


def test_on_the_command_line(store, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    store_folder = tmp_path / "store"
    store.get("/bucket/", f"{store_folder}/", recursive=True)
    address = store_folder.as_uri()
    assert run("convert", f"{address}/db/cut-in.xosc", "-o", f"{address}/made/", "--labels").exit_code == 0
    assert sorted(path.name for path in (store_folder / "made").iterdir()) == [
        "cut-in.openlabel.json", "cut-in.xosc", "cut-in.xqar",
    ]  # fmt: skip
    assert run("convert", f"{address}/db/curves.xosc").exit_code == 0
    assert (tmp_path / "curves_lifelike.xosc").is_file()
    assert run("states", f"{address}/db/curves.xosc", "-o", "states.csv").exit_code == 0
    assert run("states", f"{address}/db/curves.xosc", "-o", f"{address}/states.csv").exit_code == 0
    assert (store_folder / "states.csv").read_bytes() == Path("states.csv").read_bytes()
    assert not (tmp_path / "file:").exists()


@pytest.mark.parametrize(
    "place", ["http://h/a.xosc", "github://o:r@/a.xosc", "sftp://h/a.xosc", "memory://a::http://h/x.xosc"]
)
def test_storages_that_are_not_named_are_refused_before_anything_is_asked(place: str, tmp_path: Path) -> None:
    """As an argument, and in a table of scenarios."""
    table = tmp_path / "table.csv"
    table.write_text(f"scenario,seed\n{place},1\n")
    for source in (place, table):
        with pytest.raises(xl.FormatError, match="is not read; s3, gs, abfs, file, memory are"):
            xl.convert_many(source, tmp_path / "out")
