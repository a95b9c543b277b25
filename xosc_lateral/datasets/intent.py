"""What a simulated driver wants, and what an effect planted in a drive does to it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

Context = dict[str, np.ndarray]


@dataclass(eq=False)
class Intent:
    """What the driver wants at every step, and what the camera does to the record; shape (n,) each."""

    target: np.ndarray
    """Offset aimed at, left positive. [m]"""
    tolerance: np.ndarray
    """Factor on the error that the driver lets pass. [-]"""
    gain: np.ndarray
    """Factor on the share of a noticed error that one correction takes away. [-]"""
    noise: np.ndarray
    """Factor on what hand and eye do inexactly. [-]"""
    attention: np.ndarray
    """1 where the driver watches the road, 0 where not. [-]"""
    camera: np.ndarray
    """Added to the measured offset: an error of the sensor. [m]"""

    @classmethod
    def neutral(cls, n: int) -> Intent:
        """A driver without any effect."""
        return cls(np.zeros(n), np.ones(n), np.ones(n), np.ones(n), np.ones(n), np.zeros(n))


class Plant(Protocol):
    """One effect."""

    @property
    def kind(self) -> str:
        """Kind of finding that names it (DESIGN, section 6)."""
        ...

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that cause it; empty for a hidden effect."""
        ...

    def apply(self, intent: Intent, context: Context, rng: np.random.Generator) -> None:
        """Change what the driver does; a plant may also add a column to the context."""
        ...
