"""`play` and `segments`: a scenario's nominal motion, and where offsets will be sampled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.note import Note, notes
from xosc_lateral.base.plugins import service
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.files.source import file_hash, parsed_hashes
from xosc_lateral.workflows.opened import DocumentLike, RoadLike, scenario_input
from xosc_lateral.workflows.options import STEP, declare_options, flag
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths, write_page

if TYPE_CHECKING:
    from xosc_lateral.files.held import Held
    from xosc_lateral.files.pages.figure import Figure
    from xosc_lateral.workflows.conversion.load import Played
    from xosc_lateral.world.motion.nominal import MovingTraffic
    from xosc_lateral.world.motion.segments import SegmentRow


STRICT = flag("--strict", help="No vehicle catalog, a run cut off, a doubt: an error.")


@declare_options
def play(
    scenario: DocumentLike, *,
    step: Annotated[float, flag(help="Length of a frame [s].", min=0.001, max=1.0)] = STEP,
    time_limit: float | None = None,
    parameters: Mapping[str, object] | None = None,
    allow: Paths = (),
    road: RoadLike | None = None,
    road_path: Paths = (),
    strict: Annotated[bool, STRICT] = False,
) -> Playback:  # fmt: skip
    """Play a scenario's maneuvers, without offsets.

    Parameters
    ----------
    scenario : str, Path, bytes, file-like, lxml tree or scenariogeneration's `Scenario`
        Maneuver-based OpenSCENARIO file, or what one holds; `road` likewise, see `convert`.
    strict : bool
        A missing vehicle catalog is an error, instead of a note and a usual car.

    Raises
    ------
    FormatError, PlaybackError
        With file, line and element.
    """
    from xosc_lateral.files.openscenario.read import RoadSearch
    from xosc_lateral.workflows.conversion.load import play_scenario

    values = {name: str(value) for name, value in (parameters or {}).items()}
    inputs = scenario_input(scenario, road)
    return Playback(
        play_scenario(
            inputs.path,
            parameters=values,
            step=step,
            time_limit=time_limit,
            allowed=as_paths(allow),
            roads=RoadSearch(inputs.road, as_paths(road_path)),
            strict=strict,
        ),
        inputs.held,
    )


@declare_options
def segments(
    scenario: DocumentLike | Playback,
    *,
    step: float = STEP,
    time_limit: float | None = None,
    parameters: Mapping[str, object] | None = None,
    allow: Paths = (),
    road: RoadLike | None = None,
    strict: Annotated[bool, STRICT] = False,
) -> Segments:
    """Road-following segments of every entity, and why the rest is none; see `play`."""
    from xosc_lateral.world.scenario.controllers import controlled_entities

    played = (
        scenario
        if isinstance(scenario, Playback)
        else play(
            scenario, step=step, time_limit=time_limit, parameters=parameters, allow=allow, road=road, strict=strict
        )
    )
    driven = controlled_entities(played._played.scenario)
    lines = tuple(f"'{name}' is driven by controller {control}" for name, control in driven.items())
    return Segments(scenario_segments(played._played), lines, played.messages)


@dataclass(frozen=True, eq=False, repr=False)
class Playback(Result):
    """Nominal motion: what the maneuvers alone give."""

    _played: Played
    _held: Held | None = None  # what was read from memory

    @property
    def scenario(self) -> Path:
        """The file."""
        return self._played.scenario.path

    @property
    def entities(self) -> tuple[str, ...]:
        """In the scenario's order."""
        return tuple(entity.name for entity in self._played.motion.entities)

    @property
    def end_time(self) -> float:
        """[s]"""
        return self._played.motion.end_time

    @property
    def ended_by(self) -> str:
        """What ended the run: its stop trigger, the time limit, ..."""
        return self._played.motion.ended_by

    @property
    def messages(self) -> tuple[Note, ...]:
        """What was not played, or not as written; as warnings what can hardly be meant, and a run that was cut off."""
        return self._played.motion.messages

    def headline(self) -> str:
        """One line."""
        noted = f", {len(self.notes)} notes" if self.notes else ""
        ended = f"ended by: {self.ended_by}"
        return f"{self.scenario.name}: {len(self.entities)} entities, {self.end_time:.2f} s ({ended}){noted}"

    def __str__(self) -> str:
        return "\n".join([self.headline(), *self.message_lines()])

    def to_frame(self) -> pd.DataFrame:
        """One row per entity and step: `time,name,x,y,z,h,speed,road,lane,offset_t,s`, SI units."""
        from xosc_lateral.files.output_tables import states_frame

        return states_frame(self._played.motion, self._played.network)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        return {
            "scenario": str(self.scenario),
            "end_time": round(self.end_time, 6),
            "ended_by": self.ended_by,
            "step": self._played.motion.step,
            "entities": list(self.entities),
            "notes": list(self.notes),
            "warnings": list(self.warnings),
            "messages": self.message_records(),
            "provenance": self._provenance(),
        }

    def plot(self) -> Figure | None:
        """Paths across the road over along it; None when no entity is on a road."""
        from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
        from xosc_lateral.workflows.playing.figures import paths_stretched

        return paths_stretched(enrich(SegmentedRun(self._played.motion, self._played.network), {}, seed=0))

    def csv(self) -> str:
        """The table as text."""
        from xosc_lateral.files.output_tables import states_csv

        return states_csv(self._played.motion, self._played.network)

    @property
    def usual_table(self) -> str:
        """Called after the scenario."""
        return f"{self.scenario.stem}.csv"

    def page(self) -> str:
        """A self-contained HTML page that plays the scenario."""
        from xosc_lateral.workflows.playing.figures import view_page

        scene, played = self._scene(), self._played
        return view_page(played.motion, scene, self.scenario.name, self._provenance(), self._converted)

    def write_page(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the page that plays the scenario; into a folder as ``NAME_view.html``."""
        return write_page(path, f"{self.scenario.stem}_view.html", self.page, inputs=self.files, force=force)

    def write_image(self, path: PathLike, at: float | None = None, *, force: bool = False) -> Path:
        """Write a moment from above as ``.svg`` or ``.png`` (extra `pictures`); `at`: by default half. [s]"""
        from xosc_lateral.workflows.playing.picture import write_image

        return write_image(self._scene(), path, at, usual_name=self.scenario.stem, inputs=self.files, force=force)

    def write_animation(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the run from above as ``.gif`` (extra `pictures`), in real time."""
        from xosc_lateral.workflows.playing.picture import write_animation

        return write_animation(self._scene(), path, usual_name=self.scenario.stem, inputs=self.files, force=force)

    def _scene(self) -> str:
        from xosc_lateral.workflows.playing.scene import remade, scene_of

        motion, written, moved = self._played.motion, self._as_written(), (self._converted or {}).get("profiles")
        both = [] if written is None else remade(written, motion, moved if isinstance(moved, dict) else {})
        return scene_of(motion, self._played.network, both)

    @property
    def _converted(self) -> Mapping[str, Any] | None:
        """What the file says of its conversion, if it was converted."""
        from xosc_lateral.files.openscenario.provenance import facts_in

        return facts_in(self._played.scenario.source)

    def _as_written(self) -> MovingTraffic | None:
        """The run of the scenario that this one was made from, where its source lies beside it as it was then."""
        from xosc_lateral.files.openscenario.read import RoadSearch
        from xosc_lateral.workflows.conversion.load import play_scenario

        facts = self._converted or {}
        options, inputs, name = facts.get("options"), facts.get("inputs"), facts.get("scenario")
        if not (isinstance(options, dict) and isinstance(inputs, dict) and isinstance(name, str)):
            return None
        source, values = self.scenario.parent / name, options.get("parameters")
        try:
            if file_hash(source) not in inputs.values():
                return None
            parameters = {key: str(value) for key, value in values.items()} if isinstance(values, dict) else {}
            road = self._played.scenario.road_file
            played = play_scenario(source, parameters=parameters, step=self._played.motion.step,
                                   time_limit=self.end_time, roads=RoadSearch(road))  # fmt: skip
        except (OSError, XoscLateralError):  # it is gone, or whatever it names
            return None
        return played.motion

    def write_osi(self, path: PathLike, *, force: bool = False) -> Path:
        """Write an ASAM OSI trace (extra `osi`): ``.mcap`` or ``.osi``, one `GroundTruth` per step."""
        from xosc_lateral.files.osi import SUFFIXES
        from xosc_lateral.world.scenario.controllers import vehicles_under_test

        output = output_file(path, f"{self.scenario.stem}_gt.mcap", SUFFIXES)
        claim([output], self.files, force=force)
        motion, network = self._played.motion, self._played.network
        host = next(iter(vehicles_under_test(self._played.scenario)), None)
        words = f"{self.scenario.name}, as its maneuvers say"
        service("write_osi")(output, motion, network, host=host, description=words)
        return output

    @property
    def files(self) -> list[Path]:
        """All that were read."""
        scenario = self._played.scenario
        return [*scenario.input_files, *([scenario.road_file] if scenario.road_file else [])]

    def _provenance(self) -> dict[str, Any]:
        return {"inputs": parsed_hashes(self.files)}


@dataclass(frozen=True, eq=False, repr=False)
class Segments(Result):
    """Segments of all entities, road-following or not."""

    _rows: tuple[SegmentRow, ...]
    controllers: tuple[str, ...] = ()
    """Which controllers drive which entity at some time, a line each."""
    _messages: tuple[Note, ...] = ()  # of the run

    @property
    def messages(self) -> tuple[Note, ...]:
        """Those of the run, and `controllers`."""
        return (*self._messages, *notes(self.controllers))

    def __len__(self) -> int:
        return len(self._rows)

    def headline(self) -> str:
        """One line."""
        following = [row for row in self._rows if row.road_following]
        seconds = sum(row.end - row.start for row in following)
        entities = len({row.entity for row in self._rows})
        return f"{len(following)} road-following segments of {entities} entities, {seconds:.1f} s"

    def __str__(self) -> str:
        width = max((len(row.entity) for row in self._rows), default=0)
        lines = [
            f"{row.entity:<{width}}  {row.start:8.2f} - {row.end:8.2f} s  "
            + (f"road {row.road} lane {row.lane}: road-following" if row.road_following else f"no: {row.why}")
            for row in self._rows
        ]
        return "\n".join([*lines, *self.message_lines()])

    def to_frame(self) -> pd.DataFrame:
        """One row per segment: `entity`, `start`, `end` [s], `road_following`, `why`, `road`, `lane`."""
        names = ("entity", "start", "end", "road_following", "why", "road", "lane")
        return pd.DataFrame([[getattr(row, name) for name in names] for row in self._rows], columns=list(names))

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        from msgspec import structs

        rows = [structs.asdict(row) for row in self._rows]
        rounded = [row | {"start": round(row["start"], 6), "end": round(row["end"], 6)} for row in rows]
        return {"segments": rounded, "controllers": list(self.controllers), "messages": self.message_records()}


def scenario_segments(played: Played) -> tuple[SegmentRow, ...]:
    """All segments of all entities, in the scenario's order and in order of time."""
    from xosc_lateral.world.motion.segments import SegmentRow, cut_segments

    return tuple(
        SegmentRow(
            entity=motion.name,
            start=span.start,
            end=span.end,
            road_following=span.is_road_following,
            why="" if span.is_road_following else span.kind.value,
            road=played.network.road_ids[road] if road >= 0 else "",
            lane=int(motion.lane[span.first]) if road >= 0 else 0,
        )
        for motion in played.motion.entities
        for span in cut_segments(motion, played.network, is_trailer=motion.name in played.trailers)
        for road in [int(motion.road[span.first])]
    )
