"""Simulated drives as the loop gets them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from examples.driver_simulator.plants import Plant
from examples.driver_simulator.simulator import Driver, simulate_drive
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.files.drives import read_drives


def driver_in(folder: Path) -> Callable[..., list[Drive]]:
    """Drives as the loop gets them: simulated, written to a folder, and read back."""

    def drive(
        seed: int,
        effects: Sequence[Plant] = (),
        duration: float = 3000.0,
        drop: Sequence[str] = (),
        driver: Driver | None = None,
    ) -> list[Drive]:
        path = folder / f"drive-{seed}.parquet"
        simulate_drive(duration, seed, effects=effects, drop=drop, driver=driver).table.to_parquet(path)
        return read_drives([path])

    return drive


@pytest.fixture
def driven(tmp_path: Path) -> Callable[..., list[Drive]]:
    """Drives in a folder of the test's own."""
    return driver_in(tmp_path)
