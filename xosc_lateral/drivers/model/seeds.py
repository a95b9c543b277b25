"""Seeds of independent sources of chance, derived from one; every key that is used anywhere stands here.

Keys are part of what a seed means: changing one changes the numbers that a profile and a seed give.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from hashlib import sha256

import numpy as np


class DriveSeed(IntEnum):
    """Below the seed of a drive."""

    CORE = 0
    HIDDEN = 1
    """One per hidden effect, by its place among them."""
    SLOPES = 2
    """One per column effect whose coefficients differ between drivers, by its place among the column effects."""
    SENSOR = 77
    """One per piece of the drive that a sensor measured."""


class TwoLevelSeed(IntEnum):
    """Below the seed of a two-level model's drive."""

    CHAIN = 0
    NOISE = 1
    FIRST_BIN = 2


class AutoregressiveSeed(IntEnum):
    """Below the seed of an autoregressive model's drive."""

    DRIVER = 0
    VOLATILITY = 1
    """Below it: 0 for what varies within seconds, 1 for what varies within minutes."""
    COARSE = 2
    FINE = 3


def of_name(name: str) -> int:
    """128 bits of a name: among a billion of them, no two have the same by chance (less than one in 10^20)."""
    return int.from_bytes(sha256(name.encode()).digest()[:16], "big")


def of_driver(
    seed: int, name: str, *, variant: int = 0, attempt: int = 0, words: Iterable[int] = ()
) -> np.random.SeedSequence:
    """The driver of a vehicle of that name, in a conversion as live: same seed, same name, same driver."""
    return np.random.SeedSequence([seed, variant, attempt, of_name(name), *words])


def child(seed: np.random.SeedSequence, *keys: int) -> np.random.SeedSequence:
    """A seed of its own for each combination of keys; unlike `SeedSequence.spawn` it leaves `seed` as it is."""
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *keys), pool_size=seed.pool_size)


def generator(seed: np.random.SeedSequence, *keys: int) -> np.random.Generator:
    """A generator on the child of a seed."""
    return np.random.default_rng(child(seed, *keys))
