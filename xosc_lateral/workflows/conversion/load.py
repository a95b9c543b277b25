"""Read a scenario with its road and play it: what every verb that looks at motion begins with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

from xosc_lateral.base.note import remarked_before
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.files.openscenario.read import NO_ROADS, RoadSearch, read_scenario
from xosc_lateral.files.source import check_regular, guard_input, state_key
from xosc_lateral.workflows.options import STEP
from xosc_lateral.workflows.playing.check import doubts_about
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


@dataclass(frozen=True, eq=False, slots=True)
class Loaded:
    """A scenario and its road."""

    files: Mapping[Path, str]  # every file that was parsed and the SHA-256 of its bytes
    scenario: Scenario
    network: RoadNetwork


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
    """Read a scenario and its road.

    `parameters` replace those declared; its road and catalogs may lie in `allowed` folders besides those around it, its
    road also where `roads` says; `strict`: a missing vehicle catalog is refused, instead of played as a usual car.

    Raises `FormatError`: with file, line and element.
    """
    scenario = read_scenario(
        path, dict(sorted((parameters or {}).items())), allowed=tuple(allowed), roads=roads, strict=strict
    )
    if scenario.road_file is None:
        return Loaded(scenario.input_hashes, scenario, RoadNetwork(()))
    with remarked_before(lambda: scenario.notes):
        network = road_network(scenario.road_file)
    return Loaded({**scenario.input_hashes, scenario.road_file: network.sha256}, scenario, network)


def play_loaded(loaded: Loaded, step: float, time_limit: float | None) -> Played:
    """Play nominally; raises `PlaybackError`."""
    scenario, network = loaded.scenario, loaded.network
    with remarked_before(lambda: network.notes):
        played = Played(scenario, network, play(scenario, network, step=step, time_limit=time_limit))
    motion, doubts = played.motion, doubts_about(played.motion, played.network, played.trailers)
    return replace(played, motion=replace(motion, notes=(*played.network.notes, *motion.notes, *doubts)))


def road_network(path: Path) -> RoadNetwork:
    """Read a road, once per process for as long as the file stays the same."""
    state = check_regular(path)
    guard_input(path)
    return _road_network(path, state_key(state))


@lru_cache(maxsize=32)
def _road_network(path: Path, _state: tuple[int, ...]) -> RoadNetwork:
    return read_opendrive(path)
