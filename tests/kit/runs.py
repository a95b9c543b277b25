"""Runs and segments with known movement."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.model.sampled_offsets import segment_of

STEP = 0.2


def smooth_runs(drivers: int = 24, seconds: float = 60.0, seed: int = 0) -> list[Run]:
    """Drivers with a mean of their own (0.2 m) and a smooth weave about it (0.15 m, some 5 s)."""
    rng = np.random.default_rng(seed)
    n = round(seconds / STEP) + 1
    kernel = np.exp(-0.5 * (np.arange(-50, 51) * STEP / 2.0) ** 2)
    kernel /= np.sqrt((kernel**2).sum())
    runs = []
    for number in range(drivers):
        weave = np.convolve(rng.standard_normal(n + 100), kernel, mode="valid")
        runs.append(made_run(0.2 * rng.standard_normal() + 0.15 * weave, drive=f"d{number}"))
    return runs


def made_run(offset: np.ndarray, *, drive: str = "d", speed: float = 30.0, **context: np.ndarray) -> Run:
    n = len(offset)
    own = {"speed": np.full(n, speed), **context}
    return Run(drive, 0, STEP * np.arange(n), np.asarray(offset, dtype=float), np.full(n, 3.75), own)


def straight(count: int, seconds: float, **context: float) -> list[Segment]:
    """Equal segments of an even road."""
    n = round(seconds / STEP) + 1
    columns = {name: np.full(n, value) for name, value in context.items()}
    return [segment_of(made_run(np.zeros(n), **columns))] * count
