"""Drives as units: what changes with time in every drive alike, and what differs between drives.

Each drive has a slope of its own. Whether the slopes' mean is a driver's habit is a question to drives, not to
seconds: its error comes from how much slopes scatter between drives, moderated by what drives on which nothing acts
scatter [1]_, so that three drives that happen to agree are no proof.

References
----------
.. [1] G. K. Smyth, "Linear models and empirical Bayes methods for assessing differential expression in microarray
       experiments", Statistical Applications in Genetics and Molecular Biology 3, 2004: the moderated t.
.. [2] R. C. Paule, J. Mandel, "Consensus values and weighting factors", J. Research NBS 87, 1982.
.. [3] G. Knapp, J. Hartung, "Improved tests for a random effects meta-regression with a single covariate", Statistics
       in Medicine 22, 2003.
.. [4] B. Efron, "Microarrays, empirical Bayes and the two-groups model", Statistical Science 23, 2008.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, fdtrc, logit, ndtri, stdtr, stdtrit

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.extras.loop.dictionary import beside
from xosc_lateral.extras.loop.significance import MINIMUM_P
from xosc_lateral.extras.loop.timeline import MIN_VALID_S, Coarse

FEWEST = 3  # Drives from which their slopes say whether they change alike.
FEWEST_BETWEEN = 5  # Drives from which a column that is constant in each is tested: three degrees of freedom.
# Slopes of drives on which nothing acts scatter by so many times their model's variance; fitted on 110 and 120 such
# sets (the mean 2.05 and 2.16, the spread 1.65 and 2.31), worth so many drives.
MEAN_INFLATION, SPREAD_INFLATION, PRIOR_DRIVES = 2.1, 1.65, 4.0
# Rounds at most, and the share of the variance between drives that the last one may change it by. [-]
ROUNDS, VARIANCE_TOLERANCE = 50, 1e-9
LEAST_SHARE = 0.1  # Of the usual information of a drive below which its own slope says nothing. [-]
OWN_LEVEL = 0.01  # p-value up to which drives are said to differ. [-]
SURE_LEVEL = 0.05  # Probability that an effect is said to act in any drive in which it does not. [-]
POWER_Z = 0.84  # Standard normal quantile of a power of 80 %.
BOUND_Z = 1.645  # Of a one-sided bound of 95 %.


@dataclass(frozen=True, slots=True)
class Pooled:
    """A mean over drives: its size with error, how sure, and what could have been found."""

    size: float
    error: float
    degrees: float  # Of freedom.
    drives: int  # That it rests on.
    within: float = 1.0  # p-value of slopes of any kind, each drive's its own. [-]

    @property
    def p_value(self) -> float:
        """Two-sided, of no such mean. [-]"""
        return max(2.0 * float(stdtr(self.degrees, -abs(self.size) / max(self.error, 1e-300))), MINIMUM_P)

    def detectable_size(self, level: float) -> float:
        """Size that is found with 80 % probability at a level, in the size's unit."""
        return -self.error * float(stdtrit(self.degrees, 0.5 * level) + stdtrit(self.degrees, 0.2))

    @property
    def bound(self) -> float:
        """What a size that was not found is below, at 95 %."""
        return abs(self.size) - self.error * float(stdtrit(self.degrees, 0.05))


def counted(coarse: Coarse) -> FloatArray:
    """Valid seconds of every drive that has two minutes of them, 0 of the others; shape (drives,). [s]"""
    seconds = np.bincount(coarse.drive, coarse.valid.astype(np.float64), minlength=coarse.drives)
    return np.where(seconds >= MIN_VALID_S, seconds, 0.0)


def own_time(coarse: Coarse) -> FloatArray:
    """Time from the first valid second of each drive, shape (n,). [s]"""
    first = np.full(coarse.drives, np.inf)
    np.minimum.at(first, coarse.drive[coarse.valid], coarse.time[coarse.valid])
    return np.asarray(coarse.time - np.where(np.isfinite(first), first, 0.0)[coarse.drive])


def slope_alike(rows: FloatArray, column: FloatArray, coarse: Coarse, inflation: float) -> Pooled | None:
    """Common slope of white rows on a white column, shape (n,), each less its drive's level; None: too few drives."""
    lasting = counted(coarse) > 0.0
    power = np.bincount(coarse.drive, column**2, minlength=coarse.drives)[lasting]
    slopes = np.bincount(coarse.drive, column * rows, minlength=coarse.drives)[lasting] / np.maximum(power, 1e-300)
    if (number := len(slopes)) < FEWEST or not (power > 0.0).all():
        return None
    mean = float(power @ slopes / power.sum())
    scatter = float(power @ np.square(slopes - mean))
    degrees = PRIOR_DRIVES + number - 1
    error = float(np.sqrt((PRIOR_DRIVES * inflation + scatter) / degrees / power.sum()))
    within = max(float(fdtrc(number, PRIOR_DRIVES, power @ np.square(slopes) / number / inflation)), MINIMUM_P)
    return Pooled(mean, error, degrees, number, within)


def left_of_drives(values: FloatArray, known: FloatArray, root: FloatArray) -> FloatArray:
    """Values times their weights' roots, shape (drives,) each, free of what is known, shape (drives, k)."""
    return beside(np.linalg.qr(known * root[:, None])[0], values * root)


