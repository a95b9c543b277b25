"""What happens with an output and with its source in a user's own player, the library of esmini.

Vehicles under test are driven from outside, as in the runs of the check; what is compared is what happens.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.note import Note
from xosc_lateral.extras.live.esmini_library import StoryboardCallback, open_player
from xosc_lateral.files.apart import apart
from xosc_lateral.workflows.conversion.shifts import EVENT_TOLERANCE, later
from xosc_lateral.world.motion.nominal import EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork

STEP = 0.01
"""Of the player. [s]"""
ACTION, RUNNING = 7, 2
"""Kind and state of a storyboard element (`StoryBoardElement::ElementType` and `State`)."""

Happened = tuple[dict[str, list[float]], dict[str, int]]
"""Starts of each action [s], by its names from the story down, and the last lane of each object."""


@apart
def happens(scenario: Path, library: str, driven: Mapping[str, FloatArray], until: float) -> Happened:
    """Play a scenario up to a time [s]; `driven`: time, x, y, heading and speed of who is driven from outside."""
    player = open_player(library, scenario)
    starts: dict[str, list[float]] = {}

    def note(_name: bytes, kind: int, state: int, path: bytes) -> None:
        if (kind, state) == (ACTION, RUNNING):
            starts.setdefault(path.decode(errors="replace"), []).append(player.SE_GetSimulationTime())

    for element in player.heard:
        note(*element)
    back = StoryboardCallback(note)
    player.SE_RegisterStoryBoardElementStateChangeCallback(back)
    if not hasattr(player, "SE_ReportObjectPosXYH"):
        raise SimulationError(f"{player.where}: has no function SE_ReportObjectPosXYH; esmini 3 is needed")
    lanes: dict[str, int] = {}
    while player.SE_GetQuitFlag() == 0 and player.SE_GetSimulationTime() < until:
        then = player.SE_GetSimulationTime() + STEP
        for number in map(player.SE_GetId, range(player.SE_GetNumberOfObjects())):
            name, state = player.SE_GetObjectName(number).decode(errors="replace"), player.state(number)
            if name in driven:
                x, y, heading, speed = (float(np.interp(then, driven[name][0], row)) for row in driven[name][1:])
                player.SE_ReportObjectPosXYH(number, x, y, heading)
                player.SE_ReportObjectSpeed(number, speed)
            elif state is not None:
                lanes[name] = state.lane
        player.SE_StepDT(STEP)
    player.SE_Close()
    return starts, lanes


def told_by_player(
    library: Path,
    source: Path,
    output: tuple[Path, bytes],
    runs: Iterable[tuple[str, NominalMotion]],
    network: RoadNetwork,
    *,
    egos: Collection[str],
    moved: Collection[str],
    allowed: float,
) -> Iterator[Note]:
    """What happens otherwise with an output.

    - `output`: where it will lie, and its content
    - `runs`: how vehicles under test drive, each with its name
    - `moved`: who keeps its maneuvers, and has paths
    - `allowed`: by how much an event comes earlier or later in the check [s]
    """
    with tempfile.NamedTemporaryFile(dir=output[0].parent, prefix=".", suffix=".xosc") as file:
        file.write(output[1])
        file.flush()
        for name, run in runs:
            driven = {one.name: _driven(one, network) for one in run.entities if one.name in egos}
            before, after = (happens(path, str(library), driven, run.end_time) for path in (source, Path(file.name)))
            for what in _otherwise(before, after, run, moved, allowed + EVENT_TOLERANCE):
                yield Note(f"in the player at {library}: {what}", is_warning=True, run=name)


def _driven(entity: EntityMotion, network: RoadNetwork) -> FloatArray:
    """Rows of time, x, y, heading and speed, in the player's coordinates."""
    x, y, _, heading = network.header_offset.apply(entity.x, entity.y, entity.z, entity.heading)
    return np.stack([entity.time, x, y, np.unwrap(heading), entity.speed])


def _otherwise(
    before: Happened, after: Happened, run: NominalMotion, moved: Collection[str], tolerance: float
) -> Iterator[str]:
    """Events of vehicles that run more or less often, or at other times, and who ends in another lane."""
    actions = {"::".join(one.path): one for one in run.actions if one.actor in moved and one.path != ("Init",)}
    for path, action in actions.items():
        then, now = before[0].get(path, []), after[0].get(path, [])
        due = [time for time in then if time < run.end_time - tolerance]
        moves = [b - a for a, b in zip(then, now, strict=False) if abs(b - a) > tolerance]
        if not len(due) <= len(now) <= len(then) or moves:
            how = later(moves[0]) if moves else f"{len(now)} times instead of {len(then)}"
            yield f"event '{action.path[-2]}' of '{action.actor}' happens {how}"
    for entity in sorted(moved):
        then_in, ends_in = before[1].get(entity), after[1].get(entity)
        if then_in != ends_in:
            yield f"'{entity}' ends in lane {ends_in} instead of {then_in}"
