"""Every example at the end of every help runs, with small files of the names that it gives."""

from __future__ import annotations

import io
import shlex
import shutil
import sys
import zipfile
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from examples.driver_simulator import simulate_drive
from tests.kit.recordings import Case, road_file, sumo_files, write_mf4
from xosc_lateral.cli import VERBS, main, verb
from xosc_lateral.extras.dossier import measures

PROGRAM = "xosc-lateral "
NEEDED = {
    "import mf4": "asammdf", "import commonroad": "commonroad", "import osi": "osi_utilities", "--osi": "osi_utilities",
    "live sumo": "libsumo",
}  # fmt: skip
"""Words of an example -> the package of the extra that it takes."""

WORN = ("close-loop", "dossier", "vary")
"""Verbs whose own tests run them from the command line as they are, at more length."""

PLAYER = "libesminiLib.so"
"""Somebody else's program: its examples are read as far as where it would be loaded."""


def examples() -> list[str]:
    found: list[str] = []

    def walk(command: object) -> None:
        if hasattr(command, "list_commands"):
            for name in command.list_commands(None):
                walk(command.get_command(None, name))
        elif command.epilog:
            found.extend(line.strip() for line in command.epilog.splitlines() if line.strip().startswith(PROGRAM))

    for name in VERBS:
        walk(verb(name))
    return list(dict.fromkeys(found))


def run(*words: str) -> None:
    assert main([*words]) == 0, words


def drives(path: Path, seed: int, *, in_km_h: bool = False) -> None:
    table = pd.DataFrame(simulate_drive(400.0, seed).table)
    table = table.assign(v_kmh=3.6 * table["speed"]).drop(columns="speed") if in_km_h else table
    table.to_parquet(path) if path.suffix == ".parquet" else table.to_csv(path, index=False)


def _dlr_wheel(path: Path) -> None:
    from tests.extras.recordings.test_dlr_ut import write_city
    from tests.extras.recordings.test_importers import _dlr_recording

    inner, folder = io.BytesIO(), "DLR-Highway-Traffic-dataset_v1-1-0"
    with zipfile.ZipFile(inner, "w") as archive:
        text = _dlr_recording(11, per_lane=16)[0].to_csv(index=False)
        archive.writestr(f"{folder}/raw_data/trajectories/trajectories_1.csv", text)
    city = path.with_name("DLR-Urban-Traffic-dataset_v1-2-0.zip")
    write_city(city)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"tasi/dataset/data/{folder}.zip", inner.getvalue())
        archive.write(city, f"tasi/dataset/data/{city.name}")


def _highd(path: Path) -> None:
    from tests.extras.recordings.test_importers import _highd as write

    path.mkdir()
    write(path, 0.4, -0.3)


def _commonroad(path: Path) -> None:
    from tests.extras.recordings.test_importers_tracks import commonroad_scenario

    commonroad_scenario(path.parent).rename(path)


def _tracks(path: Path) -> None:
    rows = Case(rate=10.0).tracks()
    number = rows["id"].map({"car": 17, "ahead": 18, "beside": 19, "oncoming": 20})
    rows.assign(id=number, obj=number).to_csv(path, index=False)


def _log(path: Path) -> None:
    time = np.arange(0.0, 60.0, 0.04)
    write_mf4(path, {"Lane_Lat": (time, 0.1 * np.sin(time), "m"), "Lane_Width": (time, 3.5 + 0.0 * time, "m")})


def _scenario(path: Path) -> None:
    run("template", "write", "cut-in", "-o", str(path.parent))


def _trace(path: Path) -> None:
    _scenario(path.parent / "cut-in.xosc")
    run("states", "cut-in.xosc", "--osi", path.name)


def _scenarios(path: Path) -> None:
    path.mkdir()
    run("template", "write", "cut-in", "-o", str(path))


def _reconstructed(path: Path) -> None:
    _tracks(Path("tracks.csv"))
    road_file(Case(), Path()).rename("road.xodr")
    run("reconstruct", "tracks.csv", "--road", "road.xodr", "-o", "out/")


def _fitted(path: Path) -> None:
    drives(Path("fitted.parquet"), 5)
    run("fit", "fitted.parquet", "-o", path.name)


def _smoothed(path: Path) -> None:
    """A drive whose provider took out what is faster than 0.3 Hz."""
    table = simulate_drive(400.0, 6).table
    smooth = np.exp(-0.5 * (np.arange(-100, 101) * np.median(np.diff(table["time"])) / 0.6) ** 2)
    for name in ("distance_left", "distance_right"):
        table[name] = np.convolve(np.pad(table[name], 100, mode="edge"), smooth / smooth.sum(), mode="valid")
    pd.DataFrame(table).to_csv(path, index=False)


def _openacc(path: Path) -> None:
    from tests.extras.recordings.test_openacc import platoon

    platoon(path, phase=len(path.name))


def _library(path: Path) -> None:
    _fitted(Path("mine.json"))
    run("profiles", "add", "mine.json", "--library", "team/", "--tag", "day")


def _converted(path: Path) -> None:
    _scenario(Path("cut-in.xosc"))
    run("convert", "cut-in.xosc", "-o", path.name, "--seed", "1", "--time-limit", "8")


