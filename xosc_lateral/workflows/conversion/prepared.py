"""What all variants of a conversion have in common: read, played and tried once, and handed on."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

from xosc_lateral.files.held import is_file
from xosc_lateral.files.source import check_regular, guard_input, state_key
from xosc_lateral.workflows.conversion.enrich import SegmentedRun
from xosc_lateral.workflows.conversion.event_equivalence import EventEquivalence, ending_at
from xosc_lateral.workflows.conversion.load import Played, load_scenario, play_loaded, road_network
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.world.player.player import play


class Prepared:
    """A scenario, its road and its nominal run; other runs and its segments when they are first asked for."""

    def __init__(self, source: Path, settings: ConvertSettings) -> None:
        self._source, self._asked, self._state = source, _asked(settings), state_key(check_regular(source))
        self.loaded = load_scenario(
            source, parameters=settings.parameters, allowed=settings.allow, roads=settings.roads, strict=settings.strict
        )
        self.played = played = play_loaded(self.loaded, settings.step, settings.time_limit)
        step, limit = settings.step, settings.time_limit

        # Of each the latest is kept: variants with the same settings come one after another.
        def later(end: float) -> Played:
            run = play(ending_at(played.scenario, end), played.network, step=step, time_limit=end + 1.0)
            return replace(played, motion=run)

        self.equivalence = lru_cache(1)(lambda egos: EventEquivalence(played, egos, step=step, time_limit=limit))
        """What happens, also where these vehicles under test (a tuple of names) drive otherwise."""
        self.until = lru_cache(1)(later)
        """The same run, stopped at another time. [s]"""
        self._segmented = lru_cache(1)(partial(SegmentedRun, network=played.network, trailers=played.trailers))

    def segmented(self, run: Played, **choices: Any) -> SegmentedRun:
        """One of its runs as drivers see it, see `SegmentedRun`; kept where it is small."""
        made = self._segmented(run.motion, **choices)
        if not made.is_small:
            self._segmented.cache_clear()
        return made

    def holds_for(self, source: Path, settings: ConvertSettings) -> bool:
        """Whether it is what would be read and played now: nothing but its file and its road was looked for."""
        scenario = self.loaded.scenario
        if (source, _asked(settings)) != (self._source, self._asked) or scenario.catalog_locations or scenario.notes:
            return False
        if state_key(check_regular(source)) != self._state:
            return False
        guard_input(source)
        road = scenario.road_file
        return road is None or (is_file(road) and road_network(road) is self.loaded.network)


def _asked(settings: ConvertSettings) -> Hashable:
    """Settings that decide on what is read and played."""
    parameters = tuple(sorted(settings.parameters.items()))
    return parameters, tuple(settings.allow), settings.roads, settings.strict, settings.step, settings.time_limit


_LAST: list[Prepared] = []
"""For calls one after another with variants of one scenario; the only thing that is kept between conversions."""


def prepare(source: Path, settings: ConvertSettings) -> Prepared:
    """Read and play a scenario, unless it was the last one and nothing has changed.

    Raises `FormatError`, `PlaybackError`: with file, line and element.
    """
    if not (_LAST and _LAST[0].holds_for(source, settings)):
        _LAST.clear()
        _LAST.append(Prepared(source, settings))
    return _LAST[0]
