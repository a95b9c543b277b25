"""Read a scenario with its road and play it: what every verb that looks at motion begins with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from xosc_lateral.formats.opendrive import read_opendrive
from xosc_lateral.formats.openscenario import read_scenario
from xosc_lateral.motion.nominal import NominalMotion
from xosc_lateral.motion.playback import play
from xosc_lateral.pipeline.settings import STEP, TIME_LIMIT
from xosc_lateral.road.network import RoadNetwork
from xosc_lateral.scenario import Scenario


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
    time_limit: float = TIME_LIMIT,
    allowed: Iterable[Path] = (),
) -> Played:
    """Read and play.

    Parameters
    ----------
    path : Path
        The ``.xosc`` file.
    parameters : mapping of str to str, optional
        Values that replace those declared.
    step, time_limit : float
        [s]
    allowed : iterable of Path
        Folders, besides those around the scenario, that its road and catalogs may lie in.

    Raises
    ------
    FormatError, PlaybackError
        With file, line and element.
    """
    scenario = read_scenario(path, parameters or {}, allowed=allowed)
    network = RoadNetwork(()) if scenario.road_file is None else road_network(scenario.road_file)
    values = tuple(sorted((parameters or {}).items()))
    return _played(_Playable(_file_states(scenario), values, step, time_limit, scenario, network))


@dataclass(frozen=True, slots=True)
class _Playable:
    """What decides on how a scenario plays, as a key; the scenario itself goes along."""

    files: tuple[tuple[Path, int, int], ...]
    parameters: tuple[tuple[str, str], ...]
    step: float
    time_limit: float
    scenario: Scenario = field(compare=False)
    network: RoadNetwork = field(compare=False)


def _file_states(scenario: Scenario) -> tuple[tuple[Path, int, int], ...]:
    """Every file that went in, with time of change and size; links resolved, for one name may come to mean another."""
    files = [*scenario.input_files, *([scenario.road_file] if scenario.road_file else [])]
    states = ((path.resolve(), path.stat()) for path in (scenario.path, *files))
    return tuple((path, state.st_mtime_ns, state.st_size) for path, state in states)


@lru_cache(maxsize=2)  # variants of one scenario come one after another, and playing is most of their work
def _played(playable: _Playable) -> Played:
    motion = play(playable.scenario, playable.network, step=playable.step, time_limit=playable.time_limit)
    return Played(playable.scenario, playable.network, motion)


def road_network(path: Path) -> RoadNetwork:
    """Read a road, once per process for as long as the file stays the same."""
    state = path.stat()
    return _road_network(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=32)
def _road_network(path: Path, _modified: int, _size: int) -> RoadNetwork:
    return read_opendrive(path)
