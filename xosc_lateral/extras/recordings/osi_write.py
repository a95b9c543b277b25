"""A played scenario as an OSI trace: one `GroundTruth` per step; lanes stand in the first."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.track import Track
from xosc_lateral.base.version import __version__
from xosc_lateral.extras.recordings.osi_lanes import RoadIds, write_lanes
from xosc_lateral.files.atomic import replace_atomically
from xosc_lateral.files.osi import SUFFIXES, osi
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, MovingTraffic, axes
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.entity import Entity
from xosc_lateral.world.scenario.enums import EntityCategory, VehicleCategory
from xosc_lateral.world.scenario.private_actions import LightStateAction

TOPIC = "ground_truth"
VERSION = (3, 8, 0)  # of OSI, that is written
NANOSECONDS = 1_000_000_000

KINDS = {VehicleCategory.CAR: "MEDIUM_CAR", VehicleCategory.TRUCK: "HEAVY_TRUCK", VehicleCategory.VAN: "DELIVERY_VAN"}
"""Category of OpenSCENARIO -> `VehicleClassification.Type`; others have the same name."""

LIGHTS: Mapping[str, tuple[tuple[str, str], ...]] = {
    "brakeLights": (("brake_light_state", "BRAKE_LIGHT_STATE_NORMAL"),),
    "fogLights": (("front_fog_light", "GENERIC_LIGHT_STATE_ON"), ("rear_fog_light", "GENERIC_LIGHT_STATE_ON")),
    "fogLightsFront": (("front_fog_light", "GENERIC_LIGHT_STATE_ON"),),
    "fogLightsRear": (("rear_fog_light", "GENERIC_LIGHT_STATE_ON"),),
    "highBeam": (("high_beam", "GENERIC_LIGHT_STATE_ON"),),
    "indicatorLeft": (("indicator_state", "INDICATOR_STATE_LEFT"),),
    "indicatorRight": (("indicator_state", "INDICATOR_STATE_RIGHT"),),
    "licensePlateIllumination": (("license_plate_illumination_rear", "GENERIC_LIGHT_STATE_ON"),),
    "lowBeam": (("head_light", "GENERIC_LIGHT_STATE_ON"),),
    "reversingLights": (("reversing_light", "GENERIC_LIGHT_STATE_ON"),),
    "specialPurposeLights": (("emergency_vehicle_illumination", "GENERIC_LIGHT_STATE_ON"),),
    "warningLights": (("indicator_state", "INDICATOR_STATE_WARNING"),),
}
"""`vehicleLightType` of OpenSCENARIO -> fields of OSI's light state, and what they are when lit. OSI has no daytime
running lights, and no words for a light of the user's own."""


