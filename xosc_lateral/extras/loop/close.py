"""Close the loop: find, prove, add, refit, and score on blocks that nothing was chosen or fitted on.

References
----------
.. [1] O. Miettinen, "Estimability and estimation in case-referent studies", American J. Epidemiology 103, 1976:
       intervals that agree with their test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.special import ndtri

from xosc_lateral.base.arrays import NORMAL_95
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.effects import Effect
from xosc_lateral.drivers.model.profile import DriverProfile, Provenance
from xosc_lateral.drivers.model.seeds import generator
from xosc_lateral.extras.loop import held_out
from xosc_lateral.extras.loop.core_model import DriverVariance, SpectrumShape, compare_spectrum_shapes, test_population
from xosc_lateral.extras.loop.held_out import HeldOut, Scorecard, Setting
from xosc_lateral.extras.loop.identify import Identified, Progress, identify, initial_terms, search_of
from xosc_lateral.extras.loop.model import Description, Fitted, Term, fit_model
from xosc_lateral.extras.loop.omnibus import Omnibus, check_remainder
from xosc_lateral.extras.loop.refinement import Alternatives
from xosc_lateral.extras.loop.residual import LackOfFit, lack_of_fit_of, size_of
from xosc_lateral.extras.loop.selection import UNFORESEEN, Accepted, Gain, Rejected, Selection, failed
from xosc_lateral.extras.loop.shown import Shown, what_drives_show
from xosc_lateral.extras.loop.significance import LoopSeed
from xosc_lateral.extras.loop.terms.between import between_shift
from xosc_lateral.extras.loop.timeline import Coarse, join_drives


@dataclass(frozen=True, eq=False, kw_only=True)
class Finding(Description):
    """One effect that the base lacked."""

    kind: str  # As in the report's schema.
    p_value: float  # Family-wise over everything that its component tried.
    error_before: float  # On held-out blocks, by the effect's own quantity. [m]
    error_after: float  # On held-out blocks, by the effect's own quantity. [m]
    columns: tuple[str, ...] = ()  # That cause it; two when it is a product.
    alike: Alternatives = ()  # Columns of each other effect that the data can't tell from it.
    effects: tuple[Effect, ...] = ()  # What the profile got.
    gain: Gain | None = None  # Held-out gain, nested; None where its path can't be predicted.


def _finding(size: Description, scored: HeldOut, **about: Any) -> Finding:
    """Put errors on held-out blocks to what was described."""
    before, after = scored.error_of(size.statistic)
    described = vars(size) | {"measure": size.measure or size.statistic}
    return Finding(error_before=before, error_after=after, **described, **about)


def describe_finding(
    accepted: Accepted, key: str, effects: tuple[Effect, ...], fitted: Fitted, scored: HeldOut
) -> Finding:
    """Put sizes and errors to what was accepted."""
    term = accepted.term
    about = {"kind": term.kind, "columns": term.columns, "alike": term.alike, "effects": effects}
    described = agreeing(term.describe(fitted, effects, key), term.kind, accepted.p_value)
    return _finding(described, scored, p_value=accepted.p_value, gain=accepted.gain, **about)


def agreeing(described: Description, kind: str, p_value: float) -> Description:
    """Where a p-value below 0.001 stands beside an interval across no effect, the error that the test says [1]_."""
    away = abs(described.size_m - (1.0 if kind in ("scale", "regime") else 0.0))
    if p_value >= CLEAR_P or NORMAL_95 * described.size_error < away:
        return described
    return replace(described, size_error=-away / float(ndtri(0.5 * p_value)))


# The held-out error of a profile with more effects may be so many times the base's, 24 runs leave 2 % of noise; or more
# where other drives of the driver might show less. [-]
NO_WORSE = 1.05
CLEAR_P = 1e-3  # Beside such a p-value no interval is across no effect. [-]
SCORE_SEED = 0  # Runs and half samples that the verdict rests on: the same whatever the seed of the search.
# Why an effect that does not help is taken back.
HARMFUL = "significant, but with it held-out blocks are predicted worse by its own quantity, beyond what chance does"


@dataclass(frozen=True, eq=False, kw_only=True)
class LoopResult:
    """What the loop found, as data; `xosc_lateral.extras.loop.loop_report` turns it into words."""

    base: DriverProfile
    refined: DriverProfile
    base_given: bool  # Whether the base was given; else it was fitted first.
    in_sample: bool  # Whether it was given, and fitted on these very drives.
    findings: tuple[Finding, ...]
    coarse: Coarse
    identified: Identified  # Terms that are kept and those that are not, and the columns.
    scored: HeldOut  # Both profiles on held-out blocks.
    lack_of_fit: LackOfFit  # What is left.
    remainder: Omnibus | None  # Whether any column predicts it; None: not known, for the check failed.
    scores: Scorecard  # The ten metrics.
    shown: tuple[Shown, ...]  # What these drives can show.
    seed: int

    @property
    def final(self) -> Fitted:
        """All terms that are kept, fitted to everything."""
        return self.identified.selection.final

    @property
    def error_before(self) -> float:
        """Of the base on held-out blocks. [m]"""
        return self.scored.errors[0]

    @property
    def error_after(self) -> float:
        """Of the refined profile. [m]"""
        return self.scored.errors[1]

    @property
    def own_errors(self) -> tuple[float, float] | None:
        """Before and after, in the cells of the effects that were found: root mean square over them. [m]"""
        pairs = np.array([(one.error_before, one.error_after) for one in self.findings if one.error_before > 0.0])
        if not len(pairs):
            return None
        before, after = np.sqrt(np.mean(np.square(pairs), axis=0)).tolist()
        return before, after

    @property
    def floor(self) -> float:
        """Sampling error of the measured drives: how far random halves of their blocks are from all of them. [m]"""
        return self.lack_of_fit.floor


def close_loop(
    drives: Sequence[Drive],
    base: DriverProfile | None = None,
    *,
    seed: int,
    in_sample: bool = False,
    name: str = "refined",
    provenance: Provenance | None = None,
    excluded: Sequence[str] = (),
    roles: Mapping[str, str] = MappingProxyType({}),
    progress: Progress = lambda share, what: None,
) -> LoopResult:
    """Find what a profile fails to reproduce, trace it, add it, and score it on held-out blocks.

    See `xosc_lateral.close_loop`; `excluded` columns are not tested, and a base that was fitted on these very drives,
    `in_sample`, is fitted again without each held-out fold.
    """
    root = np.random.SeedSequence(seed)
    progress(0.0, "reading the drives")
    timeline = join_drives(drives)
    coarse, everything = Coarse.of(timeline), np.ones(len(timeline), dtype=np.bool_)
    is_given = base is not None
    paper = base is not None and base.model.kind == ModelKind.TWO_LEVEL.value
    kind = ModelKind.TWO_LEVEL if paper else ModelKind.AUTOREGRESSIVE
    if base is None:
        progress(0.02, "fitting the base profile")
        base = held_out.fit_without(fit_model(coarse, ()), everything, kind, f"{name}-base", provenance)
    # the loop's own base knows what class, lane and speed do as `fit` has it; what acts is found, not begun with
    initial = initial_terms(base, timeline) if is_given else ()
    identified = identify(coarse, root, initial=initial, excluded=excluded, roles=roles, progress=progress)
    lacks: list[SpectrumShape | DriverVariance] = []
    if paper:  # what the two-level model lacks is found once, by replacing it: the autoregressive one has both
        final = identified.selection.final
        tested = compare_spectrum_shapes(base, timeline, root), test_population(final, between_shift(final))
        lacks = [lack for lack in tested if lack is not None and lack.is_found]
    verdict = np.random.SeedSequence(SCORE_SEED)
    refined_kind = ModelKind.AUTOREGRESSIVE if lacks else kind
    setting = Setting(coarse, base if is_given and not in_sample else None, kind, refined_kind, verdict)
    identified, scored = _that_helps(setting, identified, progress)
    selection = identified.selection
    progress(0.95, "refitting on everything")
    refined = base
    if selection.accepted or not is_given or lacks:
        began_with = base if is_given else None
        refined = held_out.fit_refined(selection.final, setting.refined_kind, name, provenance, began_with)
    findings = [describe_finding(*one, selection.final, scored) for one in _accepted(selection)]
    findings += [_finding(lack.described(), scored, kind=lack.KIND, p_value=lack.p_value) for lack in lacks]
    faults: list[Rejected] = []
    rng = generator(root, LoopSeed.SNIPPETS)
    progress(1.0, "done")
    return LoopResult(
        base=base,
        refined=refined,
        base_given=is_given,
        in_sample=is_given and in_sample,
        findings=tuple(findings),
        coarse=coarse,
        scored=scored,
        lack_of_fit=lack_of_fit_of(scored.real, scored.before, scored.after, scored.halves),
        scores=held_out.score_runs(timeline, scored.runs_before, scored.runs_after, setting.blocks, rng),
        remainder=_closing(
            faults, "what is left", lambda: check_remainder(selection.final, identified.quantities, verdict), None
        ),
        shown=_closing(
            faults,
            "what these drives can show",
            lambda: tuple(what_drives_show(identified.search, selection.final)),
            (),
        ),
        identified=replace(identified, selection=replace(selection, rejected=(*selection.rejected, *faults))),
        seed=seed,
    )


def _closing(faults: list[Rejected], what: str, say: Callable[[], Any], instead: Any) -> Any:
    """A closing word; one that fails stands among what was rejected, and costs no finding."""
    try:
        return say()
    except UNFORESEEN as error:
        faults.append(Rejected(what, (), 1.0, failed("it", error)))
        return instead


def plan_loop(
    drives: Sequence[Drive],
    *,
    seed: int,
    excluded: Sequence[str] = (),
    roles: Mapping[str, str] = MappingProxyType({}),
) -> list[Shown]:
    """What drives can show before any effect is sought: sizes that would be found with 80 % probability."""
    coarse = Coarse.of(join_drives(drives))
    _, search = search_of(coarse, np.random.SeedSequence(seed), excluded, roles)
    return what_drives_show(search, fit_model(coarse, ()), plan=True)


def _that_helps(setting: Setting, identified: Identified, progress: Progress) -> tuple[Identified, HeldOut]:
    """Less what makes held-out blocks look less like the profile, the worst first; and how the rest is scored."""
    while True:
        scored = held_out.score_held_out(
            setting, identified.selection, identified.nested, identified.usable.columns, progress
        )
        before, after = scored.errors
        if not identified.selection.accepted:
            return identified, scored
        harmful = _most_harmful(identified.selection, scored)
        if harmful is not None:
            identified = identified.without([harmful], HARMFUL)
        elif setting.kind is setting.refined_kind and after > NO_WORSE * before and scored.surely_worse:
            why = f"with the effects that were found the held-out error rises from {before:.4f} to {after:.4f} m"
            identified = identified.without([one.term for one in identified.selection.accepted], why)
        else:
            return identified, scored


def _most_harmful(selection: Selection, scored: HeldOut) -> Term | None:
    """The accepted term, not sure to gain, whose held-out mean or spread is predicted worst, beyond chance."""
    worst: tuple[float, Term | None] = (1.0, None)
    for accepted, key, effects in _accepted(selection):
        if accepted.gain is not None and accepted.gain.interval[0] > 0.0:
            continue
        groups = {f"{what} by effect: {key}" for what in ("mean", "spread")} & set(scored.real)
        for group in groups or {accepted.term.describe(selection.final, effects, key).statistic} & set(scored.real):
            before, after = scored.error_of(group)
            chance = np.mean([size_of({"": half[group]}) ** 2 for half in scored.halves])
            loss = (after**2 - before**2) / max(float(chance), 1e-300)
            worst = max(worst, (loss, accepted.term), key=lambda pair: pair[0])
    return worst[1]


def _accepted(selection: Selection) -> list[tuple[Accepted, str, tuple[Effect, ...]]]:
    """What was accepted, with its key and what the profile gets."""
    estimates = selection.final.estimates.items()
    return [(one, key, own) for one in selection.accepted for key, (term, own) in estimates if term is one.term]
