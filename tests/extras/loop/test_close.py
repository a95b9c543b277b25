"""The whole loop on a simulated drive: named, sized, added, and better on blocks that it did not fit."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from examples.driver_simulator.simulator import Driver, simulate_drive
from tests.extras.loop.conftest import driver_in
from tests.kit import simulated as plants
from tests.kit import truth
from tests.kit.simulated.movements import ornstein_uhlenbeck, record_movement
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.cli import main
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.drivers.model.effects import Linear, Product
from xosc_lateral.drivers.model.effects.ends import ends_of
from xosc_lateral.extras.loop.close import NO_WORSE, Finding, LoopResult, close_loop
from xosc_lateral.extras.loop.loop_report import loop_record
from xosc_lateral.files.drives import read_drives

pytestmark = pytest.mark.pages

Driven = Callable[..., list[Drive]]

NEAR = 1.4
"""Error that is left over the floor, at most; below 1 where chance is kind. [-]"""

IDLE = ("wind_speed", "wind_direction", "rain", "illuminance", "air_temperature", "car_left", "lead_distance")
"""Left out where another column acts, or none: among all of them curvature is chosen, as in README's walk."""


def only_finding(result: LoopResult, kind: str, columns: tuple[str, ...]) -> Finding:
    (finding,) = [found for found in result.findings if found.kind == kind and set(found.columns) == set(columns)]
    return finding


def assert_closed(result: LoopResult, finding: Finding, size: float) -> None:
    """Named, sized within three of its own standard errors, and better where it was not fitted."""
    assert abs(finding.size_m - size) < 3.0 * finding.size_error
    assert finding.error_after < 0.85 * finding.error_before  # over everything; of a weave, what is not periodic stays
    assert result.error_after < result.error_before
    assert result.error_after < NEAR * result.floor


def test_curve_cutting_is_sized_and_seen_to_be_ahead_of_the_curve(driven: Driven) -> None:
    plant = plants.curve_cutting(0.5, look_ahead=2.5)
    result = close_loop(driven(503, [plant], 2400.0), seed=1)
    finding = only_finding(result, "location", ("curvature",))
    assert_closed(result, finding, plant.size * truth.shift(truth.paired(plant, 503, 2400.0)))
    assert finding.lag_s is not None
    assert -4.0 < finding.lag_s < -1.5  # the driver's target changes over 2.4 s, half of which is ahead of the plant's


def test_wind_is_sized_as_the_product_that_it_is(driven: Driven) -> None:
    plant = plants.SideWind(0.5)
    idle = [name for name in IDLE if name not in plant.columns]
    drives = driven(502, [plant], 2400.0, drop=idle)
    result = close_loop(drives, seed=1)
    finding = only_finding(result, "location", plant.columns)
    (product,) = finding.effects
    ends = ends_of(product)
    assert ends is not None

    def cross(wind: Mapping[str, float | np.ndarray]) -> np.ndarray:
        return np.asarray(wind["wind_speed"] * np.sin(np.radians(wind["wind_direction"])))

    whole = np.ptp(np.quantile(cross(drives[0].context), [0.05, 0.95]))  # for which the target moves by its size
    planted = plant.size * float(cross(ends.high) - cross(ends.low)) / whole
    assert_closed(result, finding, planted * truth.shift(truth.paired(plant, 502, 2400.0)))
    assert any(isinstance(effect, Product) for effect in finding.effects)


def test_a_spread_by_a_column_is_sized_and_closes_the_gap(tmp_path: Path) -> None:
    table, factor = record_movement(ornstein_uhlenbeck, 3000.0, 503).drop(columns=[*IDLE]), 2.0
    grade, offset = table["grade"], 0.5 * (table["distance_right"] - table["distance_left"])
    offset -= offset.median()
    strength = (grade - grade.median()) / (grade.quantile(0.95) - grade.quantile(0.05))
    shift = offset * (factor**strength - 1.0)
    path = tmp_path / "drive.parquet"
    table.assign(
        distance_left=table["distance_left"] - shift, distance_right=table["distance_right"] + shift
    ).to_parquet(path)
    result = close_loop(read_drives([path]), seed=1)
    finding = only_finding(result, "scale", ("grade",))
    shape = 0.1  # a ramp and a line that fit alike differ by so much at the ends, in log units
    assert abs(np.log(finding.size_m / factor)) < 3.0 * np.hypot(finding.size_error / finding.size_m, shape)
    assert finding.error_after < 0.75 * finding.error_before
    assert result.error_after < min(result.error_before, NEAR * result.floor)


def test_a_weave_is_sized_at_its_period(driven: Driven) -> None:
    plant = plants.CyclicTarget(0.2, 12.0)
    result = close_loop(driven(502, [plant], 1500.0, drop=IDLE), seed=1)
    finding = only_finding(result, "periodic", ())
    assert_closed(result, finding, truth.swing(truth.paired(plant, 502, 1500.0), plant.period))
    assert finding.shape == "period 12.0 s"


def test_growing_spread_is_named_and_helps(driven: Driven) -> None:
    result = close_loop(driven(502, [plants.Fatigue(3.0)], 2400.0, drop=IDLE, driver=Driver()), seed=1)
    finding = only_finding(result, "scale", ())
    # what is planted triples from the beginning to the end; forty minutes hold some thirty independent stretches
    assert abs(np.log(finding.size_m / 3.0)) < 3.0 * np.hypot(finding.size_error / finding.size_m, 0.15)
    assert finding.error_after < 0.9 * finding.error_before
    assert result.error_after < (NO_WORSE + 0.02) * result.error_before  # coarse fits move spreads by 2 %


