"""Settings of a template: typed, with unit, default and valid range."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from xosc_lateral.base.errors import XoscLateralError, did_you_mean


@dataclass(frozen=True, slots=True)
class Number:
    """A number within a range."""

    name: str
    default: float  # default, low, high: the range includes its borders [unit]
    low: float
    high: float
    unit: str  # ``-`` for none
    what: str  # one line for the user

    def read(self, text: str) -> float:
        """Value of ``--set NAME=text``; `XoscLateralError` when it is not a number or out of range."""
        try:
            value = float(text)
        except ValueError:
            raise XoscLateralError(f"{self.name}: {text!r} is not a number ({self.allowed})") from None
        if not (math.isfinite(value) and self.low <= value <= self.high):
            raise XoscLateralError(f"{self.name}: {text} is out of range ({self.allowed})")
        return value

    @property
    def allowed(self) -> str:
        """Valid range in words."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        return f"{self.low:g} to {self.high:g}{unit}"

    @property
    def shown_default(self) -> str:
        """Default as text."""
        return f"{self.default:g}"

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        known = {"name": self.name, "default": self.default, "what": self.what}
        return known | {"unit": self.unit, "low": self.low, "high": self.high}


@dataclass(frozen=True, slots=True)
class Word:
    """One of a few words, or a value of a type, as a plain scenario declares it."""

    name: str
    default: str
    options: tuple[str, ...] = ()
    what: str = "Parameter of the scenario."  # one line for the user
    kind: str = ""  # OpenSCENARIO's parameter type
    unit: str = "-"

    def read(self, text: str) -> str:
        """Value of ``--set NAME=text``; `XoscLateralError` when it is none of the options, or not of the type."""
        if self.options and text not in self.options:
            raise XoscLateralError(f"{self.name}: {text!r} is none of {self.allowed}")
        if self.kind in _TYPES and not _TYPES[self.kind].fullmatch(text):
            raise XoscLateralError(f"{self.name}: {text!r} is no {self.kind}")
        return text

    @property
    def allowed(self) -> str:
        """What it may be, in words."""
        return ", ".join(self.options) or self.kind

    @property
    def shown_default(self) -> str:
        """Default as text."""
        return self.default

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        known = {"name": self.name, "default": self.default, "what": self.what}
        return known | ({"options": list(self.options)} if self.options else {"type": self.kind})


Parameter = Number | Word

_INTEGER_PATTERNS, _UNSIGNED = r"[+-]?[0-9]+", r"\+?[0-9]+"

_TYPES: dict[str, re.Pattern[str]] = {
    "double": re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"),
    "integer": re.compile(_INTEGER_PATTERNS),
    "int": re.compile(_INTEGER_PATTERNS),
    "unsignedInt": re.compile(_UNSIGNED),
    "unsignedShort": re.compile(_UNSIGNED),
    "boolean": re.compile("true|false|1|0"),
}
"""OpenSCENARIO's parameter types that not every text is a value of, as XML Schema writes their values."""


class Settings:
    """Values of a template's parameters: the defaults, and what the user chose, as text. Raises `XoscLateralError`."""

    __slots__ = ("_values",)

    def __init__(self, parameters: Iterable[Parameter], chosen: Mapping[str, str]) -> None:
        by_name = {parameter.name: parameter for parameter in parameters}
        for name in chosen:
            if name not in by_name:
                there = f"there are {', '.join(sorted(by_name)) or 'none'}"
                raise XoscLateralError(f"unknown setting {name!r}{did_you_mean(name, by_name)}; {there}")
        self._values: dict[str, float | str] = {
            name: parameter.read(chosen[name]) if name in chosen else parameter.default
            for name, parameter in by_name.items()
        }

    def number(self, name: str) -> float:
        """Value of a `Number`."""
        value = self._values[name]
        assert isinstance(value, float | int), f"{name} is not a number"
        return float(value)

    def text(self, name: str) -> str:
        """Value of a `Word`."""
        value = self._values[name]
        assert isinstance(value, str), f"{name} is no word"
        return value

    def need_more(self, name: str, other: str) -> None:
        """Refuse settings under which nothing would happen: `name` has to be larger than `other`."""
        if self.number(name) <= self.number(other):
            raise XoscLateralError(
                f"{name}: {self.number(name):g} has to be more than {other} ({self.number(other):g})"
            )
