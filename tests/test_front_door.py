"""What `import xosc_lateral` promises: the names, that they come late, and tasks written from the docs alone."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl
from examples.driver_simulator import simulate_drive

ROOT = Path(__file__).resolve().parents[1]
DOCS = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")

TASKS = """
from pathlib import Path

import numpy as np
import pandas as pd

import xosc_lateral as xl


def convert_and_get_arrays(scenario: Path) -> dict[str, np.ndarray]:
    result = xl.convert(scenario, seed=1)
    frame = result.to_frame()
    before, after = result.smallest_gap
    assert after is None or before is None or after < 100.0
    return {str(name): rows["y"].to_numpy() for name, rows in frame.groupby("name")}


def fit_from_a_frame(table: pd.DataFrame) -> xl.DriverProfile:
    profile = xl.fit(table, name="anna", columns={"speed": "v_kmh:km/h"})
    xl.write_profile(profile, Path("profiles/"))
    return xl.read_profile("anna", library="profiles")


def sample(profile: xl.DriverProfile) -> list[float]:
    offsets = xl.sample(profile, duration=60.0, speed=30.0, seed=1)
    stream = xl.OffsetStream(profile, 1)
    return [float(offsets.to_frame()["offset"].iloc[0]), stream.step({"speed": 30.0})]


def close(table: pd.DataFrame) -> str:
    loop = xl.close_loop(table, seed=1, progress=lambda share, what: None)
    xl.write_profile(loop.profile, "refined.json")
    return f"{loop.findings}: {loop.error_before:.3f} -> {loop.error_after:.3f} m"


def batch(folder: str) -> pd.DataFrame:
    try:
        return xl.convert_many(folder, "out", workers=2, variants=3).to_frame()
    except xl.FormatError as error:
        print(error.path, error.line)
        raise
