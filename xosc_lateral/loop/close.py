"""Close the loop: residual, cause, effect added, base refitted, error before and after on blocks held out in time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, ColumnEffect, Drift, Effect, GrowingSpread
from xosc_lateral.driver.fitting import fit_runs
from xosc_lateral.driver.kinds import ModelKind
from xosc_lateral.driver.profile import DriverProfile, Provenance
from xosc_lateral.driver.series import Drive
from xosc_lateral.errors import NotEnoughDataError
from xosc_lateral.loop.between import between_shift, is_between
from xosc_lateral.loop.findings import Finding, describe_finding, helps, memory_finding, population_finding
from xosc_lateral.loop.memory import Memory, test_memory
from xosc_lateral.loop.movement import Coarse, Fitted, Terms, fit_movement, held_out_likelihood
from xosc_lateral.loop.population import Population, test_population
from xosc_lateral.loop.residual import Cells, cells_of, error_between, expected, floor_of, own_runs
from xosc_lateral.loop.scorecard import Scorecard, score_runs
from xosc_lateral.loop.sizing import Sized, size_effects
from xosc_lateral.loop.strip import effects_share, stripped_runs
from xosc_lateral.loop.timeline import COARSE, Timeline, coarse_all, coarse_middle, join_drives
from xosc_lateral.loop.trace import trace_effects
from xosc_lateral.loop.traced import Found, Trace, without, without_finding

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

FOLDS = 4
"""Every part of the drives is held out once, and predicted from the other three."""

CLEAR_GAIN = 4.0
"""An effect that adds so much to the log-likelihood of held-out blocks stays, whatever its cells show. [-]"""

SLOW_PRICE = 9.0
"""What minus the logarithm of a p-value lies above a gain in log-likelihood, about. [-]"""

BEFORE, AFTER, CORE = 0, 2, 1
"""Profiles of a fold."""

BLOCK_S = 150.0
"""Length of the blocks of a drive that are held out; drives shorter than three blocks are held out whole. [s]"""

Progress = Callable[[float, str], None]
"""Told the share that is done and what is being done."""


@dataclass(frozen=True, eq=False)
class LoopResult:
    """What the loop found, as data; `xosc_lateral.report.loop` turns it into words.

    Parameters
    ----------
    names : tuple of str
        Drives.
    base, refined : DriverProfile
        Before and after.
    given : bool
        Whether the base was given; else it was fitted first.
    findings : tuple of Finding
    trace : Trace
        Everything that was looked at.
    memory : Memory
        How the base's own runs compare with the drives from band to band.
    population : Population or None
        How much the drives differ; None with too few of them.
    held_out : str
        What was held out, in words.
    cells : Cells
    unmoved : array, shape (n,)
        Measured offsets less the effects on the mean. [m]
    real, before, after : mapping of str to array
        Cells of measured and expected offsets on held-out blocks. [m]
    error_before, error_after, floor : float
        [m]
    scores : Scorecard
        The ten metrics.
    runs_before, runs_after : array, shape (runs, n)
        Held-out runs of both profiles. [m]
    seed : int
    """

    names: tuple[str, ...]
    base: DriverProfile
    refined: DriverProfile
    given: bool
    findings: tuple[Finding, ...]
    trace: Trace
    memory: Memory
    population: Population | None
    held_out: str
    cells: Cells
    unmoved: FloatArray
    real: dict[str, FloatArray]
    before: dict[str, FloatArray]
    after: dict[str, FloatArray]
    error_before: float
    error_after: float
    floor: float
    scores: Scorecard
    runs_before: FloatArray
    runs_after: FloatArray
    seed: int


def close_loop(
    drives: Sequence[Drive],
    base: DriverProfile | None = None,
    *,
    seed: int,
    name: str = "refined",
    provenance: Provenance | None = None,
    excluded: Sequence[str] = (),
    progress: Progress = lambda share, what: None,
) -> LoopResult:
    """Find what a profile fails to reproduce, trace it, add it, and score it on held-out blocks.

    Parameters
    ----------
    drives : sequence of Drive
    base : DriverProfile, optional
        Start from it and from its effects; without, one is fitted first (`best`).
    seed : int
        Same drives, base and seed: same result.
    name : str
        Of the refined profile.
    provenance : Provenance, optional
        What is known about the drives.
    excluded : sequence of str
        Columns that are not to be looked at.
    progress : callable

    Raises
    ------
    NotEnoughDataError
        When less than two minutes of road-following are left after cutting.
    """
    root = np.random.SeedSequence(seed)
    progress(0.0, "reading the drives")
    timeline = join_drives(drives)
    coarse = Coarse.of(timeline)
    kind = ModelKind.BEST if base is None else _kind_of(base)
    plain = fit_movement(coarse, Terms())
    everything = np.ones(len(timeline), dtype=np.bool_)
    given = base is not None
    if base is None:
        progress(0.02, "fitting the base profile")
        base = _fit(timeline, coarse, plain, Sized({}), everything, kind, f"{name}-base", provenance)
    memory = test_memory(base, timeline, root)
    trace = trace_effects(
        coarse,
        root,
        initial=initial_terms(base, timeline),
        excluded=excluded,
        progress=lambda what: progress(0.1, what),
    )
    population = test_population(trace.final, between_shift(coarse, trace.final))
    differ = population is not None and population.found
    refined_kind = ModelKind.BEST if memory.found or differ else kind
    blocks = hold_out_blocks(timeline)
    setting = _Setting(timeline, coarse, blocks, base if given else None, kind, refined_kind, root)
    scored = _score(setting, trace, lambda share, what: progress(0.6 + 0.2 * share, what))
    useless = [
        found
        for found, finding in zip(trace.found, scored.beside_core, strict=True)
        if not helps(finding) and _held_out_gain(setting, trace, found) < CLEAR_GAIN
    ]
    if useless:
        trace = without(trace, useless)
        scored = _score(setting, trace, lambda share, what: progress(0.8 + 0.15 * share, what))
    progress(0.95, "refitting on everything")
    refined = _fit(timeline, coarse, trace.final, scored.sized, everything, refined_kind, name, provenance)
    cells, real, before, after = scored.cells, scored.real, scored.before, scored.after
    unmoved = timeline.offset - effects_share(coarse, trace.final, scored.sized).location
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(9,)))
    findings = list(scored.findings)
    if kind is ModelKind.TWO_LEVEL:
        # what the core model lacks is found once, by replacing it; `best` has both
        if memory.found:
            findings.append(memory_finding(memory, (real, before, after)))
        if population is not None and population.found:
            findings.append(population_finding(population, (real, before, after)))
    progress(1.0, "done")
    return LoopResult(
        names=timeline.names,
        base=base,
        refined=refined,
        given=given,
        findings=tuple(findings),
        trace=trace,
        memory=memory,
        population=population,
        held_out=_in_words(timeline, blocks),
        cells=cells,
        unmoved=unmoved,
        real=real,
        before=before,
        after=after,
        error_before=error_between(real, before),
        error_after=error_between(real, after),
        floor=floor_of(cells, unmoved, blocks, rng),
        scores=score_runs(timeline, scored.runs_before, scored.runs_after, blocks, rng),
        runs_before=scored.runs_before,
        runs_after=scored.runs_after,
        seed=seed,
    )


def initial_terms(base: DriverProfile, timeline: Timeline) -> Terms:
    """The base's own effects as far as the table has their columns: they are refitted, not found anew."""
    there = {"lane_width", *timeline.context}
    columns = [effect for effect in base.effects if isinstance(effect, ColumnEffect) and set(effect.columns) <= there]

    def acting(acts: Acts) -> tuple[ColumnEffect, ...]:
        return tuple(effect for effect in columns if effect.acts is acts)

    return Terms(
        location=tuple(effect for effect in acting(Acts.LOCATION) if not is_between(effect)),
        between=tuple(effect for effect in acting(Acts.LOCATION) if is_between(effect)),
        spread=acting(Acts.SPREAD),
        growth=any(isinstance(effect, GrowingSpread) for effect in base.effects),
        drift=any(isinstance(effect, Drift) for effect in base.effects),
    )


