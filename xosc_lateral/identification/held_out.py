"""Runs of both profiles on held-out rows, and what they look like in summary statistics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from msgspec import structs

from xosc_lateral.driver.effects import ColumnEffect, Effect, TimeSmooth
from xosc_lateral.driver.fitting import fit_population, fit_runs
from xosc_lateral.driver.models.base import ModelKind
from xosc_lateral.driver.place import COLUMNS as KNOWN_TO_THE_BASE
from xosc_lateral.driver.profile import COLUMNS, DriverProfile, Provenance
from xosc_lateral.drives.cuts import MIN_RUN
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.filters import filtered
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.errors import NotEnoughDataError
from xosc_lateral.evaluation.distances import Distances, mean_distances, metric_distances
from xosc_lateral.evaluation.metrics import METRICS, snippet_metrics
from xosc_lateral.identification.columns import Column
from xosc_lateral.identification.cross_validation import Nested, folds_of
from xosc_lateral.identification.regression import Coarse, Fitted, fit_model
from xosc_lateral.identification.residual import (
    SummaryStatistics,
    error_between,
    expected,
    half_samples,
    simulated_runs,
    size_of,
    statistics_of,
)
from xosc_lateral.identification.selection import Selection
from xosc_lateral.identification.significance import LoopSeed
from xosc_lateral.identification.terms.base import Removal, Term
from xosc_lateral.identification.terms.cycle import CycleTerm
from xosc_lateral.identification.terms.time import StepTerm
from xosc_lateral.identification.timeline import COARSE, BoolArray, FloatArray, IntArray, Timeline
from xosc_lateral.rows import true_slices

FINE_S = 1.0  # Movement within this time counts as fine when a spread is taken out. [s]
# By key ("mean 0", "step 0"): a term and what the profile gets for it.
Estimates = Mapping[str, tuple[Term, tuple[Effect, ...]]]


def estimate_all(fitted: Fitted) -> Estimates:
    """Sizes of everything in the model; the key counts terms of one component."""
    found: dict[str, tuple[Term, tuple[Effect, ...]]] = {}
    for term in fitted.terms:
        assert isinstance(term, Term)
        number = sum(1 for key in found if key.rpartition(" ")[0] == term.kind_key)
        found[f"{term.kind_key} {number}"] = (term, term.estimate(fitted))
    return found


def removal_of(fitted: Fitted, estimates: Estimates) -> Removal:
    """What all terms did to the measured offsets."""
    removal = Removal(np.zeros(len(fitted.coarse.timeline)))
    for term, effects in estimates.values():
        term.remove(fitted, effects, removal)
    return removal


def runs_without(timeline: Timeline, removal: Removal, used: BoolArray) -> list[Run]:
    """Runs of the movement [m] without effects, from the valid rows in `used`, shape (n,); at least `MIN_RUN` long.

    They know class, lane and speed, as far as the table does: what these do to a population is fitted with its base.
    """
    runs: list[Run] = []
    for index, name in enumerate(timeline.names):
        for rows in true_slices(timeline.valid & used & (timeline.drive == index)):
            if (rows.stop - rows.start) * STEP >= MIN_RUN:
                runs.append(_run(timeline, removal, rows, name, len(runs)))
    return runs


def movement_without(timeline: Timeline, removal: Removal, rows: slice, mean: float | None = None) -> FloatArray:
    """Offsets of one uninterrupted stretch without the effects, about their own mean or a given one. [m] Shape (k,)."""
    left = timeline.offset[rows] - removal.location[rows]
    mean = float(left.mean()) if mean is None else mean
    slow = _smooth(left)
    spread, fine = np.exp(-removal.spread[rows]), np.exp(-removal.fine[rows])
    return np.asarray(mean + (slow - mean) * spread + (left - slow) * fine)


def _run(timeline: Timeline, removal: Removal, rows: slice, name: str, index: int) -> Run:
    movement = movement_without(timeline, removal, rows)
    width = timeline.lane_width[rows]
    context = {name: timeline.context[name][rows] for name in KNOWN_TO_THE_BASE if name in timeline.context}
    time = timeline.time[rows.start] + STEP * np.arange(len(movement))
    return Run(name, index, time, movement, width, context, frozenset())


def _smooth(values: FloatArray) -> FloatArray:
    width = 2 * round(0.5 * FINE_S / STEP) + 1
    return filtered(values, np.ones(width) / width)


Progress = Callable[[float, str], None]


@dataclass(frozen=True, eq=False)
class Setting:
    """What stays the same when findings are scored."""

    coarse: Coarse
    blocks: IntArray
    fixed: DriverProfile | None
    kind: ModelKind
    refined_kind: ModelKind
    root: np.random.SeedSequence

    def rng(self, key: LoopSeed) -> np.random.Generator:
        """Source of chance for one purpose."""
        return np.random.default_rng(np.random.SeedSequence(self.root.entropy, spawn_key=(key,)))


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Summary statistics on held-out blocks, measured and expected of both profiles."""

    statistics: SummaryStatistics
    real: dict[str, FloatArray]  # By group. [m]
    before: dict[str, FloatArray]  # By group. [m]
    after: dict[str, FloatArray]  # By group. [m]
    runs_before: FloatArray  # shape (runs, n): Of the profiles. [m]
    runs_after: FloatArray  # shape (runs, n): Of the profiles. [m]
    halves: list[dict[str, FloatArray]]  # See `residual.half_samples`. [m]

    @property
    def errors(self) -> tuple[float, float]:
        """Errors before and after. [m]"""
        return error_between(self.real, self.before), error_between(self.real, self.after)

    def error_of(self, group: str) -> tuple[float, float]:
        """Errors before and after in one group; 0 where there is none. [m]"""
        if group not in self.real:
            return 0.0, 0.0
        before, after = (size_of({"": self.real[group] - side[group]}) for side in (self.before, self.after))
        return before, after


