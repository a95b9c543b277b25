"""A few mutants for every reader; `make fuzz` tries more."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.faults.attack import Count, attack
from tests.faults.reader import Reader
from tests.faults.readers import READERS

COUNT = 20
"""Mutants of each reader, fewer of the slow ones: half a minute together."""


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.name)
def test_mutants_are_refused_in_one_line_or_make_sense(reader: Reader, tmp_path: Path) -> None:
    if reader.needs:
        pytest.importorskip(reader.needs, reason="its extra is not installed")
    tally = Count()
    faults = [f"{fault.file} {fault.seed}: {fault.what}" for fault in attack(reader, COUNT, 1, tmp_path, tally)]
    assert not faults
    assert tally.refused + tally.accepted == max(1, round(reader.share * COUNT))
