"""Drivers from stated figures: measured by runs of their own, and refused where no driver has them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.profiles import simulated_profile
from xosc_lateral import read_profile
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.segment import Segment
from xosc_lateral.cli import main
from xosc_lateral.drivers.evaluation.lane_keeping import highway_drives
from xosc_lateral.drivers.fitting import derive as deriving
from xosc_lateral.drivers.fitting.derive import PRESETS, Asked, derive
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets


@pytest.fixture(autouse=True)
def _few_drives(monkeypatch: pytest.MonkeyPatch) -> None:
    """An eighth of the driving: errors are three times as large, and seeds are fixed."""
    monkeypatch.setattr(deriving, "DRIVE_COUNT", 30)


@pytest.fixture(scope="module")
def base() -> DriverProfile:
    return read_profile("motorway-vehicle-1")


def _hours(profile: DriverProfile, seed: int, count: int = 20) -> np.ndarray:
    """By the sampler alone, whatever `derive` measures with."""
    segment = Segment.even(3600.0, 0.2, profile.lane_width, 95.0 / 3.6)
    return np.array([sample_offsets(profile, segment, seed + k) for k in range(count)])


def test_sdlp_mean_and_restlessness_are_those_of_the_offsets(base: DriverProfile) -> None:
    made = derive(base, Asked(sdlp=0.24, mean=-0.2, restlessness=0.06), "x").profile
    drives = _hours(made, 900)
    assert np.sqrt(drives.var(axis=1).mean()) == pytest.approx(0.24, rel=0.03)
    assert drives.mean() == pytest.approx(-0.2, abs=0.01)
    assert np.sqrt((np.diff(drives, axis=1) ** 2).mean()) / 0.2 == pytest.approx(0.06, rel=0.03)


@pytest.mark.pages
def test_share_near_a_line_counts_the_vehicles_sides(base: DriverProfile, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(deriving, "DRIVE_COUNT", 120)  # a share of rare rows needs more of them
    made = derive(base, Asked(near_line=0.04), "x").profile
    limit = 0.5 * base.lane_width - 0.9 - 0.2
    assert (np.abs(_hours(made, 70, 40)) > limit).mean() == pytest.approx(0.04, rel=0.06)


def test_most_of_the_time_near_a_line_with_little_movement_is_had_beside_it(base: DriverProfile) -> None:
    made = derive(base, Asked(near_line=0.9, sdlp=0.1), "x")
    limit = 0.5 * base.lane_width - 0.9 - 0.2
    assert abs(made.reached.mean) > limit and made.reached.sdlp == pytest.approx(0.1, rel=0.02)
    side = "left" if made.reached.mean > 0 else "right"
    assert f"for which he drives {abs(made.reached.mean):.2f} m {side} of the lane's middle" in str(made)


@pytest.mark.pages
def test_a_memory_slows_the_movement_down(base: DriverProfile) -> None:
    known = derive(base, Asked(), "x").reached
    made = derive(base, Asked(memory=1.3 * known.memory, sdlp=known.sdlp), "x")
    assert made.reached.memory == pytest.approx(1.3 * known.memory, rel=0.02)
    assert made.reached.restlessness < 0.85 * known.restlessness


@pytest.mark.pages
@pytest.mark.parametrize("model", ["two-level", "autoregressive"])
def test_any_model_can_be_another_driver(model: str) -> None:
    profile = simulated_profile(model)
    known = derive(profile, Asked(), "x").reached
    made = derive(profile, Asked(sdlp=0.8 * known.sdlp, restlessness=0.7 * known.restlessness), "x").reached
    assert (made.sdlp, made.restlessness) == pytest.approx((0.8 * known.sdlp, 0.7 * known.restlessness), rel=0.02)


def test_of_a_population_the_typical_driver_is_taken_and_a_truck_is_what_it_knows_of_trucks() -> None:
    population = read_profile("motorway")
    truck, car = (derive(population, Asked(vehicle=which), "x") for which in ("truck", None))
    assert not any("is_truck" in effect.columns for effect in truck.profile.effects)
    assert truck.reached.mean - car.reached.mean == pytest.approx(-0.098 * (1.0 - 0.25), abs=0.02)
    assert truck.reached.sdlp < car.reached.sdlp
    means = highway_drives(car.profile, 0, drives=20).mean(axis=1)
    assert means.std() / 20**0.5 < 0.005, "one driver's means differ by chance alone"


@pytest.mark.pages
@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"sdlp": 0.0}, "above 0"),
        ({"sdlp": 0.9}, "out of its lane|times as large"),
        ({"mean": 1.9}, "out of its lane"),
        ({"sdlp": 0.16, "restlessness": 1.5}, "times as (large|quick)|no car could drive"),
        ({"sdlp": 0.2, "memory": 4.5, "restlessness": 0.005}, "can't be had"),
        ({"sdlp": 0.16, "mean": 0.0, "near_line": 0.3}, "together"),
        ({"near_line": 1.5}, "below 1"),
        ({"memory": 200.0}, "times as quick"),
        ({"speed": 5.0}, "11.1 m/s"),
        ({"vehicle": "truck"}, "no effect of is_truck"),
        ({"sdlp_change": -0.3}, "smaller"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(base: DriverProfile, asked: dict[str, float], words: str) -> None:
    with pytest.raises(DriverProfileError, match=words):
        derive(base, Asked(**asked), "x")  # type: ignore[arg-type]


@pytest.mark.pages
def test_the_file_says_of_what_it_is_made_and_converts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "tired.json"
    assert main(["profiles", "derive", "motorway-vehicle-1", "--preset", "drowsy", "-o", str(path)]) == 0
    made = read_profile(path)
    known = made.provenance.fit
    base = derive(read_profile("motorway-vehicle-1"), Asked(), "x").reached
    assert made.name == "tired"
    assert known["derived_from"] == "motorway-vehicle-1"
    assert known["preset"]["doi"] == "10.1371/journal.pone.0117045"
    assert known["reached"]["sdlp"] == pytest.approx(base.sdlp + 0.031, rel=0.02)
    assert "derived" in made.metadata.tags
    again = tmp_path / "again.json"
    main(["profiles", "derive", "motorway-vehicle-1", "--preset", "drowsy", "-o", str(again), "--name", "tired"])
    assert again.read_bytes() == path.read_bytes()
    capsys.readouterr()
    assert main(["profiles", "derive", "--preset", "sober", "-o", str(again)]) == 1
    assert "drowsy" in capsys.readouterr().err


def test_every_preset_has_a_source_that_can_be_opened() -> None:
    assert all(preset.source and preset.doi.startswith("10.") for preset in PRESETS)
    assert len({preset.name for preset in PRESETS}) == len(PRESETS)
