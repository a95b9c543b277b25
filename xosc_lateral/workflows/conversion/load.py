"""Read a scenario with its road and play it: what every verb that looks at motion begins with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.files.openscenario.read import NO_ROADS, RoadSearch, read_scenario
from xosc_lateral.files.source import check_regular, guard_input, state_key
from xosc_lateral.workflows.options import STEP
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.player.player import play
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.scenario import Scenario


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


@dataclass(frozen=True, slots=True)
class Loaded:
    """A scenario and its road; equal where the bytes of all files and the parameters are."""

    files: tuple[tuple[Path, str], ...]  # every file that was parsed and the SHA-256 of its bytes
    parameters: tuple[tuple[str, str], ...]
    scenario: Scenario = field(compare=False)
    network: RoadNetwork = field(compare=False)


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
    """Load and play; see `load_scenario`. Raises `FormatError, PlaybackError`: with file, line and element."""
    loaded = load_scenario(path, parameters=parameters, allowed=allowed, roads=roads, strict=strict)
    return play_loaded(loaded, step, time_limit)


def load_scenario(
    path: Path,
    *,
    parameters: Mapping[str, str] | None = None,
    allowed: Iterable[Path] = (),
    roads: RoadSearch = NO_ROADS,
    strict: bool = False,
) -> Loaded:
    """Read a scenario and its road; once for all its variants if it depends on its file and its road's place alone.

    `parameters` replace those declared; its road and catalogs may lie in `allowed` folders besides those around it, its
    road also where `roads` says; `strict`: a missing vehicle catalog is refused, instead of played as a usual car.

    Raises `FormatError`: with file, line and element.
    """
    values = tuple(sorted((parameters or {}).items()))
    state = check_regular(path)
    guard_input(path)
    folders = tuple(allowed)
    reads = _read_once.cache_info().misses
    scenario = _read_once(path, values, folders, roads, strict, state_key(state))
    is_fresh = _read_once.cache_info().misses > reads
    stands_alone = not scenario.catalog_locations and not scenario.remarks
    if not is_fresh and not (stands_alone and (scenario.road_file is None or scenario.road_file.is_file())):
        # A result that was kept holds only where nothing else was read, or missed.
        scenario = read_scenario(path, dict(values), allowed=folders, roads=roads, strict=strict)
    network, road = RoadNetwork(()), tuple[tuple[Path, str], ...]()
    if scenario.road_file is not None:
        network = road_network(scenario.road_file)
        road = ((scenario.road_file, network.sha256),)
    return Loaded((*scenario.input_hashes.items(), *road), values, scenario, network)


@lru_cache(maxsize=2)
def _read_once(
    path: Path,
    parameters: tuple[tuple[str, str], ...],
    allowed: tuple[Path, ...],
    roads: RoadSearch,
    strict: bool,
    _state: tuple[int, ...],
) -> Scenario:
    return read_scenario(path, dict(parameters), allowed=allowed, roads=roads, strict=strict)


@lru_cache(maxsize=2)  # variants of one scenario come one after another, and playing is most of their work
def play_loaded(loaded: Loaded, step: float, time_limit: float | None) -> Played:
    """Play nominally; raises `PlaybackError`."""
    motion = play(loaded.scenario, loaded.network, step=step, time_limit=time_limit)
    return Played(loaded.scenario, loaded.network, motion)


def road_network(path: Path) -> RoadNetwork:
    """Read a road, once per process for as long as the file stays the same."""
    state = check_regular(path)
    guard_input(path)
    return _road_network(path, state_key(state))


@lru_cache(maxsize=32)
def _road_network(path: Path, _state: tuple[int, ...]) -> RoadNetwork:
    return read_opendrive(path)
