"""Close the loop: find, prove, add, refit, and score on blocks that nothing was chosen or fitted on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.kinds import ModelKind
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.provenance import Provenance
from xosc_lateral.drives.drive import Drive
from xosc_lateral.identification.blocks import held_out_words, hold_out_blocks
from xosc_lateral.identification.columns import Column
from xosc_lateral.identification.feedback import Feedback
from xosc_lateral.identification.findings import (
    Compared,
    Finding,
    describe_finding,
    population_finding,
    spectrum_finding,
)
from xosc_lateral.identification.held_out import Setting, fit_without, score_held_out
from xosc_lateral.identification.identify import Progress, identify, initial_terms
from xosc_lateral.identification.nested import Gain
from xosc_lateral.identification.population import DriverVariance, test_population
from xosc_lateral.identification.regression import Coarse, Fitted, fit_model
from xosc_lateral.identification.removal import Estimates, estimate_all, removal_of
from xosc_lateral.identification.residual import SummaryStatistics, floor_of
from xosc_lateral.identification.scorecard import Scorecard, score_runs
from xosc_lateral.identification.seeds import LoopSeed
from xosc_lateral.identification.selection import Rejected, Selection
from xosc_lateral.identification.spectrum_shape import SpectrumShape, compare_spectrum_shapes
from xosc_lateral.identification.terms.between import between_shift
from xosc_lateral.identification.timeline import join_drives

FloatArray = NDArray[np.float64]

NO_WORSE = 1.05
"""The held-out error of a profile with more effects may be so many times the base's: 24 runs leave 2 % of noise. [-]"""


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
    coarse : Coarse
    final : Fitted
        All accepted terms, fitted to everything.
    columns : list of Column
        That were looked at.
    feedback : list of Feedback
        Columns that follow from the car's own movement.
    rejected : tuple of Rejected
    unused : mapping of str to str
        Columns that were not looked at, and why.
    gain : Gain or None
        Nested held-out gain of all findings together; None: nothing was found.
    returned_base : str
        Why the base is returned although effects were found; empty otherwise.
    spectrum : SpectrumShape
        How the base's own runs compare with the drives from band to band.
    population : DriverVariance or None
        How much the drives differ; None with too few of them.
    held_out : str
        What was held out, in words.
    statistics : SummaryStatistics
    unmoved : array, shape (n,)
        Measured offsets less the effects on the mean. [m]
    real, before, after : mapping of str to array
        Summary statistics of measured and expected offsets on held-out blocks. [m]
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
    coarse: Coarse
    final: Fitted
    columns: list[Column]
    feedback: list[Feedback]
    rejected: tuple[Rejected, ...]
    unused: dict[str, str]
    gain: Gain | None
    returned_base: str
    spectrum: SpectrumShape
    population: DriverVariance | None
    held_out: str
    statistics: SummaryStatistics
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
        Start from it and from its effects; without, one is fitted first.
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
    kind = ModelKind.AUTOREGRESSIVE if base is None else _kind_of(base)
    everything = np.ones(len(timeline), dtype=np.bool_)
    given = base is not None
    if base is None:
        progress(0.02, "fitting the base profile")
        base = fit_without(fit_model(coarse, ()), {}, everything, kind, f"{name}-base", provenance)
    spectrum = compare_spectrum_shapes(base, timeline, root)
    # the loop's own base knows what class, lane and speed do as `fit` has it; what acts is found, not begun with
    initial = initial_terms(base, timeline) if given else ()
    found = identify(coarse, root, initial=initial, excluded=excluded, progress=progress)
    population = test_population(found.selection.final, between_shift(found.selection.final))
    differ = population is not None and population.found
    refined_kind = ModelKind.AUTOREGRESSIVE if spectrum.found or differ else kind
    blocks = hold_out_blocks(timeline)
    setting = Setting(coarse, blocks, base if given else None, kind, refined_kind, root)
    scored = score_held_out(setting, found.selection, found.nested, found.columns, progress)
    before, after = scored.errors
    if found.selection.accepted and kind is refined_kind and after > NO_WORSE * before:
        found = found.emptied(
            f"with the effects that were found the held-out error rises from {before:.4f} to {after:.4f} m"
        )
        scored = score_held_out(setting, found.selection, None, found.columns, progress)
    selection = found.selection
    progress(0.95, "refitting on everything")
    estimates = estimate_all(selection.final)
    refined = base
    if selection.accepted or not given or kind is not refined_kind:
        refined = fit_without(selection.final, estimates, everything, refined_kind, name, provenance)
    unmoved = timeline.offset - removal_of(selection.final, estimates).location
    compared = (scored.real, scored.before, scored.after)
    findings = _findings(selection, estimates, found.gains, compared)
    if kind is ModelKind.TWO_LEVEL:
        # what the core model lacks is found once, by replacing it; the autoregressive one has both
        findings += [spectrum_finding(spectrum, compared)] if spectrum.found else []
        findings += [population_finding(population, compared)] if population is not None and population.found else []
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(LoopSeed.BLOCKS,)))
    floor = floor_of(scored.statistics, unmoved, blocks, rng)
    scores = score_runs(timeline, scored.runs_before, scored.runs_after, blocks, rng)
    progress(1.0, "done")
    return LoopResult(
        timeline.names, base, refined, given, tuple(findings), coarse, selection.final, found.columns, found.feedback,
        selection.rejected, dict(found.unused), found.total if found.gains else None,
        found.returned_base, spectrum, population, held_out_words(timeline, blocks), scored.statistics,
        unmoved, scored.real,
        scored.before, scored.after, *scored.errors, floor, scores, scored.runs_before, scored.runs_after, seed,
    )  # fmt: skip


def _findings(
    selection: Selection,
    estimates: Estimates,
    gains: Mapping[int, Gain],
    compared: Compared,
) -> list[Finding]:
    keys = {id(term): (key, effects) for key, (term, effects) in estimates.items()}
    found = []
    for one in selection.accepted:
        key, effects = keys[id(one.term)]
        found.append(describe_finding(one, key, selection.final, effects, gains.get(id(one.term)), compared))
    return found


def _kind_of(profile: DriverProfile) -> ModelKind:
    return ModelKind.TWO_LEVEL if profile.model.kind == ModelKind.TWO_LEVEL.value else ModelKind.AUTOREGRESSIVE
