"""The plug-in of examples/ is installed as a user would, and used: an effect, an importer, a template, a profile."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from examples.driver_simulator import simulate_drive

PLUGIN = Path(__file__).resolve().parents[1] / "examples" / "plugin"

LOOP = """
import sys
import numpy as np
import pandas as pd
import xosc_lateral as xl
from tests.kit.fits import coarse_fits
from xosc_lateral.drivers.model.effects import Acts
from xosc_lateral_acme.ripple import Ripple

table = pd.read_csv(sys.argv[1])
with coarse_fits():
    loop = xl.close_loop(table, seed=1, name="found")
xl.write_profile(loop.profile, "found.json")
again = xl.read_profile("found.json")
print([effect.kind for effect in again.effects], [effect.columns for effect in again.effects])
assert again.to_dict() == loop.profile.to_dict()

known = {"coefficients": (0.3,), "errors": (0.0,), "reference": (0.0,)}
effect = Ripple(column="wind_speed", period=5.0, acts=Acts.LOCATION, **known)
base = xl.read_profile("motorway")
windy = base.with_effects(effect, name="windy")
xl.write_profile(windy, "windy.json")
assert xl.read_profile("windy.json").effects == (*base.effects, effect)
time = np.arange(0.0, 60.0, 0.04)
drive = pd.DataFrame({"time": time, "offset": 0.0 * time, "lane_width": 3.5, "speed": 30.0})
shift = [
    xl.sample(one, context=drive.assign(wind_speed=10.0), seed=4).to_frame()["offset"]
    for one in ("motorway", "windy.json")
]
np.testing.assert_allclose(shift[1] - shift[0], 0.3, atol=1e-9)
print("stored and read back")
"""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the plug-in installed in it, beside this package."""
    pytest.importorskip("hatchling", reason="needs the build backend of the extra `dev`")
    folder = tmp_path_factory.mktemp("site")
    install = ["install", "--quiet", "--no-deps", "--no-build-isolation", "--disable-pip-version-check"]
    command = [sys.executable, "-m", "pip", *install, "--target", str(folder), str(PLUGIN)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder


def run(site: Path, cwd: Path, *words: str) -> str:
    paths = [str(site), str(PLUGIN.parents[1])]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONWARNINGS": "ignore"}
    command = [sys.executable, *words]
    done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.mark.pages
def test_an_importer_is_a_verb_of_import(site, tmp_path):
    log = tmp_path / "anna.log"
    time = np.arange(0.0, 30.0, 0.04)
    log.write_text("".join(f"{t:.2f} {170 + 20 * np.sin(t):.1f} {180 - 20 * np.sin(t):.1f} 108\n" for t in time))
    assert "acme-log" in run(site, tmp_path, "-m", "xosc_lateral", "import", "-h")
    words = ["-m", "xosc_lateral", "import", "acme-log", "anna.log", "-o", "anna.csv", "--set", "licence=CC0"]
    assert "licence: CC0" in run(site, tmp_path, *words)
    assert (tmp_path / "anna.csv").read_text().startswith("time,distance_left,distance_right,speed,drive\n0.0,1.7,")


def test_templates_and_profiles_are_listed_with_the_shipped_ones(site, tmp_path):
    run(site, tmp_path, "-m", "xosc_lateral", "template", "write", "acme-straight", "-o", ".", "--set", "speed=25")
    words = ["convert", "acme-straight.xosc", "-o", "out.xosc", "--profile", "acme-calm", "--ego", "none"]
    assert "profile acme-calm" in run(site, tmp_path, "-m", "xosc_lateral", *words)
    assert "acme-calm" in run(site, tmp_path, "-m", "xosc_lateral", "profiles", "list")


@pytest.mark.pages
@pytest.mark.slow
def test_an_effect_is_tried_by_the_loop_stored_in_a_profile_and_read_back(site, tmp_path):
    drive = simulate_drive(1500.0, seed=6).table.sort_values("time")
    rng, knots = np.random.default_rng(6), np.arange(0.0, 1560.0, 60.0)
    lure = np.interp(drive["time"], knots, rng.uniform(0.0, 12.0, len(knots)))  # a made-up column
    shift = 0.25 * np.cos(2.0 * np.pi / 4.0 * lure)
    drive = drive.assign(
        lure=lure, distance_left=drive["distance_left"] - shift, distance_right=drive["distance_right"] + shift
    )
    columns = ["time", "distance_left", "distance_right", "speed", "curvature", "lane_index", "lure"]
    drive[columns].to_csv(tmp_path / "drive.csv", index=False)
    (tmp_path / "loop.py").write_text(LOOP)
    said = run(site, tmp_path, "loop.py", "drive.csv")
    assert "('lure',)" in said
    assert "ripple" in said.splitlines()[0]
    assert "stored and read back" in said
