"""The one model of a drive, and the fit of all its terms together.

offset = level of the drive + mean terms + scale * movement, the movement an autoregression at 1 Hz, log scale = level
of the drive + scale terms. Mean terms are fitted jointly by generalised least squares, scale terms by iterated
regression of squared innovations [1]_: adding a term corrects the ones found before.

References
----------
.. [1] M. Aitkin, "Modelling variance heterogeneity in normal regression using GLIM", Applied Statistics 36, 1987.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from msgspec import structs

from xosc_lateral.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.driver.effects import Acts, ColumnEffect, Effect
from xosc_lateral.identification.autocorrelation import Whitener, fit_autoregression, start_factors, unbiased
from xosc_lateral.identification.innovations import (
    LONGEST,
    ORDER,
    bounded,
    clipped_squares,
    covariance_of_log_sizes,
    innovations,
    own_levels,
    scoring_step,
)
from xosc_lateral.identification.timeline import Timeline, coarse_all, coarse_mean, coarse_middle, means_by_drive

if TYPE_CHECKING:
    from xosc_lateral.identification.terms.base import Term

# White noise that the model of a drive has beside what it shows: no table knows the lane better (in the motorway
# recording the standard error of a lane's centre is 0.03 m; docs/real_data.md). Providers smooth their tracks,
# responses and all; without a floor an effect is sized where the smoothing left nothing of it. [m]
FLOOR = 0.03
# Stretches of a drive that count as independent in the errors of sizes: far beyond what whitening leaves of the memory,
# and the whole of a passing vehicle. [s]
CLUSTER_S = 60
ROUNDS = 4  # Turns of sizes, autoregression and scale; they settle in three.
MIN_DRIFT_S = 600.0  # A shorter drive tells nothing about drift or a trend of the variance. [s]


@dataclass(frozen=True, eq=False)
class Coarse:
    """The timeline at 1 Hz, and every column effect's response on it."""

    timeline: Timeline
    offset: FloatArray  # shape (n,): Mean of each second. [m]
    valid: BoolArray  # shape (n,)
    drive: IndexArray  # shape (n,)
    time: FloatArray  # shape (n,): [s]
    # Columns on the fine grid, lane width included, clipped to what occurs while road-following: a traffic jam that is
    # cut out must not stretch a column's range.
    context: Mapping[str, FloatArray]
    _responses: dict[ColumnEffect, FloatArray] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, timeline: Timeline) -> Coarse:
        """Average to 1 Hz."""
        columns = {"lane_width": timeline.lane_width, **timeline.context}
        return cls(
            timeline,
            coarse_mean(timeline.offset),
            coarse_all(timeline.valid),
            coarse_middle(timeline.drive),
            coarse_mean(timeline.time),
            {name: _within(values, timeline.valid) for name, values in columns.items()},
        )

    def __len__(self) -> int:
        return len(self.offset)

    def only(self, rows: BoolArray) -> Coarse:
        """The same with fewer valid rows; `rows`: shape (n,)."""
        return replace(self, valid=self.valid & rows, _responses={})

    @property
    def drives(self) -> int:
        """Number of drives."""
        return int(self.drive.max()) + 1

    @cached_property
    def cluster(self) -> IndexArray:
        """Clusters: minutes within drives, numbered, shape (n,); they count as independent of each other."""
        _, first = np.unique(self.drive, return_index=True)
        minute = (np.arange(len(self)) - first[self.drive]) // CLUSTER_S
        _, cluster = np.unique(self.drive * len(self) + minute, return_inverse=True)
        return cluster.astype(np.intp)

    @property
    def lasts(self) -> bool:
        """Whether a drive is long enough to change with time: minutes, not the minute of a passing vehicle."""
        return bool(np.bincount(self.drive, self.valid.astype(float)).max() >= MIN_DRIFT_S)

    def response(self, effect: ColumnEffect, *, keep: bool = False) -> FloatArray:
        """The effect's quantity [own unit] as the driver responds to it, less its mean where valid; shape (n, k)."""
        key = structs.replace(
            effect, acts=Acts.LOCATION, coefficients=(), errors=(), reference=(), between_drivers=(), response_range=()
        )
        if key in self._responses:
            return self._responses[key]
        response = coarse_mean(self.fine_response(key))
        response = response - response[self.valid].mean(axis=0)
        if keep:
            self._responses[key] = response
        return np.asarray(response, dtype=np.float64)

    def fine_response(self, effect: ColumnEffect) -> FloatArray:
        """The same on the 0.2 s grid, as it is, shape (fine n, k). [own unit]"""
        return self.timeline.response(effect, self.context)

    def strength(self, effect: ColumnEffect) -> FloatArray:
        """What an effect of columns that the table has does on the 0.2 s grid, shape (fine n,). [m], or log factor"""
        return effect.weighed(self.fine_response(effect))

    def by_drive(self, values: FloatArray) -> FloatArray:
        """Mean over the valid rows of each drive, shape (drives,), in the values' unit; 0 where there are none."""
        return means_by_drive(values, self.valid, self.drive)


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

    @property
    def scale(self) -> FloatArray:
        """Factor on the movement, > 0, shape (n,). [-]"""
        return self.whitener.scale

    @cached_property
    def innovations(self) -> FloatArray:
        """Whitened by the movement as it is seen, without a floor: how large it is just now. Shape (n,), variance 1."""
        coarse = self.coarse
        moved = coarse.offset - self.levels[coarse.drive]
        rows = innovations(moved, self.columns @ self.sizes, coarse.valid, coarse.drive, self.scale)
        variance = float(rows @ rows) / max(1, int(coarse.valid.sum()) - len(self.sizes))
        return np.asarray(rows / np.sqrt(max(variance, 1e-300)))

    @property
    def explained(self) -> FloatArray:
        """Levels and mean terms on the 0.2 s grid, shape (fine n,). [m]"""
        timeline = self.coarse.timeline
        columns = joined([term.fine_mean_columns(self.coarse) for term in self.terms], len(timeline))
        return columns @ self.sizes + self.levels[timeline.drive]

    @cached_property
    def estimates(self) -> Mapping[str, tuple[Term, tuple[Effect, ...]]]:
        """Every term and what the profile gets for it, by component and number ("mean 0", "step 0")."""
        found: dict[str, tuple[Term, tuple[Effect, ...]]] = {}
        for term in self.terms:
            number = sum(1 for key in found if key.rpartition(" ")[0] == term.kind_key)
            found[f"{term.kind_key} {number}"] = (term, term.estimate(self))
        return found

    def mean_part(self, term: Term) -> slice:
        """Where a term's coefficients of the mean are."""
        return self._part(term, [other.mean_columns(self.coarse).shape[1] for other in self.terms])

    def scale_part(self, term: Term) -> slice:
        """Where a term's coefficients of the log scale are."""
        return self._part(term, [other.scale_columns(self.coarse).shape[1] for other in self.terms])

    def _part(self, term: Term, widths: Sequence[int]) -> slice:
        index = next(i for i, other in enumerate(self.terms) if other is term)
        first = sum(widths[:index])
        return slice(first, first + widths[index])


