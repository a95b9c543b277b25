"""The model of a drive: its terms, and the fit of all of them together.

offset = level of the drive + mean terms + scale * movement, the movement an autoregression at 1 Hz, log scale = level
of the drive + scale terms. Mean terms are fitted jointly by generalised least squares, scale terms by iterated
regression of squared innovations [1]_: adding a term corrects the ones found before.

References
----------
.. [1] M. Aitkin, "Modelling variance heterogeneity in normal regression using GLIM", Applied Statistics 36, 1987.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import ClassVar, Self, TypeVar

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.drivers.fitting.regression import clustered_least_squares, small_sample_factor
from xosc_lateral.drivers.model.effects import Acts, Effect
from xosc_lateral.drivers.model.effects.ends import Ends
from xosc_lateral.extras.loop.autocorrelation import Whitener, fit_autoregression, start_factors, unbiased
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.drives import OwnSlopes
from xosc_lateral.extras.loop.passage import Passage
from xosc_lateral.extras.loop.refinement import Alternatives
from xosc_lateral.extras.loop.timeline import CLUSTER_S, Coarse, on_fine_grid

ORDER = 12  # Past seconds that have a coefficient each in the movement's autoregression. [s]
MAXIMUM_ORDER = 96  # Past seconds that it sees as means over doubling times: drifts of a minute and a half. [s]
# Shifts of a response that make up its smoothing: two standard deviations, to either side, of a Gaussian that leaves
# 9 % at 0.5 Hz. [s]
SMOOTHING_S = (-2, -1, 1, 2)
CLIP = 9.0  # Squared innovations (variance 1) beyond this count as this: three standard deviations. [-]
OWN_LEVEL_S = 30.0  # A drive's level of the scale is its own as far as it lasts longer than this. [s]
# White noise that the model of a drive has beside what it shows: no table knows the lane better (in the motorway
# recording the standard error of a lane's centre is 0.03 m; docs/real_data.md). Providers smooth their tracks,
# responses and all; without this noise an effect is sized where the smoothing left nothing of it. [m]
MEASUREMENT_NOISE = 0.03
# Scale terms together change the movement by at most this factor's logarithm, 20 either way: scoring steps of a factor
# that the movement contradicts grow without end. [-]
MOST_LOG_SCALE = 3.0
ROUNDS = 4  # Turns of sizes, autoregression and scale; they settle in three.


class Stage(IntEnum):
    """When a term is tested. The mean comes first: a mean that is not known looks like a spread.

    Regimes come after the spread, because they explain whatever comes in clusters, and before what a regime's loud
    stretches might be taken for.
    """

    MEAN = 1
    LOW_FREQUENCY = 2
    MEAN_AGAIN = 3
    SPREAD = 4
    REGIMES = 5
    FINE_NOISE = 6
    BETWEEN_DRIVES = 7


@dataclass(frozen=True)
class Description:
    """A term in numbers that a report can put into words."""

    effect: str  # Short name.
    shape: str
    size_m: float  # Change of the mean between the 5 % and 95 % quantile, or amplitude [m]; factor for scale.
    size_error: float  # Standard error of it.
    statistic: str  # Group of summary statistics that shows it best.
    measure: str = ""  # What the errors before and after compare; empty: that group.
    lag_s: float | None = None
    response_s: float | None = None
    ends: Ends | None = None  # Of its columns, between which the size is.
    own_slopes: OwnSlopes | None = None  # How it differs from drive to drive; None: it does not, that one could tell.
    passage: Passage | None = None  # The path through a typical bend, say.


E = TypeVar("E", bound=Effect)


def proper(effects: Sequence[Effect], kind: type[E]) -> E:
    """The effect proper of what a term's `estimate` gave."""
    assert isinstance(effects[0], kind)
    return effects[0]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a test says."""

    term: Term | None  # To be added, or None: nothing that could be.
    columns: tuple[str, ...]
    p_value: float  # Family-wise over everything that the test tried.
    after: Fitted | None = None  # Fit with the term, where the test has made it.
    together: tuple[Term, ...] = ()  # Found with it, as one finding.
    instead_of: Term | None = None  # Whose place it takes.
    unsure: bool = False  # Whether a part of a table, which need not be sure of what it takes, might take another.
    own_way: float | None = None  # p-value of a change within drives, where each changes in its own way.


class Term(ABC):
    """One term. Frozen and small; sizes are in the fit, not in the term."""

    component: ClassVar[str]  # Key of its share of the error budget.
    kind: ClassVar[str]  # As in the report's schema.
    stages: ClassVar[tuple[Stage, ...]] = ()  # At which it is tested; none: with another term, which it competes with.
    # Among those of a stage: smaller ones are asked first, and first where two are equally sure; then by name. [-]
    place: ClassVar[int] = 0
    weight: ClassVar[float]  # Of its component in the error budget; one for each kind of hidden effect. [-]
    # Whether the mean or the innovations' scale follow terms of this class on held-out rows: not the latent path of a
    # cycle, nor what changes the slow movement alone.
    seen_held_out: ClassVar[bool] = True

    @property
    def columns(self) -> tuple[str, ...]:
        """Context columns that it reads; empty: hidden."""
        return ()

    @property
    def alike(self) -> Alternatives:
        """Columns of each other effect that explains as much."""
        return ()

    def predictable(self, fitted: Fitted) -> bool:
        """Whether the model's likelihood of rows that it was not fitted on can tell this term from nothing."""
        return self.seen_held_out

    @property
    def kind_key(self) -> str:
        """Names its groups of summary statistics."""
        return self.component

    def mean_columns(self, coarse: Coarse) -> FloatArray:
        """Columns of the mean, shape (n, k). [any unit]"""
        return np.zeros((len(coarse), 0))

    def fine_mean_columns(self, coarse: Coarse) -> FloatArray:
        """The same columns of the mean on the 0.2 s grid, shape (fine n, k). [any unit]"""
        return on_fine_grid(self.mean_columns(coarse), coarse.timeline)

    def scale_columns(self, coarse: Coarse) -> FloatArray:
        """Columns of the log scale, shape (n, j). [any unit]"""
        return np.zeros((len(coarse), 0))

    def size_columns(self, coarse: Coarse) -> FloatArray:
        """Columns with which the movement's size changes, in whatever measure, shape (n, i): no other term's doing."""
        return self.scale_columns(coarse)

    def known_scale(self, coarse: Coarse) -> FloatArray | None:
        """Log scale that is known as a whole, shape (n,). [-]"""
        return None

    def may_be_explained_by(self, later: Term, coarse: Coarse) -> bool:
        """Whether a term that was found later may be why this one was found: a column is why a hidden effect was."""
        return bool(later.columns) and not self.columns

    @classmethod
    def asks_as(cls, other: Term) -> bool:
        """Whether it asks what another term answers: of a column, whether it acts on the mean, or on the size."""
        return cls.component == other.component or (bool(other.columns) and cls.kind == other.kind)

    @classmethod
    def passes(cls, search: Search, p_value: float, fitted: Fitted) -> bool:
        """Whether the best that was found of its component is good enough to be added to the terms fitted."""
        if p_value <= search.levels[cls.component]:
            return True
        there = sum(term.component == cls.component for term in fitted.terms)
        return search.wanted is not None and there < search.wanted.get(cls.component, 0)

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Test for one more term of this kind beside those fitted; None: there is no candidate."""
        return None

    def probability_beside(self, search: Search, fitted: Fitted) -> float:
        """p-value of this very finding beside the terms fitted, which it is not one of."""
        test = type(self).test(search, fitted)
        return test.p_value if test is not None and test.term is not None and self.matches(test.term) else 1.0

    @abstractmethod
    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """What the profile gets: the effect proper first, then what goes with it."""

    def removed(self, fitted: Fitted, effects: tuple[Effect, ...]) -> Sequence[tuple[Acts, FloatArray]]:
        """What the term did to the measured offsets, on the 0.2 s grid, shape (fine n,) [m] or log factor; hidden terms
        as they most likely did."""
        path = fitted.path(self)
        return [(Acts.LOCATION, on_fine_grid(path - path[fitted.coarse.valid].mean(), fitted.coarse.timeline))]

    def quantity(self, coarse: Coarse, effects: tuple[Effect, ...]) -> FloatArray | None:
        """What the residual is compared by, on the 0.2 s grid, shape (fine n,); None: nothing of its own."""
        return None

    @abstractmethod
    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Size and words; `key` names its group of summary statistics."""

    def matches(self, other: Self) -> bool:
        """Whether another fit's term is the same finding."""
        return type(self) is type(other) and self.columns == other.columns