def weights_between(values: FloatArray, noise: FloatArray, known: FloatArray) -> FloatArray:
    """One over the variance of drives' own values about what is known; inf as `noise`: of no account. Shape (drives,).

    By Newton's method: the sum of squares falls and is convex in the variance, so rounds from zero approach its root
    from below.
    """
    scatter, degrees = 0.0, max(int(np.isfinite(noise).sum()) - known.shape[1], 1)
    for _ in range(ROUNDS):
        weights = 1.0 / (scatter + noise)
        squares = np.square(left_of_drives(values, known, np.sqrt(weights)))
        change = (float(squares.sum()) - degrees) / max(float(squares @ weights), 1e-300)
        if abs(change) <= VARIANCE_TOLERANCE * scatter or (change < 0.0 and scatter == 0.0):
            break
        scatter = max(scatter + change, 0.0)
    return np.asarray(weights)


def regress(values: FloatArray, noise: FloatArray, column: FloatArray) -> Pooled:
    """Slope of drives' own values on a column, shape (drives,) each; `noise`: variances. [unit of the values] per unit

    Weights at which weighed squares add up to their degrees of freedom [2]_, the error by what is left [3]_, never
    below the model's own.
    """
    design, degrees = np.column_stack([np.ones(len(values)), column - column.mean()]), len(values) - 2
    root = np.sqrt(weights_between(values, noise, design))
    weighed, rest = design * root[:, None], left_of_drives(values, design, root)
    inverse = np.linalg.inv(weighed.T @ weighed)
    slope = float((inverse @ weighed.T @ (values * root))[1])
    factor = max(1.0, float(rest @ rest) / degrees)
    return Pooled(slope, float(np.sqrt(factor * inverse[1, 1])), degrees, len(values))


@dataclass(frozen=True, slots=True, eq=False)
class OwnSlopes:
    """Whether an effect differs from drive to drive: each drive's slope over the common one."""

    p_value: float  # That slopes scatter as much though all are alike. [-]
    scatter: float  # Standard deviation between drives. [-]
    there: tuple[str, ...]  # Drives in which it surely acts, by name.
    size_there: float  # Mean slope of those, as its own and those of the others in which it acts say [4]_. [-]
    error_there: float  # Its standard error. [-]
    each: FloatArray  # Slope of every drive, shape (drives,). [-]

    @property
    def differ(self) -> bool:
        """Whether drives surely differ."""
        return self.p_value <= OWN_LEVEL


def slopes_where_it_acts(slopes: FloatArray, noise: FloatArray, usual: float) -> FloatArray:
    """Likely slopes of drives in some of which nothing acts, shape (drives,), from their own with variances `noise`.

    Where it acts slopes scatter about a mean of their own, `usual` or so, as a normal distribution; elsewhere there is
    none [4]_. Expectation and maximisation by turns. To take all drives for one normal distribution would draw those
    in which it acts towards those in which it does not.
    """
    scatter, acts = float(noise.mean()), np.full(len(slopes), 0.5)
    for _ in range(ROUNDS):
        variance, share = scatter + noise, logit(float(np.clip(acts.mean(), SURE_LEVEL, 1.0 - SURE_LEVEL)))
        nearer = np.square(slopes) / noise - np.square(slopes - usual) / variance + np.log(noise / variance)
        acts = expit(share + 0.5 * nearer)
        usual = float(np.average(slopes, weights=acts / variance))
        likely = usual + scatter / variance * (slopes - usual)
        scatter = float(np.average(np.square(likely - usual) + scatter * noise / variance, weights=acts))
    return np.asarray(acts * likely)


def own_slopes(rows: FloatArray, path: FloatArray, coarse: Coarse) -> OwnSlopes | None:
    """Slopes of white rows, levels taken out, on the white path of an effect, shape (n,) each; None: too few drives.

    What slopes scatter by though all are alike is what their minutes show (a clustered error; Liang, Zeger 1986), as
    many as would tell as much if all moved the driver alike.
    """
    power = np.bincount(coarse.drive, path**2, minlength=coarse.drives)
    lasting = (counted(coarse) > 0.0) & (power > LEAST_SHARE * power.sum() / coarse.drives)
    number, inside = int(lasting.sum()), lasting[coarse.drive] & coarse.valid
    moved = np.bincount(coarse.cluster, path**2 * inside)
    minutes = float(moved.sum() ** 2 / max(float(moved @ moved), 1e-300))
    if number < FEWEST or minutes <= number:
        return None
    each = np.bincount(coarse.drive, path * rows, minlength=coarse.drives) / np.maximum(power, 1e-300)
    left = np.bincount(coarse.cluster, path * (rows - each[coarse.drive] * path) * inside)
    weight, slopes = power[lasting], each[lasting]
    variance = max(float(left @ left) / float(weight.sum()) * minutes / (minutes - number), 1e-300)
    mean, noise = float(weight @ slopes / weight.sum()), variance / weight
    scatter = float(weight @ np.square(slopes - mean)) / variance
    p_value = max(float(fdtrc(number - 1, minutes - number, scatter / (number - 1))), MINIMUM_P)
    between = max(float((1.0 / weights_between(slopes, noise, np.ones((number, 1))) - noise).mean()), 0.0)
    sure = np.sign(mean) * slopes > -float(ndtri(SURE_LEVEL / number)) * np.sqrt(noise)
    there, scale = sure if sure.any() else np.ones_like(sure), max(abs(mean), 1e-300)
    size = float(slopes_where_it_acts(slopes, noise, float(slopes[there].mean()))[there].mean())
    error = float(np.sqrt(noise[there].sum())) / int(there.sum()) / scale
    names = tuple(np.array(coarse.timeline.names)[lasting][sure].tolist())
    return OwnSlopes(p_value, float(np.sqrt(between)) / scale, names, size / mean if mean else 0.0, error, each)
