"""Read a scenario with its road and play it: what every verb that looks at motion begins with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

from msgspec import structs

from xosc_lateral.files.opendrive import read_opendrive
from xosc_lateral.files.openscenario.read import NO_ROADS, RoadSearch, read_scenario
from xosc_lateral.files.source import check_regular, guard_input, state_key
from xosc_lateral.workflows.conversion.settings import STEP
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.player.player import play
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario import Scenario
from xosc_lateral.world.scenario.conditions import at_time


@dataclass(frozen=True, eq=False, slots=True)
class Played:
    """A scenario, its road, its nominal motion."""

    scenario: Scenario
    network: RoadNetwork
    motion: NominalMotion

    @property
    def trailers(self) -> dict[str, str]:
        """Entity that is pulled from the start -> entity that pulls it."""
        return {entity.trailer: entity.name for entity in self.scenario.entities if entity.trailer is not None}


def play_scenario(
    path: Path,
    *,
    parameters: Mapping[str, str] | None = None,
    step: float = STEP,
    time_limit: float | None = None,
    allowed: Iterable[Path] = (),
    roads: RoadSearch = NO_ROADS,
    strict: bool = False,
) -> Played:
    """Read and play.

    - `path`: the ``.xosc`` file
    - `parameters`: values that replace those declared
    - `time_limit`: [s]
    - `allowed`: folders, besides those around the scenario, that its road and catalogs may lie in
    - `roads`: where else its road may lie
    - `strict`: refuse a missing vehicle catalog, instead of playing a usual car

    Raises `FormatError, PlaybackError`: with file, line and element.
    """
    values = tuple(sorted((parameters or {}).items()))
    scenario = _read(path, values, tuple(allowed), roads, strict)
    network = RoadNetwork(()) if scenario.road_file is None else road_network(scenario.road_file)
    return _played(_Playable(input_hashes(scenario, network), values, step, time_limit, scenario, network))


def _read(
    path: Path, parameters: tuple[tuple[str, str], ...], allowed: tuple[Path, ...], roads: RoadSearch, strict: bool
) -> Scenario:
    """Read a scenario, once for all its variants if that depends on its own file and on the place of its road alone."""
    state = check_regular(path)
    guard_input(path)
    before = _read_before(path, parameters, allowed, roads, strict, state_key(state))
    for scenario in before:
        if scenario.road_file is None or scenario.road_file.is_file():
            return scenario
    scenario = read_scenario(path, dict(parameters), allowed=allowed, roads=roads, strict=strict)
    if not scenario.catalog_locations and not scenario.remarks:
        before[:] = [scenario]
    return scenario


@lru_cache(maxsize=2)
def _read_before(*_key: object) -> list[Scenario]:
    """The scenario that was read from a file in this state, if it was kept."""
    return []


@lru_cache(maxsize=2)  # as `_played`, whose result is the same object for all variants
def play_until(played: Played, end: float, *, step: float) -> Played:
    """The same run, stopped at another time. [s]"""
    storyboard = played.scenario.storyboard
    later = structs.replace(storyboard, stop_trigger=at_time(end, "later", storyboard.place))
    scenario = replace(played.scenario, storyboard=later)
    return replace(played, motion=play(scenario, played.network, step=step, time_limit=end + 1.0))


def input_hashes(scenario: Scenario, network: RoadNetwork) -> tuple[tuple[Path, str], ...]:
    """Every file that was parsed and the SHA-256 of the bytes that were: scenario, catalogs, road."""
    road = () if scenario.road_file is None else ((scenario.road_file, network.sha256),)
    return (*scenario.input_hashes.items(), *road)


@dataclass(frozen=True, slots=True)
class _Playable:
    """What decides on how a scenario plays, as a key; the scenario itself goes along."""

    files: tuple[tuple[Path, str], ...]
    parameters: tuple[tuple[str, str], ...]
    step: float
    time_limit: float | None
    scenario: Scenario = field(compare=False)
    network: RoadNetwork = field(compare=False)


@lru_cache(maxsize=2)  # variants of one scenario come one after another, and playing is most of their work
def _played(playable: _Playable) -> Played:
    motion = play(playable.scenario, playable.network, step=playable.step, time_limit=playable.time_limit)
    return Played(playable.scenario, playable.network, motion)


def road_network(path: Path) -> RoadNetwork:
    """Read a road, once per process for as long as the file stays the same."""
    state = check_regular(path)
    guard_input(path)
    return _road_network(path, state_key(state))


@lru_cache(maxsize=32)
def _road_network(path: Path, _state: tuple[int, ...]) -> RoadNetwork:
    return read_opendrive(path)