def test_a_step_is_sized(driven: Driven) -> None:
    result = close_loop(driven(503, [plants.CameraStep(0.6)], 2400.0, drop=IDLE), seed=1)
    assert_closed(result, only_finding(result, "step", ()), 0.6)


@pytest.mark.parametrize("apart", [0.35, 0.0], ids=["many", "one"])
def test_drivers_that_differ_are_told_from_one_driver(tmp_path: Path, apart: float) -> None:
    path = tmp_path / "drives.parquet"
    people = [Driver(bias=bias) for bias in np.linspace(-apart, apart, 10)]
    tables = [simulate_drive(240.0, 600 + k, driver=driver).table.assign(drive=k) for k, driver in enumerate(people)]
    pd.concat(tables, ignore_index=True).to_parquet(path)
    drives = read_drives([path])
    result = close_loop(drives, fit_profile(drives, name="one for all", model="two-level"), seed=1)
    found = [finding for finding in result.findings if finding.kind == "population"]
    assert len(found) == (1 if apart else 0)
    if apart:
        scatter = float(np.std([person.bias for person in people], ddof=1))
        assert found[0].size_m == pytest.approx(scatter, abs=3.0 * found[0].size_error)


def test_what_a_missing_column_did_is_reported_as_unexplained_or_as_hidden(driven: Driven) -> None:
    drives = driven(303, [plants.truck_avoidance(1.2)], 2400.0, drop=["truck_right"])
    result = close_loop(drives, seed=1)
    assert not any(finding.kind == "location" for finding in result.findings)
    beyond = max(result.error_after**2 - result.floor**2, 0.0) ** 0.5
    assert beyond > 0.01 or any(not finding.columns for finding in result.findings)
    assert "What is not recorded cannot be named" in loop_record(result, [])["unexplained"]["sentence"]


@pytest.fixture(scope="module")
def beside_trucks(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[Drive], LoopResult]:
    """Drives of somebody who keeps away from trucks, and their closed loop."""
    drives = driver_in(tmp_path_factory.mktemp("trucks"))(101, [plants.truck_avoidance(0.3)], drop=IDLE)
    return drives, close_loop(drives, seed=1)


def test_a_truck_effect_is_sized_within_its_uncertainty_and_closes_the_gap(
    beside_trucks: tuple[list[Drive], LoopResult],
) -> None:
    _, result = beside_trucks
    finding = next(finding for finding in result.findings if finding.columns == ("truck_right",))
    assert abs(finding.size_m - 0.3) < 3 * finding.size_error + 0.05  # a driver gets to his target in part only
    assert finding.error_after < 0.5 * finding.error_before
    assert result.error_after < result.error_before
    assert any(isinstance(effect, Linear) and effect.column == "truck_right" for effect in result.refined.effects)


def test_a_refined_profile_is_not_refined_again(beside_trucks: tuple[list[Drive], LoopResult]) -> None:
    drives, first = beside_trucks
    again = close_loop(drives, first.refined, seed=2)
    assert not any(finding.columns == ("truck_right",) for finding in again.findings)
    assert any(effect.columns == ("truck_right",) for effect in again.refined.effects)


def test_a_two_level_base_is_told_that_it_lacks_memory(driven: Driven) -> None:
    drives = driven(102, duration=1500.0, drop=IDLE)
    base = fit_profile(drives, name="paper", model="two-level")
    result = close_loop(drives, base, seed=1)
    memory = [finding for finding in result.findings if finding.kind == "memory"]
    assert len(memory) == 1
    assert result.refined.model.kind != base.model.kind
    assert memory[0].error_after < memory[0].error_before


def test_too_short_a_drive_is_refused(driven: Driven) -> None:
    with pytest.raises(NotEnoughDataError, match="needs 120 s"):
        close_loop(driven(1, duration=100.0), seed=1)


def test_the_verb_writes_profile_and_reports_and_repeats_itself(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "drive.csv.gz"
    simulate_drive(900.0, 7, effects=[plants.truck_avoidance(0.5)], drop=IDLE).table.to_csv(table, index=False)
    texts = []
    for name in ("one", "two"):
        output, report = tmp_path / name / "refined.json", tmp_path / name
        report.mkdir()
        assert main(["close-loop", str(table), "-o", str(output), "--report", str(report), "--seed", "3"]) == 0
        texts.append((output.read_text(), (report / "report.json").read_text()))
        assert "<svg" in (report / "report.html").read_text()
    capsys.readouterr()
    assert texts[0][0] == texts[1][0]
    found = json.loads((tmp_path / "one" / "report.json").read_text(), parse_constant=lambda word: pytest.fail(word))
    assert set(found) >= {
        "drives",
        "base_profile",
        "held_out",
        "findings",
        "consequences",
        "rejected",
        "error",
        "metrics",
    }
    assert set(found["error"]) == {"measure", "before", "after", "floor"}
    for finding in found["findings"]:
        assert np.isfinite(
            [finding["size_m"], finding["p_value"], finding["error_before"], finding["error_after"]]
        ).all()
    assert texts[0][1] == texts[1][1]
