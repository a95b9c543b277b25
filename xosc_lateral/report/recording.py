"""A played scenario as an MCAP recording with Foxglove's `SceneUpdate` messages, and as a page with a player."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.errors import XoscLateralError
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion, axes
from xosc_lateral.motion.segments import SegmentRow
from xosc_lateral.report.figures import PALETTE, figure_style, label_of, new_figure
from xosc_lateral.report.player.roads import mark_points
from xosc_lateral.report.player.scene import nominal_scene
from xosc_lateral.report.render import render_page
from xosc_lateral.road import RoadNetwork
from xosc_lateral.version import __version__

if TYPE_CHECKING:
    from matplotlib.figure import Figure


FRAME = 0.1
"""Between two messages. [s]"""

MARK_THICKNESS = 0.15
"""Of lines of paint. [m]"""

NANOSECONDS = 1_000_000_000

_POINT = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}

_COLOR = {"type": "object", "properties": {part: {"type": "number"} for part in "rgba"}}

_TURN = {"type": "object", "properties": {part: {"type": "number"} for part in "xyzw"}}

_POSE = {"type": "object", "properties": {"position": _POINT, "orientation": _TURN}}

_TIME = {"type": "object", "title": "time", "properties": {part: {"type": "integer"} for part in ("sec", "nsec")}}

_DURATION = {**_TIME, "title": "duration"}


def _list(**fields: Any) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "object", "properties": fields}}


_LINES = _list(
    type={"type": "integer"},
    pose=_POSE,
    thickness={"type": "number"},
    scale_invariant={"type": "boolean"},
    points={"type": "array", "items": _POINT},
    color=_COLOR,
    colors={"type": "array", "items": _COLOR},
    indices={"type": "array", "items": {"type": "integer"}},
)

_TEXTS = _list(
    pose=_POSE,
    billboard={"type": "boolean"},
    font_size={"type": "number"},
    scale_invariant={"type": "boolean"},
    color=_COLOR,
    text={"type": "string"},
)

SCHEMA = {
    "title": "foxglove.SceneUpdate",
    "type": "object",
    "properties": {
        "deletions": _list(timestamp=_TIME, type={"type": "integer"}, id={"type": "string"}),
        "entities": _list(
            timestamp=_TIME,
            frame_id={"type": "string"},
            id={"type": "string"},
            lifetime=_DURATION,
            frame_locked={"type": "boolean"},
            metadata=_list(key={"type": "string"}, value={"type": "string"}),
            cubes=_list(pose=_POSE, size=_POINT, color=_COLOR),
            lines=_LINES,
            texts=_TEXTS,
        ),
    },
}
"""The part of Foxglove's schema that is used; viewers go by its name."""


def scene_recording(motion: NominalMotion, network: RoadNetwork) -> bytes:
    """MCAP file; same motion, same bytes.

    Raises `XoscLateralError`: The package `mcap` is not installed.

    Parameters
    ----------
    motion : NominalMotion
    network : RoadNetwork
        That it was played on.
    """
    try:
        from mcap.writer import Writer
    except ImportError as error:
        raise XoscLateralError("writing .mcap needs the package mcap: pip install 'xosc-lateral[mcap]'") from error
    buffer = BytesIO()
    writer = Writer(buffer)
    writer.start(library=f"xosc-lateral {__version__}")
    schema = writer.register_schema("foxglove.SceneUpdate", "jsonschema", json.dumps(SCHEMA).encode())
    channel = writer.register_channel("/scene", "json", schema)
    for number, (nanoseconds, message) in enumerate(_messages(motion, network)):
        data = json.dumps(message, separators=(",", ":"), ensure_ascii=False).encode()
        writer.add_message(channel, nanoseconds, data, nanoseconds, number)
    writer.finish()  # type: ignore[no-untyped-call]
    return buffer.getvalue()


