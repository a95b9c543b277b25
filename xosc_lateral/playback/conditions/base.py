"""What a condition is while playing."""

from __future__ import annotations

from collections.abc import Callable

from xosc_lateral.playback.state import EntityState

EntityCheck = Callable[[EntityState], bool]
"""Whether the condition holds for one triggering entity, now."""

ValueCheck = Callable[[], bool]
"""Whether the condition holds, now."""
