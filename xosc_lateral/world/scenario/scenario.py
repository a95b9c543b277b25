"""A scenario as read: everything that playing and writing need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from msgspec import Struct

from xosc_lateral.world.scenario.entity import Entity
from xosc_lateral.world.scenario.enums import ParameterType
from xosc_lateral.world.scenario.place import Name, Place, Unsupported, Zero, called
from xosc_lateral.world.scenario.storyboard import Storyboard


class FileHeader(Struct, frozen=True):
    """Version, author, description; `date` as written."""

    major: int
    minor: int
    author: str
    description: str
    date: str

    @property
    def version(self) -> tuple[int, int]:
        """(1, 0) to (1, 3)."""
        return self.major, self.minor

    @property
    def is_left_handed(self) -> bool:
        """Written for CARLA, which says so at the start of the description: y points to the right."""
        return self.description.lstrip().startswith("CARLA:")


class Parameter(Struct, frozen=True):
    """A declared parameter or variable with its value after overrides and expressions, as text."""

    name: str
    type: ParameterType
    value: str
    place: Place


class TrafficSignalPhase(Struct, frozen=True):
    """States of signals during one phase; `duration` [s]"""

    name: Name
    duration: float
    states: tuple[tuple[str, str], ...]


class TrafficSignalController(Struct, frozen=True):
    """Phases one after another, for ever; `delay` [s] to the `reference` controller."""

    name: str
    delay: Zero
    reference: str | None
    phases: Annotated[tuple[TrafficSignalPhase, ...], called("Phase")]
    place: Place


@dataclass(frozen=True, slots=True)
class Scenario:
    """One concrete scenario."""

    path: Path  # the file, as given
    header: FileHeader
    parameters: Mapping[str, Parameter]
    variables: Mapping[str, Parameter]
    """Global ones; a player starts from these values."""
    catalog_locations: Mapping[str, Path]  # catalog element name (``VehicleCatalog``) to its folder or file
    road_file: Path | None  # roadNetwork/LogicFile, resolved against the scenario's folder; None: no road
    traffic_signal_controllers: tuple[TrafficSignalController, ...]
    entities: tuple[Entity, ...]
    """In file order; a trailer described inside its tractor follows it as an entity of its own."""
    storyboard: Storyboard
    remarks: tuple[Unsupported, ...] = ()
    """What was read over because motion does not depend on it, or is replaced (a controller whose catalog is
    missing)."""
    input_hashes: Mapping[Path, str] = field(default_factory=dict)
    """Every file that was parsed, the scenario first, and the SHA-256 of the bytes that were."""
    source: bytes = field(default=b"", repr=False)  # the scenario file's bytes: the writer parses them again

    @property
    def input_files(self) -> tuple[Path, ...]:
        """Every file that was parsed, the scenario first."""
        return tuple(self.input_hashes)

    def entity(self, name: str) -> Entity:
        """The entity of that name; `KeyError` if there is none (the reader has checked every reference)."""
        for entity in self.entities:
            if entity.name == name:
                return entity
        raise KeyError(name)
