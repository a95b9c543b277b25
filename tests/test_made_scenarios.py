"""Scenarios that are written for the purpose: valid, the same from the same seed, of every kind, and played."""

from __future__ import annotations

from pathlib import Path

import pytest
from lxml import etree

from tests.kit.made.actions import ACTIONS
from tests.kit.made.conditions import CONDITIONS
from tests.kit.made.roads import ROADS
from tests.kit.made.scenario import LAST, made
from xosc_lateral.workflows.conversion.load import play_scenario

SCHEMA = Path(__file__).parent / "data" / "xsd" / "OpenSCENARIO-1.3.0.xsd"


def test_they_are_valid_and_hold_every_action_condition_and_road() -> None:
    schema = etree.XMLSchema(etree.parse(str(SCHEMA)))
    titles = []
    for seed in range(60):
        title, _, scenario = made(seed)
        schema.assertValid(etree.fromstring(scenario.encode()))
        titles.append(title)
    for kinds, place in ((ACTIONS, 0), (CONDITIONS, 1), (ROADS, 2)):
        assert {title.replace(" on ", " when ").split(" when ")[place] for title in titles} == set(kinds)


def test_a_seed_stands_for_one_scenario() -> None:
    assert made(7) == made(7)


def test_they_are_played(tmp_path: Path) -> None:
    for seed in range(500, 506):
        _, road, scenario = made(seed)
        (tmp_path / "road.xodr").write_text(road, encoding="utf-8")
        (tmp_path / "made.xosc").write_text(scenario, encoding="utf-8")
        assert play_scenario(tmp_path / "made.xosc").motion.end_time == pytest.approx(LAST)