def _messages(motion: NominalMotion, network: RoadNetwork) -> Iterator[tuple[int, dict[str, Any]]]:
    """Time [ns] and message of every frame."""
    every = max(1, round(FRAME / motion.step))
    count = len(motion.entities[0].time) if motion.entities else 0
    shown: set[str] = set()
    for row in range(0, count, every):
        nanoseconds = round(float(motion.entities[0].time[row]) * NANOSECONDS)
        stamp = {"sec": nanoseconds // NANOSECONDS, "nsec": nanoseconds % NANOSECONDS}
        present = [(k, one) for k, one in enumerate(motion.entities) if one.activity[row] & Activity.ACTIVE]
        gone = shown - {one.name for _, one in present}
        shown = {one.name for _, one in present}
        entities = [_vehicle(one, number, row, stamp) for number, one in present]
        if row == 0:
            entities.insert(0, _road(motion, network, stamp))
        deletions = [{"timestamp": stamp, "type": 0, "id": name} for name in sorted(gone)]
        yield nanoseconds, {"deletions": deletions, "entities": entities}


def _entity(name: str, stamp: dict[str, int]) -> dict[str, Any]:
    lasts_for_ever = {"sec": 0, "nsec": 0}
    return {"timestamp": stamp, "frame_id": "world", "id": name, "lifetime": lasts_for_ever, "frame_locked": False}


def _vehicle(motion: EntityMotion, number: int, row: int, stamp: dict[str, int]) -> dict[str, Any]:
    box = motion.entity.bounding_box
    turn = _rotation(float(motion.heading[row]), float(motion.pitch[row]), float(motion.roll[row]))
    reference = np.array([motion.x[row], motion.y[row], motion.z[row]])
    centre = reference + turn @ np.array([box.center_x, box.center_y, box.center_z])
    orientation = _quaternion(float(motion.heading[row]), float(motion.pitch[row]), float(motion.roll[row]))
    label = {"position": _point(centre + np.array([0.0, 0.0, 0.5 * box.height + 0.8])), "orientation": _UPRIGHT}
    color = _color(PALETTE[number % len(PALETTE)])
    return _entity(motion.name, stamp) | {
        "metadata": [{"key": "speed", "value": f"{motion.speed[row]:.2f} m/s"}],
        "cubes": [
            {
                "pose": {"position": _point(centre), "orientation": orientation},
                "size": {"x": box.length, "y": box.width, "z": box.height},
                "color": color,
            }
        ],
        "texts": [
            {
                "pose": label,
                "billboard": True,
                "font_size": 1.0,
                "scale_invariant": False,
                "color": color,
                "text": motion.name,
            }
        ],
    }


def _road(motion: NominalMotion, network: RoadNetwork, stamp: dict[str, int]) -> dict[str, Any]:
    places = [np.column_stack([one.x, one.y])[(one.activity & Activity.ACTIVE) != 0] for one in motion.entities]
    lines = [
        {
            "type": 0,
            "pose": {"position": _point(np.zeros(3)), "orientation": _UPRIGHT},
            "thickness": MARK_THICKNESS,
            "scale_invariant": False,
            "points": [_point(point) for point in points],
            "color": {"r": 0.8, "g": 0.8, "b": 0.8, "a": 1.0},
            "colors": [],
            "indices": [],
        }
        for points in mark_points(network, np.concatenate(places))
    ]
    return _entity("road", stamp) | {"lines": lines}


_UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


def _point(point: NDArray[np.float64]) -> dict[str, float]:
    return {axis: round(float(value), 4) for axis, value in zip("xyz", point, strict=True)}


def _color(name: str) -> dict[str, float]:
    return {part: int(name[k : k + 2], 16) / 255 for part, k in zip("rgb", (1, 3, 5), strict=True)} | {"a": 1.0}


def _rotation(heading: float, pitch: float, roll: float) -> NDArray[np.float64]:
    """Rz(heading) Ry(pitch) Rx(roll), as OpenSCENARIO turns."""
    turned = axes(*(np.array([angle]) for angle in (heading, pitch, roll)))
    return np.stack([axis[0] for axis in turned], axis=1)


def _quaternion(heading: float, pitch: float, roll: float) -> dict[str, float]:
    """The same rotation as a unit quaternion."""
    (ch, sh), (cp, sp), (cr, sr) = ((np.cos(0.5 * a), np.sin(0.5 * a)) for a in (heading, pitch, roll))
    parts = {
        "x": ch * cp * sr - sh * sp * cr,
        "y": ch * sp * cr + sh * cp * sr,
        "z": sh * cp * cr - ch * sp * sr,
        "w": ch * cp * cr + sh * sp * sr,
    }
    return {name: round(float(value), 6) for name, value in parts.items()}


ROW_STEP = 0.1
"""Rows that are drawn. [s]"""


@figure_style()
def nominal_speeds(motion: NominalMotion) -> Figure:
    """Speed of every entity over time."""
    figure, axes = new_figure(1, 1, height=3.0)
    ax = axes[0, 0]
    every = max(1, round(ROW_STEP / motion.step))
    for number, entity in enumerate(motion.entities):
        present = (entity.activity[::every] & Activity.ACTIVE) != 0
        speed = np.where(present, entity.speed[::every], np.nan)
        ax.plot(entity.time[::every], speed, color=PALETTE[number % len(PALETTE)], label=label_of(entity.name))
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    ax.set_xlabel("time [s]")
    ax.set_ylabel("speed [m/s]")
    if 0 < len(motion.entities) <= len(PALETTE):
        figure.legend(ncols=min(6, len(motion.entities)), loc="outside upper right")
    return figure


def view_page(motion: NominalMotion, network: RoadNetwork, *, source: str, provenance: Mapping[str, object]) -> str:
    """HTML page with the player, self-contained; same input, same bytes.

    Parameters
    ----------
    motion : NominalMotion
        As played.
    network : RoadNetwork
        That it was played on.
    source : str
        File name, for the reader.
    provenance : mapping
        Shown in the footer.
    """
    notes = [
        {"what": note.what, "element": note.element, "file": Path(note.path).name, "line": str(note.line or "")}
        for note in motion.notes
    ]
    return render_page(
        "view.html",
        title=Path(source).name,
        provenance=provenance,
        motion=motion,
        scene=nominal_scene(motion, network),
        speeds=nominal_speeds(motion),
        notes=notes,
    )


def as_text(rows: Sequence[SegmentRow]) -> str:
    """One line per segment."""
    width = max((len(row.entity) for row in rows), default=0)
    return "\n".join(
        f"{row.entity:<{width}}  {row.start:8.2f} - {row.end:8.2f} s  "
        + (f"road {row.road} lane {row.lane}: road-following" if row.road_following else f"no: {row.why}")
        for row in rows
    )