def write_osi(
    path: Path,
    motion: MovingTraffic,
    network: RoadNetwork,
    trajectories: Sequence[Track] | None = None,
    *,
    host: str | None = None,
    description: str = "",
) -> Path:
    """Write a trace, ``.mcap``, or ``.osi`` (messages alone); same motion, same bytes.

    `trajectories`: one per entity, where they are not the nominal ones. `host`: entity that is the host vehicle;
    without it the trace has none. `description`: for the file's metadata. Raises `FormatError`, `XoscLateralError`,
    `OSError`.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise FormatError(f"an OSI trace ends in {' or '.join(SUFFIXES)}", path=path)
    messages = ground_truths(motion, network, trajectories, host=host)
    return replace_atomically(path, lambda temporary: _save(temporary, messages, description))


def _save(path: Path, messages: Iterator[Any], description: str) -> None:
    writers, is_mcap = osi("osi_utilities"), path.suffix.lower() == ".mcap"
    writer = writers.MultiTraceWriter() if is_mcap else writers.SingleTraceWriter()
    version, protobuf = ".".join(map(str, VERSION)), str(osi("google.protobuf").__version__)
    # without the time of writing, so that the same motion gives the same bytes
    metadata = {
        "version": "1.0.0",
        "min_osi_version": version,
        "max_osi_version": version,
        "min_protobuf_version": protobuf,
        "max_protobuf_version": protobuf,
        "description": description,
        "authors": f"xosc-lateral {__version__}",
        "data_sources": "OpenSCENARIO, played by xosc-lateral",
        "zero_time": "",
    }
    if not writer.open(path, **({"metadata": metadata} if is_mcap else {})):
        raise OSError(f"{path}: can't be opened for writing")
    with writer:
        if is_mcap:
            about = {
                "net.asam.osi.trace.channel.osi_version": version,
                "net.asam.osi.trace.channel.protobuf_version": protobuf,
                "net.asam.osi.trace.channel.description": "ground truth, one message per step",
            }
            writer.add_channel(TOPIC, osi("osi3.osi_groundtruth_pb2").GroundTruth, about)
        for message in messages:
            if not writer.write_message(message, TOPIC):
                raise OSError(f"{path}: can't be written to")


def ground_truths(
    motion: MovingTraffic,
    network: RoadNetwork,
    trajectories: Sequence[Track] | None = None,
    *,
    host: str | None = None,
) -> Iterator[Any]:
    """One `GroundTruth` after the other; parameters as for `write_osi`."""
    ground_truth = osi("osi3.osi_groundtruth_pb2").GroundTruth
    ids = RoadIds(network, len(motion.entities) + 1)
    paths: Sequence[Track | None] = [None] * len(motion.entities) if trajectories is None else trajectories
    objects = [
        _Object(entity, _kinematics(entity, path, network), _template(entity.entity, number), _lights(motion, entity))
        for number, (entity, path) in enumerate(zip(motion.entities, paths, strict=True), 1)
    ]
    frame = ground_truth()
    frame.version.version_major, frame.version.version_minor, frame.version.version_patch = VERSION
    for number, entity in enumerate(motion.entities, 1):
        if entity.name == host:
            frame.host_vehicle_id.value = number
    if network.geo_reference:
        frame.proj_string = network.geo_reference.strip()
    frame.map_reference = Path(network.path).name
    times = motion.entities[0].time.tolist() if motion.entities else []
    for row, time in enumerate(times):
        message = ground_truth()
        message.CopyFrom(frame)
        nanoseconds = round(time * NANOSECONDS)
        message.timestamp.seconds, message.timestamp.nanos = divmod(nanoseconds, NANOSECONDS)
        if row == 0:
            write_lanes(message, ids)
        for written in objects:
            written.add(message, row, ids)
        yield message


@dataclass(frozen=True, eq=False)
class _Object:
    """An entity, the columns of `_kinematics`, what stays the same, and its lights: from when on, which state."""

    motion: EntityMotion
    columns: FloatArray
    template: Any
    lights: Sequence[tuple[float, Any]]

    def add(self, message: Any, row: int, ids: RoadIds) -> None:
        """Where it is in this row, if it exists then."""
        if not self.motion.activity[row] & Activity.ACTIVE:
            return
        written = message.moving_object.add()
        written.CopyFrom(self.template)
        lit = bisect_right(self.lights, self.motion.time[row], key=itemgetter(0))
        if lit:
            written.vehicle_classification.light_state.CopyFrom(self.lights[lit - 1][1])
        base = written.base
        x, y, z, vx, vy, vz, ax, ay, az, yaw, pitch, roll, rate, road, lane, s = self.columns[row].tolist()
        base.position.x, base.position.y, base.position.z = x, y, z
        base.velocity.x, base.velocity.y, base.velocity.z = vx, vy, vz
        base.acceleration.x, base.acceleration.y, base.acceleration.z = ax, ay, az
        base.orientation.yaw, base.orientation.pitch, base.orientation.roll = yaw, pitch, roll
        base.orientation_rate.yaw = rate
        number = ids.at(int(road), int(lane), s)
        if number is not None:
            written.assigned_lane_id.add().value = number
            written.moving_object_classification.assigned_lane_id.add().value = number


def _kinematics(motion: EntityMotion, path: Track | None, network: RoadNetwork) -> FloatArray:
    """Centre of the box, its velocity and acceleration, yaw, pitch, roll, yaw rate, road, lane, s; shape (n, 16)."""
    pose = motion if path is None else path
    x, y, z, heading = network.header_offset.apply(pose.x, pose.y, pose.z, pose.heading)
    yaw, pitch, roll = np.unwrap(heading), pose.pitch, pose.roll
    box = motion.entity.bounding_box
    ahead, leftwards, upwards = axes(yaw, pitch, roll)
    arm = box.center_x * ahead + box.center_y * leftwards + box.center_z * upwards
    centre = np.stack([x, y, z], axis=1) + arm
    rate = _rate(yaw[:, None], motion)[:, 0]
    turning = np.stack([-arm[:, 1], arm[:, 0], np.zeros(len(x))], axis=1)
    velocity = pose.speed[:, None] * ahead + rate[:, None] * turning
    where = np.stack([motion.road, motion.lane, motion.s], axis=1).astype(np.float64)
    moved = (motion.road >= 0) & ((pose.x != motion.x) | (pose.y != motion.y))
    if moved.any():
        place = network.path_to_lane(pose.x[moved], pose.y[moved], motion.road[moved], motion.s[moved])
        where[moved] = np.stack([place.road, place.lane, place.s], axis=1)
    angles = np.stack([np.angle(np.exp(1j * yaw)), pitch, roll, rate], axis=1)
    return np.concatenate([centre, velocity, _rate(velocity, motion), angles, where], axis=1)


def _rate(values: FloatArray, motion: EntityMotion) -> FloatArray:
    """Change per second within each stretch of motion that is one, shape as the argument."""
    is_there = (motion.activity & Activity.ACTIVE) != 0
    broken = (motion.activity & Activity.TELEPORTED) != 0
    broken[1:] |= is_there[1:] != is_there[:-1]
    rates = np.zeros_like(values)
    borders = [0, *(np.flatnonzero(broken[1:]) + 1).tolist(), len(values)]
    for first, last in pairwise(borders):
        if last - first > 1:
            rates[first:last] = np.gradient(values[first:last], motion.time[first:last], axis=0)
    return rates


def _lights(motion: MovingTraffic, entity: EntityMotion) -> list[tuple[float, Any]]:
    """States of a vehicle's lights, in the order of time; what the scenario says nothing of stays unset."""
    kinds = osi("osi3.osi_object_pb2").MovingObject.VehicleClassification
    state, states_over_time = kinds.LightState(), []
    played = [action for action in motion.actions if action.actor == entity.name]
    for action in sorted(played, key=lambda action: action.start):
        if not isinstance(action.action, LightStateAction):
            continue
        for name, lit in LIGHTS.get(action.action.light, ()):
            off = f"{lit.partition('_STATE_')[0]}_STATE_OFF"
            states = kinds.LightState.DESCRIPTOR.fields_by_name[name].enum_type.values_by_name
            setattr(state, name, states[off if action.action.mode == "off" else lit].number)
        states_over_time.append((action.start, deepcopy(state)))
    return states_over_time


