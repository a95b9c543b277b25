"""Values of a template's parameters: the defaults, and what the user set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from xosc_lateral.errors import XoscLateralError
from xosc_lateral.templates.parameter import Parameter


class Settings:
    """Values of a template's parameters: the defaults, and what the user set.

    Raises `XoscLateralError` for an unknown name or a value out of range.

    Parameters
    ----------
    parameters : iterable of Parameter
    chosen : mapping of str to str
        What the user set, as text.
    """

    __slots__ = ("_values",)

    def __init__(self, parameters: Iterable[Parameter], chosen: Mapping[str, str]) -> None:
        by_name = {parameter.name: parameter for parameter in parameters}
        for name in chosen:
            if name not in by_name:
                raise XoscLateralError(f"unknown setting {name!r}; there are {', '.join(sorted(by_name))}")
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
        """Value of a `Choice`."""
        value = self._values[name]
        assert isinstance(value, str), f"{name} is no choice"
        return value

    def need_more(self, name: str, other: str) -> None:
        """Refuse settings under which nothing would happen: `name` has to be larger than `other`."""
        if self.number(name) <= self.number(other):
            raise XoscLateralError(
                f"{name}: {self.number(name):g} has to be more than {other} ({self.number(other):g})"
            )