@dataclass(frozen=True, eq=False)
class Fitted:
    """Terms with sizes, and what is left."""

    coarse: Coarse
    terms: tuple[Term, ...]
    whitener: Whitener
    columns: FloatArray  # shape (n, k): Of the mean, term by term.
    sizes: FloatArray  # shape (k,): [m] per unit.
    covariance: FloatArray  # shape (k, k): [m] per unit.
    levels: FloatArray  # shape (drives,): Mean offset of every drive where all mean terms are at their mean. [m]
    log_sizes: FloatArray  # shape (j,): Natural logarithm per unit.
    log_covariance: FloatArray  # shape (j, j): Natural logarithm per unit.
    movement: FloatArray  # shape (n,): Offset less level and mean terms, over the scale; 0 where invalid. [m]
    starts: FloatArray  # shape (order + 1,): Factor on the errors of the first rows of runs, for the likelihood.
    log_likelihood: float  # Gaussian, of the valid rows.
    _effects: dict[Term, tuple[Effect, ...]] = field(default_factory=dict, init=False, repr=False)

    @property
    def scale(self) -> FloatArray:
        """Factor on the movement, > 0, shape (n,). [-]"""
        return self.whitener.scale

    @cached_property
    def innovations(self) -> FloatArray:
        """Whitened by the movement without measurement noise: how large it is just now. Shape (n,), variance 1."""
        coarse = self.coarse
        moved = coarse.offset - self.levels[coarse.drive]
        rows = innovations(moved, self.columns @ self.sizes, coarse.valid, coarse.drive, self.scale)
        variance = float(rows @ rows) / max(1, int(coarse.valid.sum()) - len(self.sizes))
        return np.asarray(rows / np.sqrt(max(variance, 1e-300)))

    @property
    def explained(self) -> FloatArray:
        """Levels and mean terms on the 0.2 s grid, shape (fine n,). [m]"""
        timeline = self.coarse.timeline
        columns = [np.zeros((len(timeline), 0)), *(term.fine_mean_columns(self.coarse) for term in self.terms)]
        return np.concatenate(columns, axis=1) @ self.sizes + self.levels[timeline.drive]

    @cached_property
    def estimates(self) -> Mapping[str, tuple[Term, tuple[Effect, ...]]]:
        """Every term and what the profile gets for it, by component and number ("mean 0", "step 0")."""
        estimates: dict[str, tuple[Term, tuple[Effect, ...]]] = {}
        for term in self.terms:
            number = sum(1 for key in estimates if key.rpartition(" ")[0] == term.kind_key)
            estimates[f"{term.kind_key} {number}"] = (term, self.effects_of(term))
        return estimates

    def effects_of(self, term: Term) -> tuple[Effect, ...]:
        """What the profile gets for one of the terms."""
        if term not in self._effects:
            self._effects[term] = term.estimate(self)
        return self._effects[term]

    def mean_part(self, term: Term) -> slice:
        """Where a term's coefficients of the mean are."""
        return self._part(term, [other.mean_columns(self.coarse).shape[1] for other in self.terms])

    def scale_part(self, term: Term) -> slice:
        """Where a term's coefficients of the log scale are."""
        return self._part(term, [other.scale_columns(self.coarse).shape[1] for other in self.terms])

    def _part(self, term: Term, widths: Sequence[int]) -> slice:
        first = sum(widths[: (index := next(i for i, other in enumerate(self.terms) if other is term))])
        return slice(first, first + widths[index])

    def path(self, term: Term) -> FloatArray:
        """A term's part of the mean, shape (n,). [m]"""
        return np.asarray(term.mean_columns(self.coarse) @ self.sizes[self.mean_part(term)])


