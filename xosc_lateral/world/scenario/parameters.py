"""Parameters in scope, and the filling in of ``$name`` and ``${expression}``."""

from __future__ import annotations

import re
from collections.abc import Mapping

from xosc_lateral.world.scenario.enums import Rule
from xosc_lateral.world.scenario.expressions import ExpressionError, evaluate, from_text

MAX_CHAIN = 30
"""Parameters referring to parameters. Bounds the recursion; field files stay under 5."""

_NAME = re.compile(r"\$([A-Za-z_][\w.]*)\Z")


class Scope:
    """Declared parameters, their values filled in when asked for, in any order of declaration.

    Values as written may refer to other parameters of this scope and of its parent, where names are looked up that are
    not declared here.
    """

    __slots__ = ("_done", "_open", "_raw", "parent")

    def __init__(self, raw: Mapping[str, str], parent: Scope | None = None) -> None:
        self._raw, self.parent = dict(raw), parent
        self._done: dict[str, str] = {}
        self._open: list[str] = []

    def value(self, name: str) -> str:
        """Value of a parameter; `ExpressionError` when it is unknown, or depends on itself."""
        if name not in self._raw:
            if self.parent is None:
                raise ExpressionError(f"parameter '{name}' is not declared")
            return self.parent.value(name)
        if name not in self._done:
            if name in self._open:
                cycle = " -> ".join([*self._open[self._open.index(name) :], name])
                raise ExpressionError(f"parameter '{name}' depends on itself ({cycle})")
            if len(self._open) >= MAX_CHAIN:
                raise ExpressionError(f"parameter '{name}': more than {MAX_CHAIN} parameters refer to one another")
            self._open.append(name)
            try:
                self._done[name] = self.fill(self._raw[name])
            finally:
                self._open.pop()
        return self._done[name]

    def fill(self, text: str) -> str:
        """Attribute text with its parameter or expression filled in; other text comes back as it is.

        A reference is the whole value (standard, section 9.1); ``\\$`` at its start stands for the character.
        """
        if not text.startswith("$"):
            return text[1:] if text.startswith("\\$") else text
        if text.startswith("${"):
            end = text.find("}")
            if end < 0:
                raise ExpressionError(f"'{text}': '}}' is missing")
            return evaluate(text[2:end], self.value)
        match = _NAME.match(text)
        return self.value(match[1]) if match else text

    def values(self) -> dict[str, str]:
        """All values of this scope, parents left out."""
        return {name: self.value(name) for name in self._raw}

    def local_values(self) -> dict[str, str]:
        """All values of this scope and its parents, the global one left out; inner ones win."""
        if self.parent is None:
            return {}
        return {**self.parent.local_values(), **self.values()}


def satisfies(value: str, rule: Rule, limit: str) -> bool:
    """Whether ``value rule limit`` holds: as numbers if both are, else as text (then only equality counts)."""
    left, right = from_text(value), from_text(limit)
    if isinstance(left, str) or isinstance(right, str):
        left, right = value, limit
        return {Rule.EQUAL_TO: left == right, Rule.NOT_EQUAL_TO: left != right}.get(rule, False)
    return {
        Rule.EQUAL_TO: left == right,
        Rule.NOT_EQUAL_TO: left != right,
        Rule.GREATER_THAN: left > right,
        Rule.LESS_THAN: left < right,
        Rule.GREATER_OR_EQUAL: left >= right,
        Rule.LESS_OR_EQUAL: left <= right,
    }[rule]
