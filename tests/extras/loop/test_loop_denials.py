"""No two sentences of a report deny each other: statements are read against tables, over small loops of all kinds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from examples.driver_simulator.simulator import Driver, simulate_drive
from tests.kit import simulated as plants
from tests.kit.profiles import as_drive
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.extras.loop.close import LoopResult, close_loop
from xosc_lateral.extras.loop.loop_report import loop_record
from xosc_lateral.extras.loop.loop_words import outcome

pytestmark = pytest.mark.pages

COLUMNS = ("truck_right", "speed", "time", "distance_left", "distance_right", "lane_index")


def drive(seed: int, seconds: float, *effects: Any, **columns: float) -> Drive:
    table = simulate_drive(seconds, seed, driver=Driver(), effects=effects).table
    table = table.drop(columns=[name for name in CONTEXT_UNITS if name in table and name not in COLUMNS])
    return as_drive(table.assign(**columns), f"drive-{seed}")


@pytest.fixture(scope="module")
def loops() -> dict[str, LoopResult]:
    """Of who keeps away from trucks, with two seeds, his profile again, and of six short drives without an effect."""
    long = [drive(101, 700.0, plants.truck_avoidance(0.5))]
    short = [drive(110 + k, 170.0, passengers=float(k % 3), night=float(k == 0)) for k in range(6)]
    first = close_loop(long, seed=1)
    return {
        "one": first,
        "other seed": close_loop(long, seed=2),
        "again": close_loop(long, first.refined, seed=1, in_sample=True),
        "short": close_loop(short, seed=1),
    }


CASES = ["one", "other seed", "again", "short"]


@pytest.mark.parametrize("case", CASES)
def test_what_is_said_of_a_look_is_what_became_of_it(loops: dict[str, LoopResult], case: str) -> None:
    result = loops[case]
    record = loop_record(result, [])
    kept = {name for effect in result.refined.effects for name in effect.columns}
    assert {
        one["what"].removesuffix(" (between drives)") for one in record["shown"] if one["why"] == "in the profile"
    } <= {
        *kept,
        *("time", "step", "cycle", "regimes"),
    }
    for finding in record["findings"]:
        looks = [one for one in record["shown"] if [one["what"]] == finding["columns"] and one["acts"] == "mean"]
        assert not any(one["why"].startswith("not found") for one in looks if finding["kind"] == "location")
        low, high = finding["interval"]
        assert finding["p_value"] >= 1e-3 or finding["kind"] != "location" or not low <= 0.0 <= high
    for one in record["shown"]:
        assert one["tested"] or (one["smallest"] is None and not one["why"].startswith("not found"))
    not_causes = {one["column"] for one in record["columns"] if one["use"] != "tested as a cause"}
    assert not_causes.isdisjoint(name for finding in record["findings"] for name in finding["columns"])


@pytest.mark.parametrize("case", CASES)
def test_sentences_agree_with_tables(loops: dict[str, LoopResult], case: str) -> None:
    result = loops[case]
    record, said = loop_record(result, []), outcome(result)
    found, back = record["findings"], [one for one in record["rejected"] if one["taken_back"]]
    assert ("No significant effect" in said) == (not found and not back)
    assert ("found and added" in said) == bool(found)
    assert ("taken back" in said) == bool(back)
    assert found or not result.base_given or record["error"]["before"] == record["error"]["after"]
    left = record["unexplained"]
    assert ("no more than chance" in left["sentence"]) <= left["omnibus"]["within_chance"]
    assert ("More is left than chance" in left["sentence"]) == (not left["omnibus"]["within_chance"])
    assert "would be found" in left["sentence"]
    tested = {(finding["columns"] and tuple(finding["columns"]), finding["kind"]) for finding in found}
    failing = {(tuple(one["columns"]), "location") for one in record["rejected"] if one["look"] in ("mean", "course")}
    assert not tested & failing


def test_the_verdict_is_the_same_whatever_the_seed(loops: dict[str, LoopResult]) -> None:
    one, other = loops["one"], loops["other seed"]
    assert [finding.columns for finding in one.findings] == [finding.columns for finding in other.findings] != []
    assert np.array([one.error_before, one.error_after, one.floor]) == pytest.approx(
        [other.error_before, other.error_after, other.floor]
    )
    assert one.remainder is not None
    assert other.remainder is not None
    assert one.remainder.silent == other.remainder.silent


def test_too_few_drives_are_said_to_be_too_few(loops: dict[str, LoopResult]) -> None:
    shown = {(one.what, one.acts): one for one in loops["short"].shown}
    assert shown["passengers (between drives)", "mean"].tested
    assert "one drive alone differs" in shown["night (between drives)", "mean"].why
