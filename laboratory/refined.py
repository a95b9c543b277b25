"""The library's profile that the closed loop made: from the paper's model to what these drivers do."""

from __future__ import annotations

from collections.abc import Sequence

from msgspec.structs import replace

from laboratory.rounding import rounded_effect, rounded_number
from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.profile import DriverProfile, Provenance
from xosc_lateral.extras.loop.close import LoopResult, close_loop

NAME = "motorway-refined"
NOTES = (
    "All vehicles, by the closed loop: it starts from the two-level model, finds what that lacks beside the measured "
    "drives, and refits with that added."
)


def refine_population(drives: Sequence[Drive], seed: int, known: Provenance | None = None) -> LoopResult:
    """Close the loop from a two-level model of the same drives."""
    base = fit_profile(drives, name=f"{NAME}-base", model=ModelKind.TWO_LEVEL)
    return close_loop(drives, base, seed=seed, name=NAME, provenance=known)


def refined_profile(result: LoopResult) -> DriverProfile:
    """The refined profile, its effects rounded to what is known, with what the loop found in its provenance.

    The loop's errors are not in it: they are the loop's own figures (docs/closing_the_loop.md), and a change
    of how they are measured must not change a driver.
    """
    refined = result.refined
    loop = {
        "base": result.base.model.kind,
        "seed": result.seed,
        "found": [finding.effect for finding in result.findings],
    }
    fit = {**refined.provenance.fit, "closed_loop": loop}
    return rounded_profile(replace(refined, provenance=replace(refined.provenance, fit=fit)))


def rounded_profile(profile: DriverProfile) -> DriverProfile:
    """The same with its effects and its lane width rounded; the core model's numbers are when they are fitted."""
    effects = tuple(rounded_effect(effect) for effect in profile.effects)
    return replace(profile, effects=effects, lane_width=rounded_number(profile.lane_width))
