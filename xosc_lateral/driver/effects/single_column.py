"""What effects of one context column share: its name."""

from __future__ import annotations

from xosc_lateral.driver.effects.column import ColumnEffect


class SingleColumnEffect(ColumnEffect, frozen=True, kw_only=True):
    """An effect of one column.

    Parameters
    ----------
    column : str
        Its name among the context columns.
    """

    column: str

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)
