"""From scores under the null to a family-wise p-value."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from scipy.special import chdtrc, chdtri

from xosc_lateral.base.arrays import FloatArray, IndexArray


class LoopSeed(IntEnum):
    """Key of a source of chance."""

    COLUMNS = 0  # Rotations that candidates of a column are compared with.
    REGIMES = 3  # Simulated loudness that regimes are compared with.
    LOW_FREQUENCY = 4  # Simulated rows and drawn signs that drifts and steps are compared with.
    BETWEEN = 5  # Places dealt anew to drives.
    # Runs before and after on held-out folds. The key of `BETWEEN`, too: that draws nothing but an order of drives.
    FOLDS = 5
    SPECTRUM = 7  # Runs whose spectrum is compared with the drives'.
    BLOCKS = 9  # Half samples of the blocks.
    SNIPPETS = 11  # Halves of the blocks whose snippets are compared.
    CYCLE = 12  # White rows that the highest line of the spectrum is compared with.
    OMNIBUS = 13  # Rotations that what is left is compared with.


MINIMUM_P = 1e-300  # p-values stay above: their logarithm is taken. [-]
# Probability that chance is named: on 39 tables of 40 nothing wrong is to be, and now and then what goes along with an
# effect is taken for it. [-]
BUDGET = 0.02
# Share of a null of maxima that their tail is fitted on: they have an exponential one (Gumbel's law). [-]
TAIL_SHARE = 0.25
HEAVY_TAIL_SHARE = 0.1  # Share that the tail of a quadratic form is fitted on: further in it is no exponential yet. [-]
# So many independent draws that reach a score tell its probability to a third, without any law of the tail.
COUNTED_DRAWS = 10
# Mean excess in the far tail of a chi-square with one degree of freedom, and of maxima of many. [-]
CHI_SQUARE_EXCESS = 2.0
# From so many drives on a table tells what differs between them, and its null is drawn by whole drives.
MANY_DRIVES = 20
NULL_DRAWS = 400  # Rotated or re-signed residuals that the null is taken from.
LEAST_SHIFT_S = 60  # No rotation is shorter: a driver's response must be out of reach. [s]
BLOCK_S = 300  # Length of the blocks that are dealt in random order: three times the memory that whitening sees. [s]


def upper_tail(
    score: float, null: FloatArray, *, tail_share: float = TAIL_SHARE, least_excess: float = CHI_SQUARE_EXCESS
) -> float:
    """Probability, `MINIMUM_P` to 1, that chance gives `score` or more. [-]

    What many independent draws reach has their share. Beyond, the null's tail falls as an exponential, whose scale is
    known from no more than the draws in it: integrated over what it may be, the tail is a power (Aitchison, Dunsmore
    1975), which an exponential of the mean excess would put too low by a factor of 2 at 1e-3, of 4 at 1e-4, for 25
    draws.
    """
    if len(null) == 0:
        return 1.0
    independent, share = effective_number(null), float(np.mean(null >= score))
    knee = float(np.quantile(null, 1.0 - tail_share))
    if score <= knee or share * independent >= COUNTED_DRAWS:
        return share
    draws = max(tail_share * independent, 1.0)
    excess = max(float(np.mean(null[null > knee] - knee)) if np.any(null > knee) else 0.0, least_excess, 1e-300)
    p_value = tail_share * float(np.exp(-draws * np.log1p((score - knee) / (excess * draws))))
    return max(min(p_value, COUNTED_DRAWS / independent), MINIMUM_P)


def score_at(level: float, null: FloatArray) -> float:
    """Score whose `upper_tail` is a level, by bisection; infinite without a null."""
    low, high = (float(null.min()), float(null.max()) + 1e3) if len(null) else (np.inf, np.inf)
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if upper_tail(middle, null) > level else (low, middle)
    return high


def effective_number(draws: FloatArray) -> float:
    """Independent draws that tell as much about a mean as these do, by their autocorrelation (Geyer 1992); 1 to n."""
    n = len(draws)
    left = draws - draws.mean()
    power = float(left @ left)
    if power <= 0.0 or not np.isfinite(power):
        return float(n)
    size = 2 * n
    correlation = np.fft.irfft(np.square(np.abs(np.fft.rfft(left, size))), size)[: n - n % 2] / power
    pairs = correlation[0::2] + correlation[1::2]
    ends = np.flatnonzero(pairs <= 0.0)
    time = 2.0 * float(pairs[: ends[0] if len(ends) else len(pairs)].sum()) - 1.0
    return float(np.clip(n / max(time, 1.0), 1.0, n))


def as_one_degree(chi_square: FloatArray | float, degrees: int) -> FloatArray:
    """Chi-square with one degree of freedom that is as rare as one with `degrees`, of the same shape."""
    return np.asarray(chdtri(1, np.maximum(chdtrc(degrees, chi_square), MINIMUM_P)))


def draw_null(residual: FloatArray, drive: IndexArray, rng: np.random.Generator, draws: int = NULL_DRAWS) -> FloatArray:
    """Residuals whose tie to the columns is broken, shape (seconds, draws).

    Few long drives: rotated by at least `LEAST_SHIFT_S`, cut into blocks, and these dealt in random order. Rotations
    alone are few: a column that changes within a minute sees no more than fifty of them in a drive of fifty minutes.
    Many short drives: the sign of each whole drive drawn anew (a wild cluster bootstrap; Cameron, Gelbach, Miller
    2008). Drives are independent, and what an autoregression fitted to runs of a minute leaves in a drive's slow
    movement and first rows stays beside the columns of that very drive; rotation would spread it evenly.
    """
    seconds = len(residual)
    names, drive_number = np.unique(drive, return_inverse=True)
    if len(names) >= MANY_DRIVES:
        return np.asarray(residual[:, None] * rng.choice([-1.0, 1.0], size=(len(names), draws))[drive_number])
    low = min(LEAST_SHIFT_S, seconds // 4)
    # in order: where there is but one block, neighbours are alike, and how much so tells how many there are in truth
    shifts = np.sort(rng.integers(low, max(low + 1, seconds - low), size=draws))
    drawn = np.empty((seconds, draws))
    for draw, shift in enumerate(shifts):
        drawn[:, draw] = in_another_order(np.roll(residual, -shift), BLOCK_S, rng)
    return drawn


def in_another_order(values: FloatArray, length: int, rng: np.random.Generator) -> FloatArray:
    """Blocks of about a length, dealt in random order, shape (n,) like `values`."""
    count = max(1, round(len(values) / length))
    lengths = np.full(count, len(values) // count)
    lengths[: len(values) % count] += 1
    order = rng.permutation(count)
    dealt = lengths[order]
    moved = (np.cumsum(lengths) - lengths)[order] - (np.cumsum(dealt) - dealt)  # each block, from where it comes to lie
    return np.asarray(values[np.arange(len(values)) + np.repeat(moved, dealt)])
