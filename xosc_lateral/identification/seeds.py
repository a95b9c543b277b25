"""Keys below the loop's seed, one for each source of chance: changing one changes p-values and errors a little."""

from __future__ import annotations

from enum import IntEnum


class LoopSeed(IntEnum):
    """Key of a source of chance."""

    COLUMNS = 0
    """Rotations that candidates of a column are compared with."""
    REGIMES = 3
    """Simulated loudness that regimes are compared with."""
    LOW_FREQUENCY = 4
    """Simulated rows and drawn signs that drifts and steps are compared with."""
    BETWEEN = 5
    """Places dealt anew to drives."""
    FOLDS = 5
    """Runs before and after on held-out folds. The key of `BETWEEN`, too: that draws nothing but an order of drives."""
    SPECTRUM = 7
    """Runs whose spectrum is compared with the drives'."""
    BLOCKS = 9
    """Blocks drawn for the floor, and for the error before and after."""
    LACK_OF_FIT = 11
    """Halves of blocks that tell the floor."""
