"""What all variants of a conversion have in common: read, played and tried once, and handed on."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from xosc_lateral.files.held import is_file
from xosc_lateral.files.source import check_regular, guard_input, state_key
from xosc_lateral.workflows.conversion.enrich import SegmentedRun
from xosc_lateral.workflows.conversion.event_equivalence import EventEquivalence, ending_at
from xosc_lateral.workflows.conversion.load import Played, load_scenario, play_loaded, road_network
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.world.player.player import play

Latest = TypeVar("Latest")


class Prepared:
    """A scenario, its road and its nominal run; other runs and its segments when they are first asked for."""

    def __init__(self, source: Path, settings: ConvertSettings) -> None:
        self._source, self._asked, self._state = source, _asked(settings), state_key(check_regular(source))
        self._step, self._time_limit = settings.step, settings.time_limit
        self.loaded = load_scenario(
            source, parameters=settings.parameters, allowed=settings.allow, roads=settings.roads, strict=settings.strict
        )
        self.played = play_loaded(self.loaded, self._step, self._time_limit)
        self._latest: dict[str, tuple[Hashable, object]] = {}

    def equivalence(self, egos: tuple[str, ...]) -> EventEquivalence:
        """What happens, also where these vehicles under test drive otherwise."""
        return self._latest_made(
            "meaning", egos, lambda: EventEquivalence(self.played, egos, step=self._step, time_limit=self._time_limit)
        )

    def until(self, end: float) -> Played:
        """The same run, stopped at another time. [s]"""
        played = self.played

        def stopped() -> Played:
            later = ending_at(played.scenario, end)
            return replace(played, motion=play(later, played.network, step=self._step, time_limit=end + 1.0))

        return self._latest_made("until", end, stopped)

    def segmented(self, run: Played, **choices: Any) -> SegmentedRun:
        """One of its runs as drivers see it, see `SegmentedRun`; kept where it is small."""
        key = run.motion, tuple(choices.items())
        made = self._latest_made(
            "segmented", key, lambda: SegmentedRun(run.motion, run.network, trailers=run.trailers, **choices)
        )
        if not made.is_small:
            del self._latest["segmented"]
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

    def _latest_made(self, name: str, key: Hashable, make: Callable[[], Latest]) -> Latest:
        """The latest of a kind: variants with the same settings come one after another."""
        before, value = self._latest.get(name, (None, None))
        if before != key:
            value = make()
            self._latest[name] = key, value
        return value  # type: ignore[return-value]


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