"""


@pytest.fixture(scope="module")
def drive() -> pd.DataFrame:
    return simulate_drive(400.0, seed=5).table


def test_every_public_name_is_there_documented_and_has_a_docstring():
    for name in xl.__all__:
        if name == "__version__":
            continue
        assert re.search(rf"\b{name}\b", DOCS), f"{name} is not in docs/api.md"
        assert inspect.getdoc(getattr(xl, name)), name
    with pytest.raises(AttributeError, match="nothing_such"):
        xl.nothing_such  # noqa: B018


def test_importing_loads_nothing_else():
    code = "import sys, xosc_lateral; print([name for name in sys.modules if name.startswith('xosc_lateral')])"
    bare = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(ast.literal_eval(bare.stdout)) == {
        "xosc_lateral",
        "xosc_lateral.base",
        "xosc_lateral.base.version",
    }
    heavy = {"numpy", "pandas", "typing", "lxml", "dataclasses"}
    code = f"import sys; before = set(sys.modules); import xosc_lateral; print(set(sys.modules) - before & {heavy})"
    loaded = subprocess.run([sys.executable, "-S", "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert not heavy & set(re.findall(r"'(\w+)'", loaded.stdout))


@pytest.mark.slow
def test_strict_types_hold_in_the_package_and_for_tasks_written_from_the_docs(tmp_path):
    def mypy(*words: str) -> None:
        command = [sys.executable, "-m", "mypy", *words]
        checked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert checked.returncode == 0, checked.stdout

    mypy()  # what pyproject.toml names; `make test` leaves it to this test
    (tmp_path / "tasks.py").write_text(TASKS)
    plugin = ROOT / "examples" / "plugin" / "xosc_lateral_acme"
    mypy("--strict", str(tmp_path / "tasks.py"), str(plugin))  # with what the first run remembers of the package


@pytest.mark.pages
def test_a_frame_and_its_file_give_the_same_profile(drive, tmp_path):
    drive.to_csv(tmp_path / "d.csv.gz", index=False)
    drive.to_parquet(tmp_path / "d.parquet")
    profiles = [
        xl.fit(one, name="x", source="s") for one in (drive, tmp_path / "d.csv.gz", str(tmp_path / "d.parquet"))
    ]
    first, *others = (profile.to_dict() for profile in profiles)
    for other in others:
        assert other["model"] == first["model"]
        assert other["provenance"]["hours"] == first["provenance"]["hours"]


def test_results_are_short_to_print_and_become_frames(drive, tmp_path):
    scenario, _road = xl.write_template("cut-in", tmp_path)
    played = xl.play(scenario, time_limit=2.0)
    results = [
        played,
        xl.segments(played),
        xl.convert(scenario, time_limit=5.0),
        xl.sample("motorway", duration=20.0),
        xl.list_profiles(),
        xl.list_templates(),
    ]
    for result in results:
        assert len(repr(result)) < 200 and repr(result).startswith(f"<{type(result).__name__} ")
        assert isinstance(result.to_frame(), pd.DataFrame) and len(result.to_frame())
        assert isinstance(result.to_dict(), dict)
    assert len(repr(xl.read_profile("motorway"))) < 200


def test_a_conversion_that_is_not_written_is_the_one_that_would_be(tmp_path):
    scenario, _road = xl.write_template("cut-in", tmp_path)
    before = sorted(tmp_path.iterdir())
    kept = xl.convert(scenario, seed=3, time_limit=10.0)
    assert (kept.output, sorted(tmp_path.iterdir())) == (None, before)
    written = xl.convert(scenario, tmp_path / "out.xosc", seed=3, time_limit=10.0)
    assert written.output is not None and written.output.read_bytes() == kept.data == written.data
    ego = kept.to_frame().query("name == 'Ego'")
    moved = np.hypot(ego["x"] - ego["x_nominal"], ego["y"] - ego["y_nominal"])
    np.testing.assert_allclose(moved, ego["deviation"].abs(), atol=2e-2)


def test_a_profile_goes_in_by_name_path_and_object(tmp_path):
    profile = xl.read_profile("motorway-vehicle-1")
    path = xl.write_profile(profile, tmp_path)
    same = (profile, path, str(path), "motorway-vehicle-1")
    frames = [xl.sample(one, duration=10.0, seed=2).to_frame() for one in same]
    assert all(frame.equals(frames[0]) for frame in frames)


def test_sampling_says_which_columns_it_takes_as_neutral():
    from xosc_lateral.drivers.model.effects import Acts, Linear

    fast, windy = (
        Linear(column=column, acts=Acts.LOCATION, coefficients=(0.1,), errors=(0.0,), reference=(0.0,))
        for column in ("speed", "wind_speed")
    )
    made = xl.sample(xl.read_profile("motorway-vehicle-1").with_effects(fast), duration=10.0)
    assert made.warnings == ()  # a free run has a speed
    made = xl.sample(xl.read_profile("motorway-vehicle-1").with_effects(windy), duration=10.0)
    assert made.warnings == ("a free run: wind_speed not known, left without effect",)


def test_a_column_that_tables_lack_is_said_once_and_one_that_a_drive_never_met_is_known(tmp_path):
    from xosc_lateral.drivers.model.effects import Acts, Linear, Proximity

    shape = {"acts": Acts.LOCATION, "coefficients": (-0.3,), "errors": (0.0,), "reference": (0.2,)}
    effects = Linear(column="wind_speed", **shape), Proximity(column="left_distance", scale=20.0, **shape)
    bare = xl.read_profile("motorway-vehicle-1")
    time = 0.2 * np.arange(100.0)
    drives = [
        pd.DataFrame(
            {"drive": k, "time": time, "offset": 0.1 * np.sin(time + k), "lane_width": 3.5, "left_distance": d}
        ).assign(speed=30.0)
        for k, d in enumerate((np.nan, np.inf, 12.0))
    ]
    table = pd.concat(drives)
    made, alike = (xl.sample(one, context=table, seed=1) for one in (bare.with_effects(*effects), bare))
    assert made.warnings == ("3 of 3 drives: wind_speed not known, left without effect",)
    shift = (made.to_frame()["offset"] - alike.to_frame()["offset"]).groupby(table["drive"].to_numpy()).mean()
    np.testing.assert_allclose(shift, -0.3 * (np.array([0.0, 0.0, np.exp(-12.0 / 20.0)]) - 0.2), atol=1e-9)
    other = drives[2].drop(columns="left_distance").assign(offset=0.0)
    both = xl.sample(bare.with_effects(*effects), context=[other, table], seed=1)
    assert both.warnings == (
        "drive DataFrame 1:2: left_distance not known, left without effect",
        "4 of 4 drives: wind_speed not known, left without effect",
    )
