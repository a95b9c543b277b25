"""Numbers of the normal distribution, and numbers with as many digits as mean something."""

from __future__ import annotations

from collections.abc import Iterable

NORMAL_95 = 1.96
"""Standard errors to either side that a 95 % interval has. [-]"""

NORMAL_90 = 1.645
"""Standard deviations to either side of the mean that hold 90 %: from the 5 % to the 95 % quantile. [-]"""

MAD_TO_SD = 1.4826
"""Standard deviation over median absolute deviation: one over the 75 % quantile. [-]"""


def significant(value: float, digits: int) -> float:
    """The nearest number with so many significant digits: a file is short, and the same on any machine.

    What another processor gives differs in the last digits, since its linear algebra adds up in another order. Where
    many digits fewer are kept, hardly ever does a number lie so near the border of two that it is rounded to the other.
    """
    return float(f"{value:.{digits}g}")


def all_significant(values: Iterable[float], digits: int) -> tuple[float, ...]:
    """Of each. In the unit of the values."""
    return tuple(significant(value, digits) for value in values)
