"""What a trace holds: effects that chance does not explain, what was tried, and the terms of either."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, ColumnEffect
from xosc_lateral.loop.candidates import Candidate
from xosc_lateral.loop.columns import Column
from xosc_lateral.loop.consequences import Consequence
from xosc_lateral.loop.hidden import (
    Clustering,
    Growth,
    Peak,
)
from xosc_lateral.loop.looks import Look
from xosc_lateral.loop.movement import Coarse, Fitted, Terms, fit_movement
from xosc_lateral.loop.wander import Wander

FloatArray = NDArray[np.float64]

LEVEL = {
    "location": 0.007,
    "between": 0.002,
    "scale": 0.005,
    "dynamics": 0.0003,
    "fine": 0.002,
    "slow": 0.002,
    "growth": 0.001,
    "regime": 0.001,
    "periodic": 0.002,
    "wander": 0.003,
}
"""Probability of a false finding that each look may spend: 2.6 % together, hidden effects included. 5 % are allowed; no
model of a driver is quite right, so drives without an effect show somewhat more than this adds up to."""


@dataclass(frozen=True, eq=False)
class Found:
    """An effect that chance does not explain.

    Parameters
    ----------
    look : str
        Key of `LEVEL`.
    p_value : float
        Family-wise over everything that the look tried.
    candidate : Candidate, optional
        For an effect of columns.
    rivals : tuple of str
        Columns that the data can't tell from it.
    detail : object
        What a hidden look found.
    before, after : Fitted
        Without and with it, when it was found.
    """

    look: str
    p_value: float
    before: Fitted
    after: Fitted
    candidate: Candidate | None = None
    rivals: tuple[str, ...] = ()
    detail: Growth | Clustering | Peak | Wander | None = None


@dataclass(frozen=True, slots=True)
class Tried:
    """A candidate that did not pass.

    Parameters
    ----------
    look : str
    columns : tuple of str
    p_value : float
    why : str
    """

    look: str
    columns: tuple[str, ...]
    p_value: float
    why: str


@dataclass(frozen=True, eq=False)
class Trace:
    """Everything found, and what was not.

    Parameters
    ----------
    found : list of Found
        In the order of finding.
    tried : list of Tried
        Of the last round.
    consequences : list of Consequence
    unused : mapping of str to str
        Columns that were not looked at, and why.
    start, final : Fitted
        Before and after all.
    """

    coarse: Coarse
    found: list[Found]
    tried: list[Tried]
    consequences: list[Consequence]
    unused: dict[str, str]
    columns: list[Column]
    start: Fitted
    final: Fitted


def without(trace: Trace, useless: Sequence[Found]) -> Trace:
    """The trace without some of its findings, refitted; they are listed among what was tried."""
    terms = trace.final.terms
    for found in useless:
        terms = without_finding(terms, found)
    kept = [found for found in trace.found if found not in useless]
    why = "chance does not explain it, but adding it did not bring the error down on held-out blocks"
    tried = [
        Tried(found.look, found.candidate.columns if found.candidate else (), found.p_value, why) for found in useless
    ]
    final = fit_movement(trace.coarse, terms)
    return replace(trace, found=kept, tried=[*trace.tried, *tried], final=final)


def without_finding(terms: Terms, found: Found) -> Terms:
    """Terms less those of one finding."""
    if found.candidate is None:
        neutral: dict[str, Terms] = {
            "growth": replace(terms, growth=False, slow_growth=False),
            "regime": replace(terms, regime_scale=None),
            "periodic": replace(terms, weave=None),
            "wander": replace(terms, drift=False, step_at=None),
        }
        return neutral[found.look]
    columns = found.candidate.columns

    def kept(effects: tuple[ColumnEffect, ...]) -> tuple[ColumnEffect, ...]:
        return tuple(effect for effect in effects if effect.columns != columns)

    by_look: dict[str, Terms] = {
        "location": replace(terms, location=kept(terms.location)),
        "between": replace(terms, between=kept(terms.between)),
        "scale": replace(terms, spread=kept(terms.spread)),
        "dynamics": replace(terms, pace=kept(terms.pace)),
        "fine": replace(terms, fine=kept(terms.fine)),
        "slow": replace(terms, slow=kept(terms.slow)),
    }
    return by_look[found.look]


def with_effect(terms: Terms, look: Look, candidate: Candidate) -> Terms:
    """Terms with one more column effect."""
    if look is Look.LOCATION:
        return replace(terms, location=(*terms.location, candidate.effect))
    if look is Look.SPREAD:
        return replace(terms, spread=(*terms.spread, replace(candidate.effect, acts=Acts.SPREAD)))
    if look is Look.PACE:
        return replace(terms, pace=(*terms.pace, replace(candidate.effect, acts=Acts.RATE)))
    if look is Look.SLOW:
        return replace(terms, slow=(*terms.slow, replace(candidate.effect, acts=Acts.SPREAD)))
    return replace(terms, fine=(*terms.fine, replace(candidate.effect, acts=Acts.FINE)))


def not_enough(look: str, p_value: float, columns: tuple[str, ...] = ()) -> Tried:
    """What chance gives too often."""
    why = f"chance gives as much in {100 * p_value:.3g} % of tables; {100 * LEVEL[look]:g} % is allowed"
    return Tried(look, columns, p_value, why)
