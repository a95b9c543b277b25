"""What CARLA's ScenarioRunner wants of a scenario; the one place of its quirks.

From its published sources (0.9.16: `openscenario_configuration`, `openscenario_parser`, `open_scenario`,
`actorcontrols`); `tests/kit/scenario_runner.py` holds them as assertions, and `tests/kit/carla_stand_in.py` runs them
where they are there. CARLA itself is not run by any test.

- Version 1.0 alone, and valid; no expressions, and parameters not everywhere: values are written.
- Catalogs are looked for as ``FOLDER/VehicleCatalog.xosc``, of version 1.0: entries are written in place.
- The default control moves waypoints to the middle of their lane. `CONTROL_NAME` goes to them as they are, at their
  times, which count from when it got them: every drive begins at 0 s. Without a next waypoint it fails, so a last one
  lies an hour ahead. It divides by the time left to the next one: vertices lie late between its frames, not on them.
- One waypoint list per drive, stops included: a new one would begin up to a frame late.
- A storyboard's stop trigger is only looked at for criteria; acts end by their own.
- One vehicle is the ego, by a property; else nothing is watched.
- Positions are turned into its left-handed axes, but for the pitch, whose sign it leaves: none is written.
- The sun's intensity is a share, a date has no fraction and no zone.
- Actions that it does not know stop it: left out and named.
- Entities are all there from the start: one that appears later waits where it will. None drives backwards: it is
  turned to where it goes.
- It puts a vehicle's middle where the standard has the rear axle; so do the positions that are written.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from math import cos, sin

import numpy as np
from lxml import etree

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.files.openscenario.element import elements, local_name
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.build import TimedVertices
from xosc_lateral.files.openscenario.write.draft import Draft, Losses, remove
from xosc_lateral.files.openscenario.write.moving import Moving, add_vertices, moving_entities, wrapped
from xosc_lateral.files.openscenario.write.versions import add_missing_overrides
from xosc_lateral.world.motion.nominal import Activity, NominalMotion
from xosc_lateral.world.motion.path_pieces import VERTEX_SPACING, RowStretch, vertex_times
from xosc_lateral.world.scenario.controllers import is_named_under_test
from xosc_lateral.world.scenario.entity import Entity
from xosc_lateral.world.scenario.enums import EntityCategory, Priority
from xosc_lateral.world.scenario.scenario import Scenario

CONTROL_NAME = "vehicle_velocity_control"
"""Its only control that keeps to the times of waypoints and does not move them to the lane (since 0.9.16)."""
FRAME_TIME = 0.05
"""Its default frame. [s]"""
VERTEX_PHASE = 0.8
"""Where in a frame vertices lie. [-] A velocity that reaches one in time is kept for a whole frame, which leaves
1 - 1 / phase of what was amiss: all of it, to and fro, amid frames; a quarter here; on a frame no time is left."""
VERTICES_AFTER_STOP = 3
"""Vertices after a stop, a frame apart: what a stop within a frame leaves, half a frame's way, falls to a hundredth."""
HOLD_DURATION = 3600.0
"""How long after a drive its last waypoint is due. [s]"""
VERSION = (1, 0)

_EGO = ("type", "ego_vehicle")
_FULL_SUN = 100_000.0
"""Direct sunlight (standard, class Sun). [lx]"""
_SIGNALS = ("id=", "pos=")
"""How it is told a traffic light."""
_NO_BLUEPRINT = ("trailer", "semitrailer", "train", "tram")


def start_of(item: Moving) -> tuple[build.Pose, float]:
    """Pose and speed at the start, where an entity that appears later waits: all are there from the start."""
    begin = item.start
    if begin is None:
        return item.pose(item.pieces[0].first if item.pieces else 0), 0.0
    pose, speed = begin
    return pose, max(speed, 0.0)


def add_drives(act: etree._Element, name: str, item: Moving, draft: Draft) -> None:
    """Add a maneuver with an event per drive: from where an entity is placed to where it is placed anew; no pitch."""
    maneuver = build.maneuver(act, name, item.name)
    for number, pieces in enumerate(_drives(item.pieces), start=1):
        name = f"{item.name} trajectory {number}"
        event = build.event(maneuver, name, Priority.OVERRIDE, VERSION)
        placed = pieces[0].placed
        begin = item.trigger_time(pieces[0]) if placed else 0.0
        if placed:
            place = build.private_action(event, f"{name} place")
            build.world_position(build.sub(place, "TeleportAction"), item.pose(pieces[0].first))
        times, columns = _vertices(item, pieces, begin)
        if not draft.scenario.header.is_left_handed:
            columns[4] = np.zeros_like(columns[4])
        columns = [times, *columns[:3], wrapped(columns[3]), *columns[4:]]
        vertices = TimedVertices(len(times), partial(_of_rows, columns))
        add_vertices(build.private_action(event, name), name, draft, vertices)
        build.time_trigger(event, "StartTrigger", begin, VERSION)


def _of_rows(columns: Sequence[FloatArray], part: slice) -> list[FloatArray]:
    return [values[part] for values in columns]


