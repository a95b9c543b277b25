"""Runs of both profiles on held-out rows, and what they look like in summary statistics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, true_slices
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.drivers.drives.drive import MIN_RUN, STEP, Run
from xosc_lateral.drivers.drives.filters import filtered
from xosc_lateral.drivers.evaluation.metrics import (
    METRICS,
    Distances,
    mean_distances,
    metric_distances,
    snippet_metrics,
)
from xosc_lateral.drivers.fitting.context_effects import COLUMNS as KNOWN_TO_THE_BASE
from xosc_lateral.drivers.fitting.fitting import fit_population, fit_runs
from xosc_lateral.drivers.fitting.joined_bands import in_bands, measured
from xosc_lateral.drivers.fitting.models.autoregressive_coarse import FitSettings
from xosc_lateral.drivers.fitting.models.autoregressive_fit import fit_autoregressive
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.core.registry import FitCore
from xosc_lateral.drivers.model.effects import Acts, Effect
from xosc_lateral.drivers.model.profile import COLUMNS, DriverProfile, Provenance
from xosc_lateral.drivers.model.seeds import child, generator
from xosc_lateral.extras.loop import residual
from xosc_lateral.extras.loop.columns import Column
from xosc_lateral.extras.loop.dictionary import tells_drives
from xosc_lateral.extras.loop.identify import Nested, Progress, folds_of, hold_out_blocks
from xosc_lateral.extras.loop.model import Fitted, fit_model
from xosc_lateral.extras.loop.selection import Selection
from xosc_lateral.extras.loop.significance import LoopSeed
from xosc_lateral.extras.loop.terms.hidden import CycleTerm
from xosc_lateral.extras.loop.timeline import Coarse, Timeline, coarse_middle

# Of folds, which 24 runs are drawn of: a thousand drivers move their spreads by 1 %, which is half of what the runs do.
ROUGH = partial(fit_autoregressive, settings=FitSettings(effort=0.25))
FINE_S = 1.0  # Movement within this time counts as fine when a spread is taken out. [s]


def removal_of(fitted: Fitted) -> dict[Acts, FloatArray]:
    """What all terms did to the measured offsets, shape (n,) each: to the mean [m], to the logarithm of a spread."""
    removal = {acts: np.zeros(len(fitted.coarse.timeline)) for acts in Acts}
    for term, effects in fitted.estimates.values():
        for acts, part in term.removed(fitted, effects):
            removal[acts] += part
    return removal


def runs_without(timeline: Timeline, removal: Mapping[Acts, FloatArray], used: BoolArray) -> list[Run]:
    """Runs of the movement without effects, from the valid rows in `used`, with what a population is fitted by."""
    runs: list[Run] = []
    known = {name: timeline.context[name] for name in KNOWN_TO_THE_BASE if name in timeline.context}
    for index, name in enumerate(timeline.names):
        for rows in true_slices(timeline.valid & used & (timeline.drive == index)):
            time = timeline.time[rows.start] + STEP * np.arange(rows.stop - rows.start)
            if len(time) * STEP >= MIN_RUN:
                movement, width = movement_without(timeline, removal, rows), timeline.lane_width[rows]
                context = {column: values[rows] for column, values in known.items()}
                run = Run(name, len(runs), time, movement, width, context)
                runs.append(replace(run, valid_below=timeline.valid_below, resolution=timeline.resolution))
    return runs


def movement_without(timeline: Timeline, removal: Mapping[Acts, FloatArray], rows: slice) -> FloatArray:
    """Offsets of one uninterrupted stretch without the effects, about their own mean. [m] Shape (k,)."""
    left = timeline.offset[rows] - removal[Acts.LOCATION][rows]
    mean, width = float(left.mean()), 2 * round(0.5 * FINE_S / STEP) + 1
    slow = filtered(left, np.ones(width) / width)
    spread, fine = (np.exp(-removal[acts][rows]) for acts in (Acts.SPREAD, Acts.FINE))
    return np.asarray(mean + (slow - mean) * spread + (left - slow) * fine)


@dataclass(frozen=True, eq=False)
class Setting:
    """What stays the same when findings are scored."""

    coarse: Coarse
    fixed: DriverProfile | None  # The base, where one was given.
    kind: ModelKind  # Of the base.
    refined_kind: ModelKind
    root: np.random.SeedSequence

    @cached_property
    def blocks(self) -> IntArray:
        """What is held out."""
        return hold_out_blocks(self.coarse.timeline)


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Summary statistics on held-out blocks, measured and expected of both profiles. [m]"""

    statistics: residual.SummaryStatistics
    real: dict[str, FloatArray]  # By group.
    before: dict[str, FloatArray]
    after: dict[str, FloatArray]
    runs_before: FloatArray  # shape (runs, n): Of the profiles.
    runs_after: FloatArray
    halves: list[dict[str, FloatArray]]  # See `residual.half_samples`.

    @property
    def errors(self) -> tuple[float, float]:
        """Errors before and after. [m]"""
        return residual.error_between(self.real, self.before), residual.error_between(self.real, self.after)

    @property
    def surely_worse(self) -> bool:
        """Whether the error after is the larger one for other drives, too: half samples added to the measured."""
        rises = []
        for half in self.halves:
            other = {name: values + np.nan_to_num(half[name]) for name, values in self.real.items()}
            rises.append(residual.error_between(other, self.after) > residual.error_between(other, self.before))
        return float(np.mean(rises)) >= 1.0 - residual.LEVEL

    def error_of(self, group: str) -> tuple[float, float]:
        """Errors before and after in one group; 0 where there is none. [m]"""
        if group not in self.real:
            return 0.0, 0.0
        before, after = (residual.size_of({"": self.real[group] - side[group]}) for side in (self.before, self.after))
        return before, after


