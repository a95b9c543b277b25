"""What a condition is while playing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import EntityState

EntityCheck = Callable[[EntityState], bool]
"""Whether the condition holds for one triggering entity, now."""

ValueCheck = Callable[[], bool]
"""Whether the condition holds, now."""

EntityChecks: TypeAlias = dict[type, Callable[[Any, Simulation], EntityCheck]]
ValueChecks: TypeAlias = dict[type, Callable[[Any, Simulation], ValueCheck]]
"""What a file says -> a function that makes the check of it."""
