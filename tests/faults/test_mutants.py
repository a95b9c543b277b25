"""A few mutants for every reader; `make fuzz` tries more."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.__main__ import CHANGES
from tests.faults.attack import Count, attack
from tests.faults.doors import DOORS, NEEDS, attack_door
from tests.faults.reader import Reader
from tests.faults.readers import READERS

COUNT = 10
"""Mutants of each reader and kind, fewer of the slow ones: half a minute together."""


@pytest.mark.pages
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_mutants_are_refused_in_one_line_or_make_sense(reader: Reader, tmp_path: Path) -> None:
    if reader.needs:
        pytest.importorskip(reader.needs, reason="its extra is not installed")
    for change in CHANGES.values():
        tally = Count()
        folder = tmp_path / change.__name__
        faults = [
            f"{fault.file} {fault.seed}: {fault.what}" for fault in attack(reader, COUNT, 1, folder, tally, change)
        ]
        assert not faults
        assert tally.refused + tally.accepted == max(1, round(reader.share * COUNT))


@pytest.mark.pages
@pytest.mark.parametrize("door", DOORS)
def test_lines_of_a_simulation_are_answered_in_one_line_and_refused_ones_change_nothing(
    door: str, tmp_path: Path
) -> None:
    for package in NEEDS.get(door, ()):
        pytest.importorskip(package, reason="its extra is not installed")
    tally = Count()
    assert not [
        f"{fault.seed}: {fault.what}"
        for fault in attack_door(door, (5 if door in NEEDS else 20) * COUNT, 1, tmp_path, tally)
    ]
    assert min(tally.refused, tally.accepted) > 0
