"""Where nothing acts, nothing is named: over many simulated drivers, and over movements that no driver model made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.kit.selected import selected
from tests.kit.simulated import movements
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.files.drives import read_drives

pytestmark = pytest.mark.pages

Driven = Callable[..., list[Drive]]

SEEDS = range(1, 13)
ALLOWED = 2
"""Of twelve drives: a loop that names something on one drive in twenty exceeds it with a probability of 2 %."""


def words(drives: list[Drive]) -> str:
    return ", ".join(f"{one.term.component} {one.term.columns}" for one in selected(drives).accepted)


def test_hardly_ever_is_anything_named_where_nothing_was_planted(driven: Driven) -> None:
    named = {seed: words(driven(seed, duration=1500.0)) for seed in SEEDS}
    blamed = {seed: what for seed, what in named.items() if what}
    assert len(blamed) <= ALLOWED, blamed


@pytest.mark.parametrize(
    ("movement", "resolution"),
    [
        (movements.ornstein_uhlenbeck, None),
        (movements.ornstein_uhlenbeck, 0.05),
        (movements.heavy_tailed, None),
        (movements.reflected, None),
        (movements.delayed_control, None),
        (movements.clustered, None),
    ],
    ids=["wandering", "camera of 5 cm", "heavy tails", "reflected", "delayed control", "clustered"],
)
def test_nothing_is_named_whatever_moves_the_car(
    tmp_path: Path, movement: movements.Movement, resolution: float | None
) -> None:
    path = tmp_path / "drive.parquet"
    movements.record_movement(movement, 1500.0, 1, resolution=resolution).to_parquet(path)
    assert words(read_drives([path])) == ""
