"""Who is under test in a simulation that runs: whom the user names, else who is called so, as in a conversion."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from xosc_lateral.workflows.options import egos
from xosc_lateral.world.scenario.controllers import BY_NAME, is_named_under_test


class UnderTest:
    """Names of vehicles that no driver of ours has.

    Parameters
    ----------
    stated : str or iterable of str, optional
        Their names; "none": there is none. Without: all that are called ego, hero, VUT and the like.
    driven : collection of str
        Vehicles with a driver of their own choice: no name puts them under test.
    """

    def __init__(self, stated: str | Iterable[str] | None, driven: Collection[str] = ()) -> None:
        words = stated if stated is None or isinstance(stated, str) else list(stated)
        self.named = frozenset[str]() if words is None else egos(words)
        self._by_name, self._driven = words is None, frozenset(driven)

    def __contains__(self, name: str) -> bool:
        return name in self.named or (self._by_name and name not in self._driven and is_named_under_test(name))

    def why(self, name: str) -> str:
        """Why one of them is under test, in words."""
        return "" if name in self.named else f" {BY_NAME} (--ego none drives everybody)"