def _batch(path: Path) -> None:
    _scenarios(Path("scenarios"))
    run("convert", "scenarios/", "-o", str(path), "--time-limit", "8")


def _varied(path: Path) -> None:
    _scenario(Path("cut-in.xosc"))
    run("vary", "cut-in.xosc", "--like", "motorway", "-n", "2", "-o", "varied/")


def _sumo_run(path: Path) -> None:
    from tests.kit.sumo_run import write_run

    write_run(path.parent, end=5.0)


def _detector(path: Path) -> None:
    """One that never sees anything."""
    text = "import sys\nfor line in sys.stdin:\n    print('{\"vehicles\": {}}', flush=True)\n"
    path.with_name("mine.py").write_text(text)


MADE: dict[str, Callable[[Path], object]] = {
    "cut-in.xosc": _scenario, "scenarios/": _scenarios, "lifelike.xosc": _converted, "cut-in_lifelike.xosc": _converted,
    "enriched/": _batch, "tasi-0.15.4-py3-none-any.whl": _dlr_wheel, "highD/": _highd, "log.mf4": _log,
    "tracks.csv": _tracks, "road.xodr": lambda path: road_file(Case(), path.parent).rename(path),
    "fcd.xml": lambda path: sumo_files(Case(rate=10.0), path.parent), "DEU_A9-1_1_T-1.xml": _commonroad,
    "cut-in_gt.mcap": _trace, "a.mcap": _trace, "b.mcap": _trace, "out/drivers.csv": _reconstructed,
    "drives.csv.gz": lambda path: drives(path, 1), "drives.parquet": lambda path: drives(path, 2),
    "monday.csv": lambda path: drives(path, 3, in_km_h=True),
    "tuesday.csv": lambda path: drives(path, 4, in_km_h=True),
    "*.csv": lambda path: drives(path.with_name("monday.csv"), 3, in_km_h=True),
    "company.toml": lambda path: path.write_text('[columns]\nspeed = "v_kmh:km/h"'), "mine.json": _fitted,
    "team/": _library, "run.sumocfg": _sumo_run, "recording.csv": _tracks, "python mine.py": _detector,
    "smoothed.csv": _smoothed, "out/": _batch,
    "ours.toml": lambda path: path.write_text('[[claim]]\nid = "ours"\nabout = "folder"\nwords = "Ours."\n'),
    "varied/cut-in-like-motorway.xosc": _varied,
    **dict.fromkeys(["ASta_040719_platoon3.csv", "ASta_050719_platoon1.csv"], _openacc),
    "motorway.xodr": lambda path: road_file(Case(), path.parent).rename(path),
}  # fmt: skip
"""Files that examples read -> how they are made; the first words of an example are no output."""


def with_tiers() -> list[Any]:
    """The first example of every verb is a smoke test of `make test`; all others are run by `make pages`."""
    verbs = [line.split()[1] for line in examples()]
    return [
        pytest.param(line, marks=[] if verbs.index(name) == k and name not in WORN else [pytest.mark.pages])
        for k, (line, name) in enumerate(zip(examples(), verbs, strict=True))
    ]


@pytest.mark.pages
@pytest.mark.parametrize("line", with_tiers())
def test_an_example_of_a_help_runs(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    for words, package in NEEDED.items():
        if words in line and find_spec(package) is None:
            pytest.skip(f"{package} is not installed")
    monkeypatch.chdir(tmp_path)
    text, _, file = line.removeprefix(PROGRAM).partition(" | ")[0].partition(" > ")
    words = shlex.split(text)
    read = [
        word for k, word in enumerate(words) if k == 0 or words[k - 1] not in ("-o", "--report", "--states", "--osi")
    ]
    for word in read:
        if word in MADE and not (tmp_path / word).exists() and words[:2] != ["profiles", "add"]:
            MADE[word](tmp_path / word)
    if words[:2] == ["profiles", "add"]:
        _fitted(tmp_path / "mine.json")
    if PLAYER in line:
        (tmp_path / PLAYER).touch()
        verb("live").commands["esmini"].make_context("esmini", words[2:])
        return
    if words[0] == "dossier":  # one template, once: `tests/extras/dossier/test_dossier.py` looks at what is measured
        for name, few in (("TEMPLATES", ("cut-in",)), ("SEEDS", (1,)), ("DETECTED_VARIANTS", 1)):
            monkeypatch.setattr(measures, name, few)
    if words[:2] == ["live", "stdio"]:
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b'{"time": 0, "vehicles": {}}\n')))
    words = [name for word in words for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]
    capsys.readouterr()
    assert main(words) == 0, capsys.readouterr().err
    if file:
        assert capsys.readouterr().out
    for k, word in enumerate(words):
        if word in ("-o", "--report", "--states", "--osi") and words[k + 1] != "-":
            there = Path(words[k + 1])
            assert there.exists() or list(there.parent.glob(f"{there.stem}*")), word
    shutil.rmtree(tmp_path)


def test_no_verb_is_without_an_example() -> None:
    assert len(examples()) >= 45