def hold_out_blocks(timeline: Timeline) -> IntArray:
    """Number of the block that every row is in, shape (n,); block b belongs to fold b modulo `FOLDS`."""
    blocks = np.zeros(len(timeline), dtype=np.intp)
    length = round(BLOCK_S / timeline.step)
    next_block = 0
    for span in timeline.spans:
        n = span.stop - span.start
        parts = max(1, n // length) if n >= 3 * length else 1
        own = np.minimum(np.arange(n) * parts // n, parts - 1)
        blocks[span] = next_block + own
        next_block += parts
    return blocks


@dataclass(frozen=True, eq=False)
class _Setting:
    """What stays the same when findings are scored."""

    timeline: Timeline
    coarse: Coarse
    blocks: IntArray
    fixed: DriverProfile | None
    kind: ModelKind
    refined_kind: ModelKind
    root: np.random.SeedSequence


@dataclass(frozen=True, eq=False)
class _Scored:
    """Findings with their errors on held-out blocks."""

    sized: Sized
    cells: Cells
    real: dict[str, FloatArray]
    before: dict[str, FloatArray]
    after: dict[str, FloatArray]
    runs_before: FloatArray
    runs_after: FloatArray
    findings: list[Finding]
    beside_core: list[Finding]
    """The same with the refined core model, without effects, in the place of the base: what the effects alone bring."""


def _score(setting: _Setting, trace: Trace, progress: Progress) -> _Scored:
    timeline, coarse = setting.timeline, setting.coarse
    sized = size_effects(coarse, trace.final)
    runs_before, runs_core, runs_after = _held_out_runs(setting, trace, progress)
    cells = cells_of(timeline, _quantities(coarse, trace, sized), trace.final.terms.weave)
    real = cells.describe(timeline.offset, timeline.valid)
    before, after = expected(cells, runs_before, timeline.valid), expected(cells, runs_after, timeline.valid)
    core = before if runs_core is runs_before else expected(cells, runs_core, timeline.valid)

    def described(first: dict[str, FloatArray]) -> list[Finding]:
        compared = (real, first, after)
        return [describe_finding(found, i, coarse, trace, sized, compared) for i, found in enumerate(trace.found)]

    return _Scored(sized, cells, real, before, after, runs_before, runs_after, described(before), described(core))


def _held_out_runs(setting: _Setting, trace: Trace, progress: Progress) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Runs of base, refined core and refined profile over all rows, each row's by profiles fitted without its fold."""
    blocks = setting.blocks
    same_core = setting.fixed is None and setting.kind is setting.refined_kind
    composite: dict[int, FloatArray] = {}
    folds = min(FOLDS, int(blocks.max()) + 1)
    for fold in range(folds):
        progress(fold / folds, f"held-out fold {fold + 1} of {folds}")
        held = blocks % folds == fold
        used = ~held if folds > 1 else np.ones(len(held), dtype=np.bool_)
        for side, profile in enumerate(_fold_profiles(setting, trace, used)):
            if side == CORE and same_core:
                continue
            # the same luck for all sides and folds: what differs is the profile, and runs go on from fold to fold
            seed = np.random.SeedSequence(setting.root.entropy, spawn_key=(5,))
            runs = own_runs(profile, setting.timeline, seed)
            composite.setdefault(side, np.zeros_like(runs))[:, held] = runs[:, held]
    return composite[BEFORE], composite[BEFORE if same_core else CORE], composite[AFTER]


def _held_out_gain(setting: _Setting, trace: Trace, found: Found) -> float:
    """What a finding adds to the log-likelihood of blocks that its size was not fitted on.

    Cells say whether a profile shows an effect, but the mean of a driver who wanders is a noisy measure of it. The
    slower movement's spread is no part of the likelihood: the trace's own score stands in. 0: nothing is known.
    """
    if found.look == "slow" or (found.look == "growth" and trace.final.terms.slow_growth):
        return float(-np.log(found.p_value) - SLOW_PRICE)
    if found.look not in ("location", "scale", "growth", "periodic", "wander"):
        return 0.0
    coarse, gain = setting.coarse, 0.0
    blocks = coarse_middle(setting.blocks)
    for fold in range(FOLDS):
        held = blocks % FOLDS == fold
        part = replace(coarse, valid=coarse.valid & ~held)
        if not part.valid.any():
            return 0.0
        for terms, sign in ((trace.final.terms, 1.0), (without_finding(trace.final.terms, found), -1.0)):
            gain += sign * held_out_likelihood(coarse, fit_movement(part, terms), held)
    return gain


def _fold_profiles(
    setting: _Setting, trace: Trace, used: BoolArray
) -> tuple[DriverProfile, DriverProfile, DriverProfile]:
    """Base, refined core, refined profile."""
    timeline, coarse = setting.timeline, setting.coarse
    whole = coarse_all(np.pad(used, (0, -len(used) % COARSE), mode="edge"))
    part = replace(coarse, valid=coarse.valid & whole[: len(coarse)])
    plain = fit_movement(part, Terms())
    core = _fit(timeline, part, plain, Sized({}), used, setting.refined_kind, "core", None)
    if setting.fixed is not None:
        before = setting.fixed
    elif setting.kind is setting.refined_kind:
        before = core
    else:
        before = _fit(timeline, part, plain, Sized({}), used, setting.kind, "before", None)
    fitted = fit_movement(part, trace.final.terms)
    after = _fit(timeline, part, fitted, size_effects(part, fitted), used, setting.refined_kind, "after", None)
    return before, core, after


def _fit(
    timeline: Timeline,
    coarse: Coarse,
    fitted: Fitted,
    sized: Sized,
    used: BoolArray,
    kind: ModelKind,
    name: str,
    provenance: Provenance | None,
) -> DriverProfile:
    """Base model of what is left without the effects, and the effects."""
    runs = stripped_runs(timeline, effects_share(coarse, fitted, sized), used)
    if not runs:
        raise NotEnoughDataError("closing the loop: no run of 10 s is left to fit the base model on")
    profile = fit_runs(runs, name=name, model=kind, provenance=provenance)
    effects: tuple[Effect, ...] = sized.effects
    return replace(profile, effects=effects)


def _quantities(coarse: Coarse, trace: Trace, sized: Sized) -> dict[str, FloatArray]:
    """What the residual is binned by: every column that may act, and every found effect's own quantity."""
    quantities = {column.name: coarse.context[column.name] for column in trace.columns}
    for column in trace.columns:
        if column.period:
            angle = 2.0 * np.pi / column.period * quantities.pop(column.name)
            quantities |= {f"sin({column.name})": np.sin(angle), f"cos({column.name})": np.cos(angle)}
    for key, group in sized.groups.items():
        effect = group[0] if group else None
        if isinstance(effect, ColumnEffect):
            strength = effect.strength(coarse.timeline.step, coarse.context)
            if strength is not None:
                quantities[f"effect: {key}"] = strength
    if trace.final.terms.step_at is not None:
        quantities["effect: step"] = (np.arange(len(coarse.timeline)) >= trace.final.terms.step_at * COARSE).astype(
            float
        )
    return quantities


def _kind_of(profile: DriverProfile) -> ModelKind:
    return ModelKind.TWO_LEVEL if profile.model.kind == ModelKind.TWO_LEVEL.value else ModelKind.BEST


def _in_words(timeline: Timeline, blocks: IntArray) -> str:
    number = int(blocks.max()) + 1
    folds = min(FOLDS, number)
    if folds == 1:
        return "nothing: the table is too short to hold a block out"
    if number < 1.5 * len(timeline.names):
        return f"{len(timeline.names)} drives in {folds} folds: each is scored by profiles fitted on the other folds"
    return (
        f"{number} blocks of about {BLOCK_S:g} s in {folds} folds: every block is scored by profiles whose base model "
        "and effect sizes were fitted on the other folds; which effects there are was decided on all blocks, and "
        "the chance that this is wrong is the p-value"
    )