def score_held_out(
    setting: Setting, selection: Selection, nested: Nested | None, columns: list[Column], progress: Progress
) -> HeldOut:
    """Describe measured offsets and both profiles' runs; `nested` None: nothing is kept."""
    timeline, fitted = setting.coarse.timeline, selection.final
    frequency = next((term.frequency for term in fitted.terms if isinstance(term, CycleTerm)), None)
    statistics = residual.statistics_of(timeline, _quantities(fitted, columns), frequency)
    runs_before, runs_after = _held_out_runs(setting, selection, nested, progress)
    real = statistics.describe(timeline.offset, timeline.valid)
    before = residual.expected(statistics, runs_before, timeline.valid)
    after = before if runs_after is runs_before else residual.expected(statistics, runs_after, timeline.valid)
    unmoved = timeline.offset - removal_of(fitted)[Acts.LOCATION]
    halves = residual.half_samples(statistics, unmoved, setting.blocks, generator(setting.root, LoopSeed.BLOCKS))
    return HeldOut(statistics, real, before, after, runs_before, runs_after, halves)


def _held_out_runs(
    setting: Setting, selection: Selection, nested: Nested | None, progress: Progress
) -> tuple[FloatArray, FloatArray]:
    """Runs of base and refined profile over all rows, each row's by profiles chosen and fitted without its fold."""
    coarse, start = setting.coarse, selection.start
    folds = folds_of(setting.blocks)
    sides: list[FloatArray] = [np.zeros(0), np.zeros(0)]
    for fold in range(folds):
        progress(0.6 + 0.3 * fold / folds, f"held-out fold {fold + 1} of {folds}")
        held = setting.blocks % folds == fold
        used = ~held if folds > 1 else np.ones(len(held), dtype=np.bool_)
        without = fit_model(coarse.only(coarse_middle(used)), start.terms)
        profiles = [setting.fixed or fit_without(without, used, setting.kind, "before", None, roughly=True)]
        if selection.accepted or setting.kind is not setting.refined_kind:
            fitted = without if nested is None else nested.scored[fold].final
            profiles.append(fit_without(fitted, used, setting.refined_kind, "after", None, roughly=True))
        for side, profile in enumerate(profiles):
            # the same luck for both sides and all folds: what differs is the profile, and runs go on from fold to fold
            runs = residual.simulated_runs(profile, coarse.timeline, child(setting.root, LoopSeed.FOLDS), held=held)
            sides[side] = sides[side] if len(sides[side]) else np.zeros_like(runs)
            sides[side][:, held] = runs[:, held]
    return sides[0], sides[1] if len(sides[1]) else sides[0]


def fit_without(
    fitted: Fitted, used: BoolArray, kind: ModelKind, name: str, provenance: Provenance | None, *, roughly: bool = False
) -> DriverProfile:
    """Base model of what is left in these rows without the effects, and the effects; `roughly`: for a fold's runs."""
    runs = runs_without(fitted.coarse.timeline, removal_of(fitted), used)
    return _with_effects(fitted, runs, kind, name, provenance, ROUGH if roughly else None)