def _template(entity: Entity, number: int) -> Any:
    kinds = osi("osi3.osi_object_pb2").MovingObject
    box = entity.bounding_box
    made = kinds()
    made.id.value = number
    dimension = made.base.dimension
    dimension.length, dimension.width, dimension.height = box.length, box.width, box.height
    made.model_reference = entity.model3d or ""
    word = "Pedestrian" if entity.category is EntityCategory.PEDESTRIAN else "Vehicle"
    reference = made.source_reference.add(type="net.asam.openscenario")
    reference.identifier.extend([word if entity.category is not EntityCategory.MISC else "MiscObject", entity.name])
    if entity.category is EntityCategory.PEDESTRIAN:
        made.type = kinds.TYPE_PEDESTRIAN
    elif entity.category is EntityCategory.MISC:
        made.type = kinds.TYPE_OTHER
    else:
        made.type = kinds.TYPE_VEHICLE
        kind = "OTHER" if (category := entity.vehicle_category) is None else KINDS.get(category, category.name)
        made.vehicle_classification.type = kinds.VehicleClassification.Type.Value(f"TYPE_{kind}")
        made.vehicle_classification.has_trailer = entity.trailer is not None
        # axles from the middle of the box; without axles the reference point stands for the rear one
        attributes, axles = made.vehicle_attributes, entity.axles
        rear = None if axles is None else axles.rear
        places = [(attributes.bbcenter_to_rear, *((0.0, 0.0) if rear is None else (rear.position_x, rear.position_z)))]
        if axles is not None and axles.front is not None:
            places.append((attributes.bbcenter_to_front, axles.front.position_x, axles.front.position_z))
            attributes.radius_wheel = 0.5 * axles.front.wheel_diameter
        for vector, ahead, up in places:
            vector.x, vector.y, vector.z = ahead - box.center_x, -box.center_y, up - box.center_z
    return made