def design_of(coarse: Coarse, terms: Sequence[Term]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Columns of the mean and of the log scale, term by term, shape (n, k) and (n, j), and the log scale that terms
    know as a whole, shape (n,). [-]"""
    columns = joined([term.mean_columns(coarse) for term in terms], len(coarse))
    scales = joined([term.scale_columns(coarse) for term in terms], len(coarse))
    known = [scale for term in terms if (scale := term.known_scale(coarse)) is not None]
    return columns, scales, np.sum(known, axis=0) if known else np.zeros(len(coarse))


def fit_model(coarse: Coarse, terms: Sequence[Term]) -> Fitted:
    """Fit all terms jointly: generalised least squares and the autoregression by turns."""
    columns, scales, known = design_of(coarse, terms)
    valid, drive = coarse.valid, coarse.drive
    sizes, log_sizes = np.zeros(columns.shape[1]), np.zeros(scales.shape[1])
    levels, spread = coarse.by_drive(coarse.offset), np.ones(coarse.drives)
    for _ in range(ROUNDS):
        scale = np.exp(scales @ log_sizes + known) * spread[drive]
        movement = np.where(valid, (coarse.offset - columns @ sizes - levels[drive]) / scale, 0.0)
        process = fit_autoregression(movement, valid, ORDER, longest=LONGEST, floor=FLOOR)
        if not coarse.lasts:
            process = unbiased(process, valid, drive, ORDER, longest=LONGEST)
        whitener = Whitener(process, valid, drive, scale)
        observed, design = whitener.rows(coarse.offset), whitener.rows(columns)
        sizes, covariance = clustered_least_squares(design, observed, coarse.cluster)
        rows = observed - design @ sizes
        levels = whitener.levels(coarse.offset - columns @ sizes)
        if scales.shape[1]:
            log_sizes = bounded(log_sizes + scoring_step(scales, rows, valid, drive), scales[valid])
        spread = spread * np.sqrt(own_levels(clipped_squares(rows, valid), valid, drive))
    starts = start_factors(rows, valid, process.order)
    factor = whitener.by_position(starts)
    densities = -0.5 * np.square(rows / factor) - np.log(factor * whitener.deviations)
    return Fitted(
        coarse=coarse,
        terms=tuple(terms),
        whitener=whitener,
        columns=columns,
        sizes=sizes,
        covariance=covariance,
        levels=levels,
        log_sizes=log_sizes,
        log_covariance=covariance_of_log_sizes(scales, rows, valid, drive),
        movement=np.where(valid, coarse.offset - columns @ sizes - levels[drive], 0.0) / scale,
        starts=starts,
        log_likelihood=float(np.sum(densities[valid])),
    )


def _within(values: FloatArray, valid: BoolArray) -> FloatArray:
    seen = values[valid & np.isfinite(values)]
    return np.where(np.isinf(values), values, np.clip(values, seen.min(), seen.max())) if len(seen) else values


def joined(blocks: Sequence[FloatArray], n: int) -> FloatArray:
    """Columns side by side, shape (n, k); none of none."""
    return np.concatenate(blocks, axis=1) if blocks else np.zeros((n, 0))


def clustered_least_squares(
    design: FloatArray, observed: FloatArray, cluster: IndexArray
) -> tuple[FloatArray, FloatArray]:
    """Sizes, and a sandwich for their covariance, clustered [1]_.

    Loud seconds come together, and a column may come with them; and what whitening leaves of the memory counts too.

    `design`, shape (n, k), and `observed`, shape (n,): whitened; `cluster`, shape (n,): of each row. Sizes have shape
    (k,), their covariance (k, k).

    References
    ----------
    .. [1] K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
    """
    if design.shape[1] == 0:
        return np.zeros(0), np.zeros((0, 0))
    inverse = np.linalg.pinv(design.T @ design)
    sizes = inverse @ (design.T @ observed)
    scores = design * (observed - design @ sizes)[:, None]
    scores = np.stack([np.bincount(cluster, column) for column in scores.T], axis=1)
    clusters = int(np.count_nonzero(scores.any(axis=1)))
    freedom = clusters / max(1, clusters - 1) * (len(observed) - 1) / max(1, len(observed) - design.shape[1])
    return sizes, np.asarray(inverse @ (scores.T @ scores) @ inverse * freedom, dtype=np.float64)
