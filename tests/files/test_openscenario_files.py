"""Every file of tests/data/xosc: the valid ones load, the invalid ones are refused with the message beside them."""

from __future__ import annotations

from pathlib import Path

import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.read import read_scenario

DATA = Path(__file__).parents[1] / "data" / "xosc"
VALID = sorted((DATA / "valid").glob("*.xosc"))
INVALID = sorted((DATA / "invalid").glob("*.xosc"))


def test_the_corpus_is_there_and_every_invalid_file_has_its_message() -> None:
    assert len(VALID) > 5
    assert len(INVALID) > 30
    assert all(path.with_suffix(".expected").read_text().strip() for path in INVALID)


@pytest.mark.parametrize("path", VALID, ids=lambda path: path.stem)
def test_valid_file_loads(path: Path) -> None:
    scenario = read_scenario(path)
    assert [entity.name for entity in scenario.entities] == ["Ego"]


@pytest.mark.parametrize("path", INVALID, ids=lambda path: path.stem)
def test_invalid_file_is_refused_in_one_line(path: Path) -> None:
    with pytest.raises(FormatError) as refused:
        read_scenario(path)
    message = str(refused.value)
    assert "\n" not in message
    assert len(message) < 600
    for part in path.with_suffix(".expected").read_text().splitlines():
        assert part.replace("{file}", str(path)) in message
