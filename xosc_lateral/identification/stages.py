"""Which terms of the model are looked for, in which order, and how surely each has to be found."""

from __future__ import annotations

from xosc_lateral.discovery import defined_in
from xosc_lateral.identification import terms
from xosc_lateral.identification.significance import Budget
from xosc_lateral.identification.terms.base import Stage, Term

TERMS: tuple[type[Term], ...] = defined_in(terms.__name__, Term)  # type: ignore[type-abstract]
"""Every term that a file of `terms` defines, by the file's name."""


def in_stages(kinds: tuple[type[Term], ...]) -> tuple[tuple[type[Term], ...], ...]:
    """What is looked for at each stage, in the order in which it is asked."""
    asked = sorted(kinds, key=lambda kind: kind.place)
    return tuple(tuple(kind for kind in asked if stage in kind.stages) for stage in Stage)


def shared_among(kinds: tuple[type[Term], ...]) -> Budget:
    """The error budget by the terms' own weights; those of one component compete, and share one part of it."""
    return Budget({kind.component: kind.weight for kind in kinds})


STAGES = in_stages(TERMS)
"""Of a stage, what has the smallest p-value is added first."""

ERROR_BUDGET = shared_among(TERMS)
"""Of all terms that are looked for."""
