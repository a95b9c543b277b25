"""Scenarios of any number of cars and any duration: 35 m apart, a lane for each speed; every tenth changes lanes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from laboratory.storyboard import Actor, PlannedEvent, Plot, Vehicle, at_time, lane_change, lane_id
from xosc_lateral.files.templates.template import Bend, Motorway, Straight

GAP = 35.0
"""[m]"""


def write(folder: Path, number: int, seconds: float, speeds: Sequence[float] = (24.0, 29.0, 34.0)) -> Path:
    """The scenario beside its road."""
    length = 500.0 + GAP * number / len(speeds) + max(speeds) * seconds
    parts = (Straight(300.0), Bend(-1800.0, 350.0, 150.0), Bend(1800.0, 350.0, 150.0))
    rest = Straight(length - sum(part.length for part in parts))
    motorway = Motorway(alignment=(*parts, rest), lanes=len(speeds), lane_width=3.5, left_hand=False)
    lanes = [k % len(speeds) for k in range(number)]
    actors = tuple(
        Actor(f"Car{k}", Vehicle.CAR, lane, 50.0 + GAP * (k // len(speeds)), speeds[lane])
        for k, lane in enumerate(lanes)
    )
    steps = tuple(
        PlannedEvent(f"Car{k}", f"Change{k}", lane_change(lane_id(motorway, 1), 5), at_time(round(5.0 + 0.05 * k, 2)))
        for k in range(0, number, 10)
        if len(speeds) > 1 and lanes[k] != 1
    )
    folder.mkdir(exist_ok=True)
    (folder / "many.xodr").write_text(motorway.to_xml("many"))
    path = folder / "many.xosc"
    path.write_text(Plot("Many cars", motorway, actors, steps, duration=seconds).to_xml("many.xodr"))
    return path
