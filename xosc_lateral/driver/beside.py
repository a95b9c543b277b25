"""What a profile says of a driver's answer to vehicles beside him: measured, declared, a population's, or unknown."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from msgspec import Meta

from xosc_lateral.driver.records import Record

SIDES = ("left", "right")

COLUMNS = {side: (f"{side}_distance", f"{side}_is_truck", f"truck_{side}", f"car_{side}") for side in SIDES}
"""Context columns by which a profile answers to vehicles on a side by itself."""


class Basis(StrEnum):
    """Where it is known from how a driver answers to neighbours on one side."""

    MEASURED = "measured"
    DECLARED = "declared"
    POPULATION = "population"
    UNKNOWN = "unknown"


class Beside(Record, frozen=True):
    """What is known of a driver's answer to vehicles on one side.

    Parameters
    ----------
    basis : Basis
        `population`: measured on many drivers, pair by pair: `convert` spreads their gaps as that recording has them.
    seconds : float
        Driving with somebody within `SCALE` on that side. [s]
    shift, error : float
        Mean shift with somebody alongside, positive left, and its standard error. [m]
    """

    basis: Basis
    seconds: Annotated[float, Meta(ge=0, description="Driving with somebody there. [s]")] = 0.0
    shift: Annotated[float, Meta(description="With somebody alongside, positive left. [m]")] = 0.0
    error: Annotated[float, Meta(ge=0, description="Standard error. [m]")] = 0.0


POPULATION = {side: Beside(Basis.POPULATION) for side in SIDES}
"""Of profiles whose effects are of the recording that the law of `enrich.give_way` was measured in."""
