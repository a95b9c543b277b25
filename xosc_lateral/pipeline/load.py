"""Read a scenario with its road and play it: what every verb that looks at motion begins with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
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
    return Played(scenario, network, play(scenario, network, step=step, time_limit=time_limit))


def road_network(path: Path) -> RoadNetwork:
    """Read a road, once per process for as long as the file stays the same."""
    state = path.stat()
    return _road_network(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=32)
def _road_network(path: Path, _modified: int, _size: int) -> RoadNetwork:
    return read_opendrive(path)