def score_held_out(
    setting: Setting, selection: Selection, nested: Nested | None, columns: list[Column], progress: Progress
) -> HeldOut:
    """Describe measured offsets and both profiles' runs; `nested` None: nothing is kept."""
    timeline, fitted = setting.coarse.timeline, selection.final
    statistics = statistics_of(timeline, _quantities(selection, columns), _frequency(fitted))
    kept = tuple(one.term for one in selection.accepted)
    runs_before, runs_after = _held_out_runs(setting, nested, kept, selection.start, progress)
    real = statistics.describe(timeline.offset, timeline.valid)
    before = expected(statistics, runs_before, timeline.valid)
    after = before if runs_after is runs_before else expected(statistics, runs_after, timeline.valid)
    unmoved = timeline.offset - removal_of(fitted, estimate_all(fitted)).location
    halves = half_samples(statistics, unmoved, setting.blocks, setting.rng(LoopSeed.BLOCKS))
    return HeldOut(statistics, real, before, after, runs_before, runs_after, halves)


def _held_out_runs(
    setting: Setting, nested: Nested | None, kept: tuple[Term, ...], start: Fitted, progress: Progress
) -> tuple[FloatArray, FloatArray]:
    """Runs of base and refined profile over all rows, each row's by profiles chosen and fitted without its fold."""
    blocks, coarse = setting.blocks, setting.coarse
    folds = folds_of(blocks)
    same = setting.kind is setting.refined_kind and not kept
    own = None if nested is None else nested.only(kept)
    sides: list[FloatArray | None] = [None, None]
    for fold in range(folds):
        progress(0.6 + 0.3 * fold / folds, f"held-out fold {fold + 1} of {folds}")
        held = blocks % folds == fold
        used = ~held if folds > 1 else np.ones(len(held), dtype=np.bool_)
        part = coarse.only(used[COARSE // 2 :: COARSE][: len(coarse)])
        without = fit_model(part, start.terms)
        before = setting.fixed or fit_without(without, estimate_all(without), used, setting.kind, "before", None)
        profiles = [before]
        if not same:
            fitted = without if own is None else own.selections[fold].final
            profiles.append(fit_without(fitted, estimate_all(fitted), used, setting.refined_kind, "after", None))
        for side, profile in enumerate(profiles):
            # the same luck for both sides and all folds: what differs is the profile, and runs go on from fold to fold
            seed = np.random.SeedSequence(setting.root.entropy, spawn_key=(LoopSeed.FOLDS,))
            runs = simulated_runs(profile, coarse.timeline, seed, held=held)
            whole = sides[side]
            if whole is None:
                whole = sides[side] = np.zeros_like(runs)
            whole[:, held] = runs[:, held]
    before_runs, after_runs = sides
    assert before_runs is not None
    return before_runs, before_runs if after_runs is None else after_runs


def fit_without(
    fitted: Fitted, estimates: Estimates, used: BoolArray, kind: ModelKind, name: str, provenance: Provenance | None
) -> DriverProfile:
    """Base model of what is left without the effects, and the effects.

    Of a population the base holds what class, lane and speed do to the rest, as `fit` has it; the paper's has not.
    What neighbours do is for the loop to find.
    """
    runs = runs_without(fitted.coarse.timeline, removal_of(fitted, estimates), used)
    if not runs:
        raise NotEnoughDataError("closing the loop: no run of 10 s is left to fit the base model on")
    if kind is ModelKind.TWO_LEVEL:
        profile = fit_runs(runs, name=name, model=kind, provenance=provenance)
    else:
        profile = fit_population(runs, name=name, model=kind, provenance=provenance, neighbours=False)
    effects: tuple[Effect, ...] = tuple(effect for _, own in estimates.values() for effect in own)
    read = {column for effect in effects for column in effect.columns}  # what they say is measured, and taken out here
    beside = {side: one for side, one in profile.beside.items() if read.isdisjoint(COLUMNS[side])}
    return structs.replace(profile, effects=(*profile.effects, *effects), beside=beside)


def _quantities(selection: Selection, columns: list[Column]) -> dict[str, FloatArray]:
    """What the residual is binned by: every column that may act, and every found effect's own quantity."""
    fitted = selection.final
    coarse = fitted.coarse
    quantities = {column.name: coarse.context[column.name] for column in columns}
    for column in columns:
        if column.period:
            angle = 2.0 * np.pi / column.period * quantities.pop(column.name)
            quantities |= {f"sin({column.name})": np.sin(angle), f"cos({column.name})": np.cos(angle)}
    for key, (term, effects) in estimate_all(fitted).items():
        effect = effects[0] if effects else None
        if isinstance(effect, ColumnEffect):
            quantities[f"effect: {key}"] = coarse.strength(effect)
        elif isinstance(effect, TimeSmooth):
            path = effect.path(effect.location or effect.spread, coarse.timeline.time)
            quantities[f"effect: {key}"] = path
        elif isinstance(term, StepTerm):
            quantities[f"effect: {key}"] = (np.arange(len(coarse.timeline)) >= term.at * COARSE).astype(float)
    return quantities


def _frequency(fitted: Fitted) -> float | None:
    return next((term.frequency for term in fitted.terms if isinstance(term, CycleTerm)), None)


SNIPPET_ROWS = 51  # 10 s at 5 Hz, both ends included.
SPLITS = 6  # Random halves of the blocks that distances are averaged over.


@dataclass(frozen=True, eq=False)
class Scorecard:
    """Wasserstein distances per metric, in standard deviations of the measured one; None: too few snippets.

    The metrics themselves, shape (snippets, 10), are for violins. [m]
    """

    before: Distances | None
    after: Distances | None
    floor: Distances | None
    real: FloatArray
    sampled_before: FloatArray
    sampled_after: FloatArray


def score_runs(
    timeline: Timeline, before: FloatArray, after: FloatArray, blocks: IntArray, rng: np.random.Generator
) -> Scorecard:
    """Cut offsets [m], shape (n,), and runs, shape (runs, n), into the same snippets and compare."""
    starts = _starts(timeline)
    rows = starts[:, None] + np.arange(SNIPPET_ROWS)
    if len(starts) < 8:
        empty = np.zeros((0, len(METRICS)))
        return Scorecard(None, None, None, empty, empty, empty)
    real = snippet_metrics(timeline.offset[rows])
    one, other = snippet_metrics(before[0][rows]), snippet_metrics(after[0][rows])
    of_block = blocks[starts]
    numbers = np.unique(of_block)
    gathered: tuple[list[Distances], list[Distances], list[Distances]] = ([], [], [])
    for split in range(SPLITS):
        half = np.isin(of_block, rng.permutation(numbers)[: max(1, len(numbers) // 2)])
        if half.sum() < 3 or (~half).sum() < 3:
            continue
        run = split % len(before)
        sampled = (snippet_metrics(runs[run][rows[~half]]) for runs in (before, after))
        for place, metrics in zip(gathered, (*sampled, real[~half]), strict=True):
            place.append(metric_distances(real[half], metrics))
    if not gathered[0]:
        return Scorecard(None, None, None, real, one, other)
    means = [mean_distances(several) for several in gathered]
    return Scorecard(means[0], means[1], means[2], real, one, other)


def _starts(timeline: Timeline) -> IntArray:
    starts, at, n = [], 0, len(timeline)
    sums = np.concatenate([[0], np.cumsum(timeline.valid)])
    while at + SNIPPET_ROWS <= n:
        inside = sums[at + SNIPPET_ROWS] - sums[at] == SNIPPET_ROWS
        if inside:
            starts.append(at)
        at += SNIPPET_ROWS if inside else 1
    return np.asarray(starts, dtype=np.intp)
