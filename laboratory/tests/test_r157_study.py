"""The R157 study runs, and comes to the same figures again."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
def test_the_study_runs_in_one_command(shared: Path, tmp_path: Path) -> None:
    scenarios = shared / "corpus" / "alks" / "logical_scenarios" / "concrete_scenarios"
    words = [sys.executable, "-m", "laboratory.r157.study", str(scenarios), str(tmp_path / "out"), "--seeds", "2"]
    words += ["--only", "4_4_1", "4_1_3"]
    subprocess.run(words, check=True, capture_output=True, text=True, cwd=CHECKOUT)
    record = json.loads((tmp_path / "out" / "study.json").read_text())
    assert len(record["false_alarms"]) == 2
    for alarms in record["false_alarms"].values():
        assert all(one["nominal"] == 0.0 for one in alarms.values())  # a vehicle that does not move alarms nobody
        assert alarms["perceived (1.095 m)"]["lifelike"] <= alarms["wandering zone (0.375 m)"]["lifelike"]
    (detection,) = record["detection"].values()
    # A lane change of 3.5 m at 2 m/s at most: the zone of 0.375 m is left well within a second, the marking later.
    assert 0.1 < detection["wandering zone (0.375 m)"]["nominal"] < detection["perceived (1.095 m)"]["nominal"] < 2.0
    (verdicts,) = record["verdicts"].values()
    for one in verdicts.values():
        shares = one["share_preventable_nominal"]
        assert shares == sorted(shares) and shares[0] == 0.0 and shares[-1] == 1.0  # a step, from crash to none
    assert (tmp_path / "out" / "verdict.svg").read_text().startswith("<svg ")
    assert "verdicts that flip" in (tmp_path / "out" / "study.md").read_text()
