"""The whole loop on a simulated drive: named, sized, added, and better on blocks that it did not fit."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.simulators import plants
from tests.simulators.driver_simulator import simulate_drive
from xosc_lateral.cli import main
from xosc_lateral.driver.effects import Linear
from xosc_lateral.driver.fitting import fit_profile
from xosc_lateral.driver.series import Drive
from xosc_lateral.errors import NotEnoughDataError
from xosc_lateral.loop.close import close_loop

Driven = Callable[..., list[Drive]]


def test_a_truck_effect_is_sized_within_its_uncertainty_and_closes_the_gap(driven: Driven) -> None:
    result = close_loop(driven(101, [plants.TruckAvoidance(0.3)]), seed=1)
    finding = next(finding for finding in result.findings if finding.columns == ("truck_right",))
    assert abs(finding.size_m - 0.3) < 3 * finding.size_error + 0.05  # a driver gets to his target in part only
    assert finding.error_after < 0.5 * finding.error_before
    assert result.error_after < result.error_before
    assert any(isinstance(effect, Linear) and effect.column == "truck_right" for effect in result.refined.effects)


def test_a_two_level_base_is_told_that_it_lacks_memory(driven: Driven) -> None:
    drives = driven(102, duration=1500.0)
    base = fit_profile(drives, name="paper", model="two-level")
    result = close_loop(drives, base, seed=1)
    memory = [finding for finding in result.findings if finding.kind == "memory"]
    assert len(memory) == 1
    assert result.refined.model.kind != base.model.kind
    assert memory[0].error_after < memory[0].error_before


def test_a_refined_profile_is_not_refined_again(driven: Driven) -> None:
    drives = driven(101, [plants.TruckAvoidance(0.3)])
    refined = close_loop(drives, seed=1).refined
    again = close_loop(drives, refined, seed=2)
    assert not any(finding.columns == ("truck_right",) for finding in again.findings)
    assert any(effect.columns == ("truck_right",) for effect in again.refined.effects)


def test_too_short_a_drive_is_refused(driven: Driven) -> None:
    with pytest.raises(NotEnoughDataError, match="needs 120 s"):
        close_loop(driven(1, duration=100.0), seed=1)


def test_the_verb_writes_profile_and_reports_and_repeats_itself(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "drive.csv.gz"
    simulate_drive(900.0, 7, effects=[plants.TruckAvoidance(0.5)]).table.to_csv(table, index=False)
    texts = []
    for name in ("one", "two"):
        output, report = tmp_path / f"{name}.json", tmp_path / name
        assert main(["close-loop", str(table), "-o", str(output), "--report", str(report), "--seed", "3"]) == 0
        texts.append((output.read_text().replace(name, ""), (report / "report.json").read_text().replace(name, "")))
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
    one, two = (json.loads(text[1]) for text in texts)
    assert one["findings"] == two["findings"]
    assert one["error"] == two["error"]
