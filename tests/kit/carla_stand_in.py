"""A stand-in for CARLA under ScenarioRunner's own code: bodies that obey at once, and a clock of 20 Hz.

`python carla_stand_in.py SCENARIO_RUNNER FILE.xosc SECONDS ROWS.csv` runs a file through the parser, the behaviour tree
and the controls of a checkout of ScenarioRunner, and writes a row (time, name, x, y) of every object in every frame, in
the axes of OpenSCENARIO. What ScenarioRunner asks of CARLA and no scenario of ours needs (sensors, lights, weather) is
a blank.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, field
from importlib import import_module
from itertools import count
from math import cos, radians, sin, sqrt
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, Self

FRAME_TIME = 0.05


class Blank:
    """Whatever is asked of it, called on it or compared with it: nothing happens."""

    def __init__(self, *_: Any, **__: Any) -> None: ...

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Blank()

    def __call__(self, *_: Any, **__: Any) -> Blank:
        return self

    def __iter__(self) -> Any:
        return iter(())

    def __or__(self, _: Any) -> Blank:
        return self

    def __float__(self) -> float:
        return 0.0


@dataclass
class Vector3D:
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0

    def __add__(self, other: Vector3D) -> Self:
        return type(self)(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vector3D) -> Self:
        return type(self)(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, factor: float) -> Self:
        return type(self)(self.x * factor, self.y * factor, self.z * factor)

    __rmul__ = __mul__

    def length(self) -> float:
        return sqrt(self.x**2 + self.y**2 + self.z**2)

    def make_unit_vector(self) -> Self:
        return self * (1.0 / self.length()) if self.length() else self

    def distance(self, other: Vector3D) -> float:
        return (self - other).length()


class Location(Vector3D): ...


@dataclass
class Rotation:
    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0

    def get_forward_vector(self) -> Vector3D:
        return Vector3D(cos(radians(self.yaw)), sin(radians(self.yaw)))


@dataclass
class Transform:
    location: Location = field(default_factory=Location)
    rotation: Rotation = field(default_factory=Rotation)


class Actor:
    """A body at a place, which has the velocity that it was last given."""

    is_alive = True

    def __init__(self, number: int, blueprint: Blueprint, transform: Transform) -> None:
        self.id, self.type_id, self.attributes = number, blueprint.id, dict(blueprint.values)
        self.transform, self.velocity, self.turn = transform, Vector3D(), 0.0
        self.bounding_box = SimpleNamespace(extent=Vector3D(2.5, 1.0, 0.8), location=Location())

    def get_transform(self) -> Transform:
        place, turned = self.transform.location, self.transform.rotation
        return Transform(Location(place.x, place.y, place.z), Rotation(turned.pitch, turned.yaw, turned.roll))

    def set_transform(self, transform: Transform) -> None:
        self.transform = transform

    def get_location(self) -> Location:
        return self.get_transform().location

    def get_velocity(self) -> Vector3D:
        return self.velocity

    def set_target_velocity(self, velocity: Vector3D) -> None:
        self.velocity = velocity

    def set_target_angular_velocity(self, velocity: Vector3D) -> None:
        self.turn = velocity.z

    def get_physics_control(self) -> SimpleNamespace:
        return SimpleNamespace(wheels=[])

    def advance(self) -> None:
        self.transform.location += self.velocity * FRAME_TIME
        self.transform.rotation.yaw += self.turn * FRAME_TIME

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Blank()


class Vehicle(Actor): ...


class Walker(Actor): ...


@dataclass
class Blueprint:
    id: str
    values: dict[str, str] = field(default_factory=dict)

    def has_attribute(self, name: str) -> bool:
        return name in self.values

    def has_tag(self, name: str) -> bool:
        return self.id.startswith(name)

    def set_attribute(self, name: str, value: str) -> None:
        self.values[name] = value


class Library:
    def filter(self, name: str) -> list[Blueprint]:
        return [Blueprint(name.replace("*", "one"), {"role_name": ""})]

    def find(self, name: str) -> Blueprint:
        return Blueprint(name)


class World:
    """The bodies and the clock."""

    def __init__(self) -> None:
        self.actors: dict[int, Actor] = {}
        self.numbers, self.frame = count(1), 0

    def spawn(self, blueprint: Blueprint, transform: Transform) -> Actor:
        kind = Walker if blueprint.id.startswith("walker") else Vehicle if blueprint.id.startswith("vehicle") else Actor
        actor = kind(next(self.numbers), blueprint, transform)
        self.actors[actor.id] = actor
        return actor

    spawn_actor = try_spawn_actor = spawn

    def get_actors(self, numbers: list[int] | None = None) -> Any:
        return Bodies(self.actors[number] for number in (self.actors if numbers is None else numbers))

    def get_actor(self, number: int) -> Actor | None:
        return self.actors.get(number)

    def get_settings(self) -> SimpleNamespace:
        return SimpleNamespace(synchronous_mode=True, fixed_delta_seconds=FRAME_TIME)

    def get_blueprint_library(self) -> Library:
        return Library()

    def tick(self) -> None:
        self.frame += 1
        for actor in self.actors.values():
            actor.advance()

    wait_for_tick = tick

    def timestamp(self) -> SimpleNamespace:
        now = self.frame * FRAME_TIME
        return SimpleNamespace(
            frame=self.frame, elapsed_seconds=now, delta_seconds=FRAME_TIME, platform_timestamp=time.time()
        )

    def get_map(self) -> Any:
        return Map()

    def __getattr__(self, name: str) -> Any:
        return Blank()


class Bodies(list):  # type: ignore[type-arg]
    def filter(self, _: str) -> list[Actor]:
        return []


class Map(Blank):
    name = "OpenDriveMap"

    def get_spawn_points(self) -> list[Transform]:
        return []

    def get_topology(self) -> list[Any]:
        return []

    def to_opendrive(self) -> str:
        return "<OpenDRIVE"

    def transform_to_geolocation(self, _: Location) -> SimpleNamespace:
        return SimpleNamespace(latitude=0.0, longitude=0.0, altitude=0.0)

    def get_waypoint_xodr(self, *_: Any) -> SimpleNamespace:
        """The origin: who stands in lanes is left to the user's stack, which is not here."""
        return SimpleNamespace(transform=Transform(), lane_id=-1)