def design_of(coarse: Coarse, terms: Sequence[Term]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Columns of the mean and of the log scale, shape (n, k) and (n, j), and the log scale known as a whole."""
    none = np.zeros((len(coarse), 0))
    columns = np.concatenate([none, *(term.mean_columns(coarse) for term in terms)], axis=1)
    scales = np.concatenate([none, *(term.scale_columns(coarse) for term in terms)], axis=1)
    known = [scale for term in terms if (scale := term.known_scale(coarse)) is not None]
    return columns, scales, np.sum(known, axis=0) if known else np.zeros(len(coarse))


def fit_model(coarse: Coarse, terms: Sequence[Term]) -> Fitted:
    """Fit all terms jointly: generalised least squares and the autoregression by turns."""
    fitted: Fitted = coarse.once(tuple(terms), lambda: _fit(coarse, tuple(terms)))
    return fitted


def _fit(coarse: Coarse, terms: tuple[Term, ...]) -> Fitted:
    columns, scales, known = design_of(coarse, terms)
    valid, drive = coarse.valid, coarse.drive
    sizes, log_sizes, log_covariance = np.zeros(columns.shape[1]), np.zeros(scales.shape[1]), np.zeros((0, 0))
    levels, spread = coarse.by_drive(coarse.offset), np.ones(coarse.drives)
    for _ in range(ROUNDS):
        scale = np.exp(scales @ log_sizes + known) * spread[drive]
        movement = np.where(valid, (coarse.offset - columns @ sizes - levels[drive]) / scale, 0.0)
        process = fit_autoregression(movement, valid, ORDER, longest=MAXIMUM_ORDER, noise=MEASUREMENT_NOISE)
        if not coarse.lasts:
            process = unbiased(process, valid, drive, ORDER, longest=MAXIMUM_ORDER)
        whitener = Whitener(process, valid, drive, scale)
        observed, design = whitener.rows(coarse.offset), whitener.rows(columns)
        sizes, covariance = clustered_least_squares(design, observed, coarse.cluster)
        rows = observed - design @ sizes
        levels = whitener.levels(coarse.offset - columns @ sizes)
        if scales.shape[1]:
            step, log_covariance = scoring_step(scales, rows, coarse)
            log_sizes = bounded(log_sizes + step, scales[valid])
        spread = spread * np.sqrt(own_levels(clipped_squares(rows, valid), valid, drive))
    clusters = len(np.unique(coarse.cluster[design.any(axis=1)]))
    starts = start_factors(rows, valid, process.order)
    factor = whitener.by_position(starts)
    densities = -0.5 * np.square(rows / factor) - np.log(factor * whitener.deviations)
    return Fitted(
        coarse=coarse,
        terms=tuple(terms),
        whitener=whitener,
        columns=columns,
        sizes=sizes,
        covariance=covariance * small_sample_factor(clusters, *design.shape),
        levels=levels,
        log_sizes=log_sizes,
        log_covariance=log_covariance,
        movement=np.where(valid, coarse.offset - columns @ sizes - levels[drive], 0.0) / scale,
        starts=starts,
        log_likelihood=float(np.sum(densities[valid])),
    )


def own_levels(squares: FloatArray, valid: BoolArray, drive: IntArray) -> FloatArray:
    """Mean square of every drive over that of all, shape (drives,); 1 for a single drive, near 1 for short ones."""
    groups = int(drive.max()) + 1
    if groups == 1 or not valid.any():
        return np.ones(groups)
    relative = squares / max(float(squares[valid].mean()), 1e-300)
    seconds = np.bincount(drive, valid.astype(float), minlength=groups)
    sums = np.bincount(drive, np.where(valid, relative, 0.0), minlength=groups)
    return np.asarray((sums + OWN_LEVEL_S) / (seconds + OWN_LEVEL_S))


def clipped_squares(rows: FloatArray, valid: BoolArray) -> FloatArray:
    """Squares over their mean where valid, at most `CLIP`, shape (n,). [-]"""
    return np.asarray(np.minimum(np.square(rows) / max(float(np.mean(rows[valid] ** 2)), 1e-300), CLIP))


def scoring_step(scales: FloatArray, rows: FloatArray, coarse: Coarse) -> tuple[FloatArray, FloatArray]:
    """One Fisher-scoring step [-], shape (j,), for log sd = scales . sizes (variance of a squared normal is 2), and the
    sizes' covariance, shape (j, j).

    The covariance is a sandwich, clustered like that of the mean: squares have heavy tails and come in clusters.
    """
    valid = coarse.valid
    means = np.stack([coarse.by_drive(column) for column in scales.T], axis=1)
    design, squares = (scales - means[coarse.drive])[valid], clipped_squares(rows, valid)[valid]
    bread, excess = np.linalg.pinv(2.0 * design.T @ design), squares / squares.mean() - 1.0
    edges = np.flatnonzero(np.diff(np.flatnonzero(valid) // CLUSTER_S, prepend=-1))
    sums = np.add.reduceat(design * excess[:, None], edges, axis=0)
    covariance = bread @ (sums.T @ sums) @ bread * len(sums) / max(1, len(sums) - 1)
    return np.asarray(bread @ (design.T @ excess)), np.asarray(covariance)


def bounded(log_sizes: FloatArray, scales: FloatArray) -> FloatArray:
    """Log sizes [-], shape (j,), scaled down as a whole so that no row's log scale is beyond `MOST_LOG_SCALE`."""
    reach = float(np.max(np.abs(scales @ log_sizes), initial=0.0))
    return log_sizes * min(1.0, MOST_LOG_SCALE / max(reach, 1e-300))


def _whitener(left: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray) -> Whitener:
    """What turns a movement, 0 where invalid, into independent rows, without measurement noise."""
    return Whitener(fit_autoregression(left / scale, valid, ORDER, longest=MAXIMUM_ORDER), valid, drive, scale)


def innovations(
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray
) -> FloatArray:
    """White rows of variance about 1, shape (n,), young runs by their own size, of offsets less responses [m]."""
    if np.any(responses):
        responses = smoothed_as_seen(moved, responses, valid, drive, scale)
    left = np.where(valid, moved - responses, 0.0)
    whitener = _whitener(left, valid, drive, scale)
    rows = whitener.rows(left)
    return np.asarray(rows / whitener.by_position(start_factors(rows, valid, whitener.process.order)))


def smoothed_as_seen(
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray
) -> FloatArray:
    """Responses through the filter of 5 s and gain 1 that leaves least of them: providers smooth them. [m]"""
    whitener = _whitener(np.where(valid, moved, 0.0), valid, drive, scale)
    seconds = np.arange(len(responses))
    shifted = [responses[np.clip(seconds - shift, 0, len(seconds) - 1)] for shift in SMOOTHING_S]
    changes = np.stack(shifted, axis=1) - responses[:, None]
    weights = np.linalg.lstsq(whitener.rows(changes), whitener.rows(moved - responses), rcond=None)[0]
    return np.asarray(responses + changes @ weights)