def _drives(pieces: Sequence[RowStretch]) -> list[list[RowStretch]]:
    drives: list[list[RowStretch]] = []
    for piece in pieces:
        if piece.placed or not drives:
            drives.append([])
        drives[-1].append(piece)
    return drives


def _vertices(item: Moving, pieces: Sequence[RowStretch], begin: float) -> tuple[FloatArray, list[FloatArray]]:
    """Times from the drive's start and x, y, z, h, p, r of its vertices. [s], [m], [rad]"""
    path = item.path
    moments = _moments(item, pieces, begin)
    last = pieces[-1].last
    over = float(moments[-1] - path.time[last])
    columns = item.poses_at(moments, slice(pieces[0].first if pieces[0].placed else 0, last + 1))
    onward = float(path.speed[last]) * over if not pieces[-1].stops else 0.0
    heading = float(path.heading[last])
    moments = np.append(moments, moments[-1] + HOLD_DURATION)
    columns = [np.append(values, values[-1]) for values in columns]
    for values, direction in zip(columns[:2], (cos(heading), sin(heading)), strict=True):
        values[-2] += onward * direction
        values[-1] = values[-2] + VERTEX_SPACING * direction
    return moments - begin, columns


def _moments(item: Moving, pieces: Sequence[RowStretch], begin: float) -> FloatArray:
    """Times of the vertices, between frames, from `begin` on. [s]"""
    path, times = item.path, [begin]
    for piece in pieces:
        rows = slice(piece.first, piece.last + 1)
        times += [float(path.time[piece.first]), *vertex_times(path.time[rows], path.x[rows], path.y[rows]).tolist()]
        after = np.arange(1, VERTICES_AFTER_STOP + 1 if piece.stops else 2)
        times += (float(path.time[piece.last]) + FRAME_TIME * after).tolist()
    between = (np.floor((np.array(times[1:]) - begin) / FRAME_TIME - VERTEX_PHASE) + VERTEX_PHASE) * FRAME_TIME
    moments = begin + np.unique(np.append(0.0, np.maximum(np.round(between, 6), VERTEX_PHASE * FRAME_TIME)))
    return np.asarray(moments)


def fit_carla(losses: Losses, draft: Draft, converted: Sequence[str]) -> None:
    """Make a written scenario of version 1.0 one that ScenarioRunner plays; `FormatError` where it has no road."""
    root, scenario, motion = draft.root, draft.scenario, draft.motion
    if not any(item.get("filepath") for item in root.iter("{*}LogicFile")):
        losses.refuse(root, "scenarios without a road", hint="; name one in RoadNetwork/LogicFile")
    for item in elements(root, "TrafficSignals"):
        if not scenario.header.is_left_handed:
            losses.element(item, "ScenarioRunner takes the first phase of the first controller for all")
    _leave_out_unknown(losses, scenario)
    for name in converted:
        _note_ways(losses, motion, name)
    _entities(losses, scenario, converted)
    _assign_controls(root, [e for e in scenario.entities if e.name in converted])
    _places_on_routes(losses, draft)
    for position in root.iter("{*}WorldPosition"):
        if not scenario.header.is_left_handed:
            position.set("p", "0")
    for sun in root.iter("{*}Sun"):
        intensity = float(sun.get("intensity") or 1.0)
        sun.set("intensity", build.decimal(min(intensity / _FULL_SUN, 1.0) if intensity > 1.0 else intensity, 4))
    for item in root.iter("{*}TimeOfDay"):
        item.set("dateTime", (item.get("dateTime") or "")[:19])
    for act in root.iter("{*}Act"):
        build.time_trigger(act, "StopTrigger", motion.end_time, VERSION)


def _leave_out_unknown(losses: Losses, scenario: Scenario) -> None:
    for item in elements(losses.root, *_UNKNOWN):
        why, is_unknown = _UNKNOWN[local_name(item)]
        if is_unknown(item) and not (scenario.header.is_left_handed and local_name(item) in _ACTIONS_OF_CARLA):
            losses.action(item, f"ScenarioRunner {why}")


_ACTIONS_OF_CARLA = ("TrafficSignalStateAction", "TrafficSignalControllerAction", "CustomCommandAction")
"""What a scenario written for CARLA means as ScenarioRunner does."""
_UNKNOWN: dict[str, tuple[str, Callable[[etree._Element], bool]]] = {
    "VisibilityAction": ("has none", lambda item: True),
    "TrafficAction": ("has none", lambda item: True),
    "TrafficSignalStateAction": (
        "finds signals by 'id=' or 'pos=' alone",
        lambda item: not (item.get("name") or "").startswith(_SIGNALS),
    ),
    "TrafficSignalControllerAction": ("has its own phases", lambda item: True),
    "CustomCommandAction": ("would run it as a script", lambda item: True),
    "AbsoluteTargetLane": ("changes lanes by a number of lanes alone", lambda item: True),
    "AbsoluteTargetSpeed": ("drives nobody backwards", lambda item: float(item.get("value") or 0.0) < 0.0),
    "AcquirePositionAction": ("has no times for its way", lambda item: True),
    "AssignRouteAction": ("has no times for its way", lambda item: True),
    "LongitudinalDistanceAction": ("keeps distances in metres alone", lambda item: item.get("distance") is None),
    "SynchronizeAction": ("wants a final speed", lambda item: item.find("{*}FinalSpeed") is None),
}
"""Actions that it does not take, or that end its run."""


