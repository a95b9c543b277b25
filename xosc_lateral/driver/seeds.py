"""Seeds of independent sources of chance, derived from one."""

from __future__ import annotations

import numpy as np


def child(seed: np.random.SeedSequence, *keys: int) -> np.random.SeedSequence:
    """A seed of its own for each combination of keys; unlike `SeedSequence.spawn` it leaves `seed` as it is."""
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *keys), pool_size=seed.pool_size)