class Spawn:
    def __init__(self, blueprint: Blueprint, transform: Transform) -> None:
        self.blueprint, self.transform = blueprint, transform

    def then(self, _: Any) -> Spawn:
        return self


class Client(Blank):
    def __init__(self, world: World) -> None:
        self.world = world

    def get_world(self) -> World:
        return self.world

    def generate_opendrive_world(self, *_: Any) -> World:
        return self.world

    def apply_batch_sync(self, batch: list[Spawn], _: bool) -> list[SimpleNamespace]:
        bodies = [self.world.spawn(each.blueprint, each.transform) for each in batch]
        return [SimpleNamespace(actor_id=body.id, error="") for body in bodies]


class Named(type):
    """A class that has a blank of every name, as an enumeration has."""

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return Blank()


class Everything(ModuleType):
    """A module that has a blank class of every name."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.__path__: list[str] = []

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        made = Named(name, (Blank,), {}) if name[:1].isupper() else Blank()
        setattr(self, name, made)
        return made


def install() -> None:
    """Make `import carla` and `import agents` mean this file."""
    carla = Everything("carla")
    for kind in (Vector3D, Location, Rotation, Transform, Actor, Vehicle, Walker, World, Client):
        setattr(carla, kind.__name__, kind)
    for name in ("AttachmentType", "ActorAttributeType", "LaneType", "TrafficLightState", "VehicleLightState"):
        setattr(carla, name, Blank())
    carla.command = SimpleNamespace(SpawnActor=Spawn, FutureActor=0)  # type: ignore[attr-defined]
    for name in ("SetSimulatePhysics", "ApplyTransform", "SetAutopilot", "SetVehicleLightState", "DestroyActor"):
        setattr(carla.command, name, Blank)
    sys.modules["carla"] = carla
    navigation = ["basic_agent", "constant_velocity_agent", "global_route_planner", "local_planner"]
    for name in ["", ".navigation", ".tools", ".tools.misc", *(f".navigation.{name}" for name in navigation)]:
        sys.modules[f"agents{name}"] = Everything(f"agents{name}")


def main(runner: str, file: str, seconds: float, rows: str) -> None:
    sys.path.insert(0, runner)
    install()
    configuration = import_module("srunner.scenarioconfigs.openscenario_configuration")
    provider = import_module("srunner.scenariomanager.carla_data_provider").CarlaDataProvider
    clock = import_module("srunner.scenariomanager.timer").GameTime
    player = import_module("srunner.scenarios.open_scenario")

    world = World()
    client = Client(world)
    provider.set_client(client)
    provider.set_world(world)
    config = configuration.OpenScenarioConfiguration(file, client, {})
    egos = []
    for ego in config.ego_vehicles:
        blueprint = Blueprint("vehicle.ego", {"role_name": ego.rolename})
        egos.append(world.spawn(blueprint, ego.transform))
        provider.register_actor(egos[-1], ego.transform)
    scenario = player.OpenScenario(world, egos, config, file, timeout=100000)
    clock.restart()
    with Path(rows).open("w", encoding="utf-8") as table:
        for frame in range(int(seconds / FRAME_TIME) + 1):
            world.tick()
            clock.on_carla_tick(world.timestamp())
            provider.on_carla_tick()
            for actor in [actor for actor in world.actors.values() if "role_name" in actor.attributes]:
                place = actor.get_location()
                table.write(f"{frame * FRAME_TIME:.2f},{actor.attributes['role_name']},{place.x!r},{-place.y!r}\n")
            scenario.scenario_tree.tick_once()
            if scenario.scenario_tree.status.name != "RUNNING":
                break


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]), sys.argv[4])