def _places_on_routes(losses: Losses, draft: Draft) -> None:
    """Where an entity starts is known from the run; elsewhere there are none for it."""
    for item in elements(losses.root, "RoutePosition"):
        names = [owner.get("entityRef") for owner in item.iterancestors("{*}Private")]
        starts = moving_entities(draft, {one.name: one for one in draft.motion.entities if one.name in names})
        for start in starts.values():
            place = next(item.iterancestors("{*}Position"))
            build.world_position(next(place.iterancestors()), start.pose(0))
            remove(place)
        losses.element(item, "ScenarioRunner has no places on routes")  # which is still there


def _note_ways(losses: Losses, motion: NominalMotion, name: str) -> None:
    """What it can't do of a motion."""
    entity = next(entity for entity in motion.entities if entity.name == name)
    there = (entity.activity & Activity.ACTIVE) != 0
    if not there[0]:
        losses.note(
            f"'{name}' is present from the start instead of appearing later: ScenarioRunner cannot add entities"
        )
    if (entity.speed[there] < 0.0).any():
        losses.note(f"'{name}' drives backwards, and is turned round by ScenarioRunner")
    for item in elements(losses.root, "EntityAction"):
        if item.get("entityRef") == name:
            losses.action(item, "ScenarioRunner needs every car that it controls from start to end")


def _entities(losses: Losses, scenario: Scenario, converted: Sequence[str]) -> None:
    vehicles: dict[str, etree._Element] = {}
    for item in losses.root.iter("{*}ScenarioObject"):
        entity = scenario.entity(item.get("name") or "")
        for reference in item.findall("{*}CatalogReference"):
            item.replace(reference, _usual_vehicle(entity))
        vehicle = item.find("{*}Vehicle")
        if vehicle is not None:
            vehicles[entity.name] = vehicle
            if vehicle.get("vehicleCategory") in _NO_BLUEPRINT:
                losses.note(
                    f"'{entity.name}': CARLA has no {vehicle.get('vehicleCategory')}; any vehicle takes its place"
                )
        elif entity.name in converted and entity.category is EntityCategory.PEDESTRIAN:
            losses.note(
                f"'{entity.name}': ScenarioRunner leads pedestrians along their trajectory, but not at its times"
            )
        elif entity.name in converted:
            losses.note(f"'{entity.name}': ScenarioRunner does not move a {entity.category.value}")
    properties = (item for vehicle in vehicles.values() for item in vehicle.iter("{*}Property"))
    if vehicles and _EGO not in ((item.get("name"), item.get("value")) for item in properties):
        chosen = next((name for name in vehicles if is_named_under_test(name)), next(iter(vehicles)))
        owner = vehicles[chosen].find("{*}Properties")
        assert owner is not None  # asked for by version 1.0
        for old in [old for old in owner if old.get("name") == _EGO[0]]:
            remove(old)
        owner.insert(0, etree.Element("Property", {"name": _EGO[0], "value": _EGO[1]}))


def _usual_vehicle(entity: Entity) -> etree._Element:
    """For one whose catalog is missing: as it was played."""
    box = entity.bounding_box
    vehicle = etree.Element("Vehicle", {"name": entity.object_name or "vehicle.*", "vehicleCategory": "car"})
    outer = build.sub(vehicle, "BoundingBox")
    build.sub(outer, "Center", **_numbers(x=box.center_x, y=box.center_y, z=box.center_z))
    build.sub(outer, "Dimensions", **_numbers(length=box.length, width=box.width, height=box.height))
    build.sub(vehicle, "Performance", maxSpeed="70", maxAcceleration="10", maxDeceleration="10")
    axles = build.sub(vehicle, "Axles")
    for tag, x, steering in (("FrontAxle", 2.0 * box.center_x, 0.5), ("RearAxle", 0.0, 0.0)):
        size = _numbers(maxSteering=steering, wheelDiameter=0.6, trackWidth=0.8 * box.width, positionX=x, positionZ=0.3)
        build.sub(axles, tag, **size)
    build.sub(vehicle, "Properties")
    return vehicle


def _numbers(**values: float) -> dict[str, str]:
    return {name: build.decimal(value, 3) for name, value in values.items()}


def _assign_controls(root: etree._Element, entities: Sequence[Entity]) -> None:
    names = [entity.name for entity in entities if entity.category is EntityCategory.VEHICLE]
    for owner in root.iter("{*}Private"):
        if owner.get("entityRef") in names:
            names.remove(str(owner.get("entityRef")))
            action = etree.Element("PrivateAction")
            both = build.sub(action, "ControllerAction")
            controller = build.sub(both, "AssignControllerAction/Controller", name=CONTROL_NAME)
            build.sub(controller, "Properties/Property", name="module", value=CONTROL_NAME)
            add_missing_overrides(both)
            build.insert_indented(owner, len(owner), action)
