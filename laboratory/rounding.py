"""Effects rounded to what is known of them, so that another machine's last bits don't show in a profile's file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import msgspec
import numpy as np

from xosc_lateral.base.numbers import significant
from xosc_lateral.drivers.model.effects.base import Effect

E = TypeVar("E", bound=Effect)

DIGITS = 6
"""Significant digits kept: what differs beyond is the processor's rounding. [-]"""


def rounded_number(value: float) -> float:
    """The nearest number with `DIGITS` significant digits."""
    return significant(value, DIGITS)


def rounded_effect(effect: E) -> E:
    """The same effect with every number that is not whole rounded to `DIGITS` significant digits."""
    rounded: E = _rounded(effect)
    return rounded


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return rounded_number(value)
    if isinstance(value, np.ndarray) and np.issubdtype(value.dtype, np.floating):
        return np.array([rounded_number(float(one)) for one in value.ravel()]).reshape(value.shape)
    if isinstance(value, tuple | list):
        return type(value)(_rounded(one) for one in value)
    if isinstance(value, msgspec.Struct):
        parts = {field.name: getattr(value, field.name) for field in msgspec.structs.fields(value)}
        return msgspec.structs.replace(value, **{name: _rounded(part) for name, part in parts.items()})
    if isinstance(value, Mapping):
        return {key: _rounded(part) for key, part in value.items()}
    return value
