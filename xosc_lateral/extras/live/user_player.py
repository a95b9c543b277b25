"""What happens with an output and with its source in a user's own player, the library of esmini.

Vehicles under test are driven from outside, as in the runs of the check; what is compared, and how, is what the check
compares.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.note import Note
from xosc_lateral.extras.live.esmini_library import OBJECT_STATE, open_player
from xosc_lateral.extras.live.esmini_places import Ledger
from xosc_lateral.files.apart import apart
from xosc_lateral.workflows.conversion.shifts import compare_runs
from xosc_lateral.world.motion.look import look_at, worst_of
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.scenario import Scenario

STEP = 0.01
"""Of the player. [s]"""
ACTION, RUNNING, COMPLETE = 7, 2, 3
"""Kind and states of a storyboard element (`StoryBoardElement::ElementType` and `State`)."""


Happened = tuple[list[float], list[dict[str, NDArray[Any]]], list[tuple[str, int, float]]]
"""Times of frames [s]; states of all objects in each (rows of `OBJECT_STATE`), by name; changes of actions: names from
the story down, the new state, when [s]."""


@apart
def happens(scenario: Path, library: str, driven: Mapping[str, FloatArray], until: float) -> Happened:
    """Play a scenario up to a time [s]; `driven`: time, x, y, heading and speed of who is driven from outside."""
    player = open_player(library, scenario)
    if not hasattr(player, "SE_ReportObjectPosXYH"):
        raise SimulationError(f"{player.where}: has no function SE_ReportObjectPosXYH; esmini 3 is needed")
    time, frames, changes = happened = list[float](), list[dict[str, Any]](), list[tuple[str, int, float]]()

    def look() -> None:
        now, heard = player.SE_GetSimulationTime(), [one[1:] for one in player.heard if one[1] == ACTION]
        time.append(now)
        frames.append(dict(zip(*player.objects(), strict=True)))
        changes.extend((path.decode(errors="replace"), state, now) for _, state, path in heard)
        player.heard.clear()

    look()
    while player.SE_GetQuitFlag() == 0 and player.SE_GetSimulationTime() < until:
        then = player.SE_GetSimulationTime() + STEP
        for number in map(player.SE_GetId, range(player.SE_GetNumberOfObjects())):
            name = player.SE_GetObjectName(number).decode(errors="replace")
            if name in driven:
                x, y, heading, speed = (float(np.interp(then, driven[name][0], row)) for row in driven[name][1:])
                player.SE_ReportObjectPosXYH(number, x, y, heading)
                player.SE_ReportObjectSpeed(number, speed)
        player.SE_StepDT(STEP)
        look()
    player.SE_Close()
    return happened


def as_motion(happened: Happened, run: NominalMotion, network: RoadNetwork, moved: Collection[str]) -> NominalMotion:
    """What happened, as a run of our own player is, so that it is looked at in the same way.

    `run`: of the same scenario, played here; `moved`: whose actions count
    """
    (time, frames, changes), roads, absent = happened, Ledger(network, lambda *_: None), np.zeros((), OBJECT_STATE)
    entities = []
    for entity in run.entities:
        rows = np.array([frame.get(entity.name, absent) for frame in frames], dtype=OBJECT_STATE)
        road, lane = roads.roads_of(rows), rows["lane"].astype(np.int32)
        entities.append(
            EntityMotion.of(
                entity.entity, np.array(time), x=rows["x"], y=rows["y"], heading=rows["h"], speed=rows["speed"],
                road=road.astype(np.int32), lane=lane, s=rows["s"],
                offset=rows["offset_t"] * np.where(road >= 0, network.travel_directions(road, lane), 1.0),
                activity=np.array([Activity.ACTIVE * (entity.name in frame) for frame in frames], dtype=np.uint8),
            )
        )  # fmt: skip
    acts = {"::".join(one.path): one for one in run.actions if one.actor in moved and one.path != ("Init",)}
    over = [(path, at) for path, state, at in changes if state == COMPLETE]
    actions = tuple(
        replace(acts[path], start=start, end=min((at for one, at in over if one == path and at >= start), default=None))
        for path, state, start in changes
        if state == RUNNING and path in acts
    )
    return replace(run, step=STEP, entities=tuple(entities), actions=actions, end_time=time[-1])


def told_by_player(
    library: Path,
    scenario: Scenario,
    output: tuple[Path, bytes],
    runs: Iterable[tuple[str, NominalMotion]],
    network: RoadNetwork,
    *,
    egos: Collection[str],
    moved: Collection[str],
    replayed: Collection[str] = (),
) -> Iterator[Note]:
    """What happens otherwise with an output than with its source, and how vehicles move otherwise.

    - `output`: where it will lie, and its content
    - `runs`: how vehicles under test drive, each with its name
    - `moved`: who keeps its maneuvers, and has paths; `replayed`: who follows a trajectory
    """
    with tempfile.NamedTemporaryFile(dir=output[0].parent, prefix=".", suffix=".xosc") as file:
        file.write(output[1])
        file.flush()
        for name, run in runs:
            driven = {one.name: _driven(one, network) for one in run.entities if one.name in egos}
            before, after = (
                as_motion(happens(path, str(library), driven, run.end_time), run, network, moved)
                for path in (scenario.path, Path(file.name))
            )
            others = {one.name for one in run.entities} - {*moved}
            compared = compare_runs(scenario, network, before, after, ignored=others, ends=False)
            findings = look_at(network, before, after, {*moved, *replayed}, shifted=compared.first)
            seen = [one.note(name) for one in worst_of((*compared.findings, *findings))]
            for note in (*(change.note for change in compared.changes), *seen):
                yield replace(note, what=f"in the player at {library}: {note.what}", run=name)


def _driven(entity: EntityMotion, network: RoadNetwork) -> FloatArray:
    """Rows of time, x, y, heading and speed, in the player's coordinates."""
    x, y, _, heading = network.header_offset.apply(entity.x, entity.y, entity.z, entity.heading)
    return np.stack([entity.time, x, y, np.unwrap(heading), entity.speed])
