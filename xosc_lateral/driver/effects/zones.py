"""A value of its own for each zone of a recording."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect
from xosc_lateral.drives.zones import ZONE, at_zones
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class Zones(SingleColumnEffect, frozen=True, kw_only=True):
    """Each zone by its name; elsewhere, as in a scenario, nothing changes.

    Raises `DriverProfileError` if the lengths disagree, there are none, a name is empty or there twice, or a value is
    not finite.

    Parameters
    ----------
    zones : tuple of str
        Names in drive tables.
    values, value_errors : tuple of float
        Of each zone, and their standard errors, per unit of the one coefficient, which is 1. [m] or [-]
    column : str
        Where a context has the zones' codes (`zone_codes`).
    """

    is_of_recording: ClassVar[bool] = True

    zones: tuple[str, ...]
    values: tuple[float, ...]
    value_errors: tuple[float, ...]
    column: str = ZONE
    coefficients: tuple[float, ...] = (1.0,)
    errors: tuple[float, ...] = (0.0,)
    reference: tuple[float, ...] = (0.0,)

    def __post_init__(self) -> None:
        """Check these, too."""
        super().__post_init__()
        alike = len(self.zones) == len(self.values) == len(self.value_errors)
        distinct = len(self.zones) > 0 and all(self.zones) and len(set(self.zones)) == len(self.zones)
        if not alike or not distinct or not np.isfinite([*self.values, *self.value_errors]).all():
            raise DriverProfileError(
                f"effect {self.kind}: {len(self.zones)} zones, {len(self.values)} values and {len(self.value_errors)} "
                "errors; expected as many finite ones as there are zones, each named once"
            )

    @property
    def shape(self) -> str:
        """Words for the report."""
        least, most = int(np.argmin(self.values)), int(np.argmax(self.values))
        return f"{len(self.zones)} zones, least in {self.zones[least]!r}, most in {self.zones[most]!r}"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Value of the zone, shape (n, 1); NaN in a zone that is not known. [m] or [-]"""
        return at_zones(np.asarray(context[self.column]), self.zones, self.values)[:, None]
