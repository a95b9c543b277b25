"""What a user can choose for a conversion, declared once.

Python's keywords, the options of the command line, the columns of a table of scenarios and the keys of the
configuration file that decide a conversion are all made from the fields of `ConvertSettings`.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.configuration import SETTINGS, configuration
from xosc_lateral.files.openscenario.read import RoadSearch
from xosc_lateral.files.openscenario.write.draft import Player, TargetPlayer, target
from xosc_lateral.workflows import options as say
from xosc_lateral.workflows.conversion.result import LaneChanges, Neighbours
from xosc_lateral.workflows.opened import RoadLike
from xosc_lateral.workflows.options import STEP, Option, PathLike, Paths, ProfileLike, option

if TYPE_CHECKING:
    from xosc_lateral.drivers.model.profile import DriverProfile

LEAST_STEP = 1e-3
"""Of a simulation; below, a minute is a gigabyte. [s]"""

AUTO = "auto"
"""Profile name for the shipped population, and for nobody who has no driver (a trailer, a tram)."""

AUTO_PROFILE = "motorway"
"""What "auto" chooses: it gives every class, lane and speed its own. Motorcycles ride like cars for want of measured
ones."""


class OutputMode(StrEnum):
    """How offsets are written: by vehicle as it depends on a vehicle under test, or the same for all."""

    AUTO = "auto"
    TRAJECTORY = "trajectory"
    LANE_OFFSET = "lane-offset"


class Addition(StrEnum):
    """What is left out unless asked for."""

    SENSOR = "sensor"
    JAM_CORRIDOR = "jam-corridor"


_KEYWORDS = {Addition.SENSOR: "with_sensor", Addition.JAM_CORRIDOR: "jam_corridor"}


def _player(stated: str) -> dict[str, Any]:
    """Who plays an output: a name, or the library of esmini."""
    if stated in [*Player]:
        return {"player": stated}
    if not Path(stated).exists():
        raise ValueError(f"{stated!r}, expected one of {', '.join(Player)}, or the path of the library of esmini 3")
    return {"player": Player.ESMINI, "player_library": stated}


@say.documented
@dataclass(frozen=True, slots=True)
class ConvertSettings:
    """Settings of one conversion, as plain values that a batch can send and hash.

    Parameters
    ----------
    ego : collection of str
        Vehicles under test, which are left as they are, beside those that the scenario leaves to somebody else (an
        external controller, CARLA's `ego_vehicle`); ("none",): there is none.
    neighbours : {"profile", "borrow", "none"}
        How drivers answer to vehicles beside them: as the profile alone says; by a population's law, too, where the
        profile's answer is not known; not at all. Without: as configured, else "borrow".
    lane_changes : {"written", "lifelike"}
        The way across of lane changes and lane offsets of 2 to 20 s: as written, or as drivers take it (a bell that is
        slightly early, and what moves them in their lane goes on); start, duration and lane stay the file's. Of
        vehicles that react by the distance driven, where no event moves by more than 0.05 s. Without: as configured,
        else "lifelike".
    mode : {"auto", "trajectory", "lane-offset"}
        Play maneuvers out, or keep them and add lane offsets between them; "auto" decides by vehicle: lane offsets for
        those whose motion depends on a vehicle under test.
    player : {"standard", "esmini", "carla"}
        Who is to play it: nobody in particular, or a player with ways of its own.
    player_library : str or Path
        Library of esmini 3, in which the check of a reactive output runs once more; what happens otherwise there is a
        warning.
    version : str
        Of the standard, "1.0" to "1.4"; without it the input's (1.0 for CARLA). What an older version lacks is sampled,
        or left out and named in `Conversion.warnings`.
    attempts : int
        Sample anew up to so many times while vehicles touch or leave their lane that nominally don't.
    with_sensor : bool
        Add the sensor error of the drives that profiles were fitted on, for tests of a perception chain; without, the
        driver alone is written.
    jam_corridor : bool
        Below 40 km/h on motorways (``road/type``) the leftmost lane keeps left and the others right, as laws ask.
        Assumed: no recording that we have shows how far.
    strict : bool
        A missing vehicle catalog is an error, instead of a note and a usual car.

    Raises
    ------
    ValueError
        A version of the standard that can't be written, or that the player does not read.
    """

    # What is said of one option stays together.
    # fmt: off
    profile: str | DriverProfile = option(
        AUTO, say.profile, "--profile", "-p", kind=list[str] | None, cell=say.profile_cell,
        metavar="PROFILE|NAME=PROFILE", gives=say.profile_and_entities, show_default=False,
        help="Name or path of a driver profile; auto: motorway, the population (default). For one entity NAME=PROFILE; "
        "may be repeated.",
    )
    seed: int = option(0, say.whole_number(0), cell=say.as_it_is)
    entity: Mapping[str, str | DriverProfile] = option(
        {}, say.profiles, said_by="--profile", prefix="profile:", entry=say.profile_cell, help="Profiles by entity.",
    )
    only: frozenset[str] | None = option(
        None, say.names, "--enrich", kind=list[str] | None, metavar="NAME", cell=say.as_it_is,
        help="Enrich only this entity; may be repeated.",
    )
    ego: frozenset[str] | None = option(
        None, say.egos, kind=list[str] | None, metavar="NAME", cell=say.as_it_is,
        help="Vehicle under test: left as it is; may be repeated. Those with an external controller are found by "
        "themselves. none: there is none.",
    )
    neighbours: Neighbours = option(
        Neighbours.BORROW, say.one_of(Neighbours), kind=Neighbours | None, cell=say.as_it_is, show_default=False,
        help="How drivers answer to vehicles beside them: as their profile alone says; borrow: by a population's law "
        "where that is not known (default); none: not at all.",
    )
    lane_changes: LaneChanges = option(
        LaneChanges.LIFELIKE, say.one_of(LaneChanges), kind=LaneChanges | None, cell=say.as_it_is, show_default=False,
        help="The way across of lane changes: lifelike: as drivers take it (default), or as written.",
    )
    context: Path | None = option(
        None, Path, kind=Path | None, cell=say.beside,
        help="Table of context over time (columns time, wind_speed, ...).",
    )
    parameters: Mapping[str, str] = option(
        {}, say.texts, "--set", cell=say.json_object, prefix="parameter:", entry=say.as_it_is
    )
    library: tuple[Path, ...] = option((), say.paths, decides=False)
    mode: OutputMode = option(
        OutputMode.AUTO, say.one_of(OutputMode), kind=OutputMode, cell=say.as_it_is,
        help="trajectory: play the maneuvers out; lane-offset: keep them reactive; auto: by vehicle, as it depends on "
        "a vehicle under test.",
    )
    player: Player = option(
        Player.STANDARD, say.one_of(Player), "--player", kind=str | None, cell=say.as_it_is, show_default=False,
        metavar="standard|esmini|carla|LIBRARY", gives=_player,
        help="Who plays it: standard (default), or made for esmini or CARLA's ScenarioRunner. libesminiLib.so or "
        "esminiLib.dll of esmini 3: made for esmini, and a reactive output is checked in it, too.",
    )
    player_library: Path | None = option(
        None, Path, decides=False, said_by="--player",
    )
    version: str | None = option(
        None, str, kind=str | None, metavar="1.0..1.4", cell=say.as_it_is, show_default=False,
        help="Version of OpenSCENARIO to write; default: the input's.",
    )
    allow: tuple[Path, ...] = option((), say.paths, decides=False)
    road: Path | None = option(None, Path, cell=say.beside)
    road_path: tuple[Path, ...] = option((), say.paths, decides=False)
    attempts: int = option(
        1, say.whole_number(1), "--attempts", kind=int, cell=say.as_it_is, min=1,
        help="Attempts at most, while vehicles collide or leave their lane.",
    )
    time_limit: float | None = option(None, say.seconds, cell=say.as_it_is)
    with_sensor: bool = option(
        False, bool, "--with", kind=list[Addition] | None, show_default=False,
        gives=lambda stated: {_KEYWORDS[one]: True for one in stated},
        help="sensor: the error of the sensor that measured the drives, too; jam-corridor: below 40 km/h on motorways "
        "the leftmost lane keeps left, others right (assumed: nobody measured how far); may be repeated.",
    )
    jam_corridor: bool = option(False, bool, said_by="--with")
    strict: bool = option(
        False, bool, "--strict", kind=bool, decides=False,
        help="Exit with 1 on warnings, a missing vehicle catalog, or no entity enriched.",
    )
    # fmt: on
    names_may_lack: bool = False
    """`entity`, `only` and `ego` apply where an entity of that name exists: one of many scenarios."""
    step: float = STEP

    def __post_init__(self) -> None:
        _ = self.target

    @classmethod
    def of(cls, **options: Any) -> ConvertSettings:
        """Settings from what users say (see `values_of`), else as configured; `FormatError`: that, or no such road."""
        path, configured = configuration()
        values = say.values_of(cls, options)
        for name in (SETTINGS - values.keys()) & configured.keys():
            try:
                values[name] = OPTIONS[name].value(name, configured[name])
            except ValueError as error:
                raise FormatError(str(error), path=path) from error
        made = cls(**values)
        _ = made.roads
        return made

    def of_row(self, cells: Mapping[str, str], folder: Path) -> ConvertSettings:
        """What a row of a table says comes before; paths in it are as seen from the table's folder."""
        return replace(
            self, **{name: one.of_row(name, getattr(self, name), cells, folder) for name, one in OPTIONS.items()}
        )

    def record(self, folder: Path) -> dict[str, Any]:
        """What decides an output, as plain JSON values; files as seen from a folder.

        Where files are looked for is no part of it, for their hashes are known; nor what refuses more or less.
        """
        return {name: _plain(name, getattr(self, name), folder) for name in RECORDED}

    @classmethod
    def of_record(cls, values: Mapping[str, Any], folder: Path) -> ConvertSettings:
        """Settings from what `record` gave; `ValueError` for another name, or a value that can't be."""
        if foreign := sorted(values.keys() - set(RECORDED)):
            raise ValueError(f"{foreign[0][:60]!r} is no setting that outputs state")
        settings: dict[str, Any] = {"step": float(values.get("step", STEP)), "names_may_lack": True}
        if not LEAST_STEP <= settings["step"] <= 1.0:
            raise ValueError(f"step {settings['step']} s is not within [{LEAST_STEP}, 1]")
        for name, stated in values.items():
            declared = OPTIONS.get(name)
            if declared is not None and stated is not None:
                if declared.entry is not None:
                    stated = {key: declared.entry(text, folder) for key, text in dict(stated).items()}
                elif declared.cell is not None and isinstance(stated, str):
                    stated = declared.cell(stated, folder)
                settings[name] = declared.value(name, stated)
        return cls(**settings)

    @property
    def uses_auto(self) -> bool:
        """Whether "auto" chooses for any entity."""
        return AUTO in (self.profile, *self.entity.values())

    @property
    def target(self) -> TargetPlayer:
        """Player and version of the standard to write for."""
        return target(self.player.value, self.version)

    @property
    def roads(self) -> RoadSearch:
        """Where the road may lie besides where the scenario says."""
        return RoadSearch(self.road, self.road_path)


OPTIONS: Mapping[str, Option] = say.options_of(ConvertSettings)
"""What users can set, by name."""
RECORDED = (*(name for name, declared in OPTIONS.items() if declared.decides), "step")
"""What outputs state of it."""


class ConvertKeywords(TypedDict, total=False):
    """The same names for type checkers, with what a call may be given."""

    profile: ProfileLike
    seed: int
    entity: Mapping[str, ProfileLike] | None
    only: Collection[str] | None
    ego: Collection[str] | None
    neighbours: Literal["profile", "borrow", "none"] | None
    lane_changes: Literal["written", "lifelike"] | None
    context: PathLike | None
    parameters: Mapping[str, object] | None
    library: Paths
    mode: Literal["auto", "trajectory", "lane-offset"]
    player: Literal["standard", "esmini", "carla"]
    player_library: PathLike | None
    version: str | None
    allow: Paths
    road: RoadLike | None
    road_path: Paths
    attempts: int
    time_limit: float | None
    with_sensor: bool
    jam_corridor: bool
    strict: bool


def _plain(name: str, value: Any, folder: Path) -> Any:
    """A setting as a JSON value."""
    if isinstance(value, Mapping):
        return {key: _plain("profile" if name == "entity" else "", one, folder) for key, one in sorted(value.items())}
    if name == "profile":
        if not isinstance(value, str):
            return value.name
        return relative(Path(value), folder) if value.endswith(".json") or Path(value).name != value else value
    if isinstance(value, Path):
        return relative(value, folder)
    if isinstance(value, StrEnum):
        return value.value
    return sorted(value) if isinstance(value, frozenset) else value


def relative(path: Path, folder: Path) -> str:
    """Path as seen from a folder, with forward slashes: the same on every machine."""
    try:
        return Path(os.path.relpath(os.path.realpath(path), os.path.realpath(folder))).as_posix()
    except ValueError:  # another drive of a Windows machine
        return path.resolve().as_posix()
