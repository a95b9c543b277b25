"""Parameters and variables that change while playing, and how conditions compare."""

from __future__ import annotations

from collections.abc import Mapping

from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.scenario.enums import ParameterType, Rule
from xosc_lateral.world.scenario.global_actions import ModifyOperation
from xosc_lateral.world.scenario.scenario import Parameter

Value = bool | float | int | str

_INTEGER_TYPES = frozenset({ParameterType.INT, ParameterType.UNSIGNED_INT, ParameterType.UNSIGNED_SHORT})


def holds(left: float, rule: Rule, right: float) -> bool:
    """Compare measured quantities with the reference player's tolerance."""
    # One difference for all: the tolerance added to either side is rounded differently, and a rule and its mirror image
    # would disagree about one and the same pair. Equal infinities have none.
    beyond = 0.0 if left == right else left - right
    if rule is Rule.GREATER_THAN:
        return beyond > EPSILON
    if rule is Rule.LESS_THAN:
        return beyond < -EPSILON
    if rule is Rule.GREATER_OR_EQUAL:
        return beyond >= -EPSILON
    if rule is Rule.LESS_OR_EQUAL:
        return beyond <= EPSILON
    return (abs(beyond) < EPSILON) is (rule is Rule.EQUAL_TO)


class Values:
    """Named values with their types: the parameters, or the variables, of a run; `kind`: what messages call one."""

    def __init__(self, kind: str, declared: Mapping[str, Parameter]) -> None:
        self.kind = kind
        self._types = {name: parameter.type for name, parameter in declared.items()}
        self._values: dict[str, Value] = {}
        for name, parameter in declared.items():
            self.set(name, parameter.value)

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def set(self, name: str, text: str) -> None:
        """Give a declared value another one, written as in a file."""
        self._values[name] = _read(text, self._types[name])

    def modify(self, name: str, operation: ModifyOperation, by: float) -> bool:
        """Add to a number or multiply it; False if the value is not a number."""
        value = self._values[name]
        if isinstance(value, str | bool):
            return False
        result = value + by if operation is ModifyOperation.ADD else value * by
        self._values[name] = int(result) if self._types[name] in _INTEGER_TYPES else result
        return True

    def compare(self, name: str, rule: Rule, text: str) -> bool:
        """Compare a value with one written as in a file, in the value's own type."""
        value = self._values[name]
        other = _read(text, self._types[name])
        if isinstance(value, float) and isinstance(other, float):
            return holds(value, rule, other)
        if isinstance(value, str) != isinstance(other, str):
            value, other = str(value), str(other)
        return rule.holds(value, other)


def _read(text: str, kind: ParameterType) -> Value:
    """The value of a text; the text itself where it is not of its type (the standard leaves that open)."""
    try:
        if kind is ParameterType.DOUBLE:
            return float(text)
        if kind in _INTEGER_TYPES:
            return int(float(text))
    except (ValueError, OverflowError):
        return text
    return text.strip() in ("true", "1") if kind is ParameterType.BOOLEAN else text
