"""Which terms of the model are looked for, and in which order."""

from __future__ import annotations

from xosc_lateral.identification.terms.base import Term
from xosc_lateral.identification.terms.between import BetweenTerm
from xosc_lateral.identification.terms.cycle import CycleTerm
from xosc_lateral.identification.terms.fine_noise import FineNoiseTerm
from xosc_lateral.identification.terms.mean import MeanTerm
from xosc_lateral.identification.terms.regimes import RegimesTerm
from xosc_lateral.identification.terms.restoring import RestoringTerm
from xosc_lateral.identification.terms.slow_spread import SlowSpreadTerm
from xosc_lateral.identification.terms.spread import SpreadTerm
from xosc_lateral.identification.terms.step import StepTerm
from xosc_lateral.identification.terms.variance_trend import VarianceTrendTerm

STAGES: tuple[tuple[type[Term], ...], ...] = (
    (MeanTerm,),
    (CycleTerm, StepTerm),
    (MeanTerm,),
    (VarianceTrendTerm, SpreadTerm, SlowSpreadTerm),
    (RegimesTerm,),
    (FineNoiseTerm, RestoringTerm),
    (BetweenTerm,),
)
"""What is looked for, in this order. The mean comes first: a mean that is not known looks like a spread. Of a stage,
what has the smallest p-value is added first; regimes come after the spread, because they explain whatever comes in
clusters, and before what a regime's loud stretches might be taken for."""