def _with_effects(
    fitted: Fitted,
    runs: Sequence[Run],
    kind: ModelKind,
    name: str,
    provenance: Provenance | None,
    fit_core: FitCore | None = None,
) -> DriverProfile:
    """Base model of runs, a population's with class, lane and speed as `fit` has it, and the effects."""
    if not runs:
        raise NotEnoughDataError("closing the loop: no run of 10 s is left to fit the base model on")
    if kind is ModelKind.TWO_LEVEL:
        profile = fit_runs(runs, name=name, model=kind, provenance=provenance)
    else:
        profile = fit_population(
            runs, name=name, model=kind, provenance=provenance, neighbours=False, fit_core=fit_core
        )
    effects: tuple[Effect, ...] = tuple(effect for _, own in fitted.estimates.values() for effect in own)
    read = {column for effect in effects for column in effect.columns}  # what they say is measured, and taken out here
    beside = {side: one for side, one in profile.beside.items() if read.isdisjoint(COLUMNS[side])}
    return structs.replace(profile, effects=(*profile.effects, *effects), beside=beside)


def fit_refined(
    fitted: Fitted, kind: ModelKind, name: str, provenance: Provenance | None, base: DriverProfile | None
) -> DriverProfile:
    """The profile that is handed out: of all rows, and what it is valid for.

    Scores are of the movement that the drives show; where they state up to which frequency that is driving, the profile
    has above it what the base has that one began with, as with `fit --prior`; without a base, nothing.
    """
    everything = np.ones(len(fitted.coarse.timeline), dtype=np.bool_)
    runs = runs_without(fitted.coarse.timeline, removal_of(fitted), everything)
    profile = _with_effects(fitted, runs, kind, name, provenance)
    if fitted.coarse.timeline.valid_below is None:
        return structs.replace(profile, validity=measured(runs))
    prior = base if base is not None and base.model.kind == ModelKind.AUTOREGRESSIVE else None
    return in_bands(profile, runs, prior=prior)


def _quantities(fitted: Fitted, columns: list[Column]) -> dict[str, FloatArray]:
    """What the residual is binned by: every column that may act, and every found effect's own quantity."""
    coarse = fitted.coarse
    seen = {column.name: coarse.context[column.name] for column in columns}
    # a drive's own place is no misfit: halves of one drive do not show what places scatter by
    quantities = {name: values for name, values in seen.items() if not tells_drives(values, coarse)}
    for column in columns:
        if column.period and column.name in quantities:
            angle = 2.0 * np.pi / column.period * quantities.pop(column.name)
            quantities |= {f"sin({column.name})": np.sin(angle), f"cos({column.name})": np.cos(angle)}
    for key, (term, effects) in fitted.estimates.items():
        if (quantity := term.quantity(coarse, effects)) is not None:
            quantities[f"effect: {key}"] = quantity
    return quantities


SNIPPET_ROWS = 51  # 10 s at 5 Hz, both ends included.
SPLITS = 6  # Random halves of the blocks that distances are averaged over.


@dataclass(frozen=True, eq=False)
class Scorecard:
    """Wasserstein distances per metric, in standard deviations of the measured one; None: too few snippets."""

    before: Distances | None
    after: Distances | None
    floor: Distances | None  # Between halves of the drives.
    real: FloatArray  # shape (snippets, 10): The metrics themselves, for violins. [m]
    sampled_before: FloatArray
    sampled_after: FloatArray


def score_runs(
    timeline: Timeline, before: FloatArray, after: FloatArray, blocks: IntArray, rng: np.random.Generator
) -> Scorecard:
    """Cut offsets [m], shape (n,), and runs, shape (runs, n), into the same snippets and compare."""
    starts = _starts(timeline)
    rows, of_block = starts[:, None] + np.arange(SNIPPET_ROWS), blocks[starts]
    if len(starts) < 8:
        empty = np.zeros((0, len(METRICS)))
        return Scorecard(None, None, None, empty, empty, empty)
    real, numbers = snippet_metrics(timeline.offset[rows]), np.unique(of_block)
    gathered: list[list[Distances]] = []
    for split in range(SPLITS):
        half = np.isin(of_block, rng.permutation(numbers)[: max(1, len(numbers) // 2)])
        if min(half.sum(), (~half).sum()) >= 3:
            sampled = (snippet_metrics(runs[split % len(before)][rows[~half]]) for runs in (before, after))
            gathered.append([metric_distances(real[half], metrics) for metrics in (*sampled, real[~half])])
    far = [mean_distances(list(several)) for several in zip(*gathered, strict=True)]
    before_distances, other, floor = far or (None, None, None)
    return Scorecard(
        before_distances, other, floor, real, snippet_metrics(before[0][rows]), snippet_metrics(after[0][rows])
    )


def _starts(timeline: Timeline) -> IntArray:
    """Snippets side by side, each of valid rows alone, shape (snippets,)."""
    stretches = true_slices(timeline.valid)
    starts = [np.arange(rows.start, rows.stop - SNIPPET_ROWS + 1, SNIPPET_ROWS) for rows in stretches]
    return np.concatenate([np.zeros(0, dtype=np.intp), *starts])
