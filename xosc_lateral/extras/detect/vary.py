"""`vary`: a scenario's lane changes as the drivers of a maneuver profile take them, as parameter distributions."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from itertools import count as numbers
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from lxml import etree

from xosc_lateral.base.arrays import NORMAL_90
from xosc_lateral.base.errors import DriverProfileError, FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.texts import counted
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.model.profile import Maneuvers
from xosc_lateral.extras.recordings.lane_order import RoadLanes, vehicle_next
from xosc_lateral.files.atomic import together, write_atomically
from xosc_lateral.files.openscenario.read import RoadSearch
from xosc_lateral.files.openscenario.references import parameter_name
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.draft import Draft, source_of
from xosc_lateral.files.openscenario.write.fit import rewrite_paths
from xosc_lateral.files.output_paths import claim, output_folder, template_mark
from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.workflows.options import ProfileLike, declare_options, flag
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths, given_profile
from xosc_lateral.world.motion.nominal import PlayedAction
from xosc_lateral.world.motion.segments import leads_left
from xosc_lateral.world.scenario.enums import DynamicsDimension, DynamicsShape
from xosc_lateral.world.scenario.private_actions import LONGITUDINAL, LaneChangeAction


@declare_options
def vary(
    scenario: PathLike,
    output: PathLike,
    *,
    like: Annotated[ProfileLike, flag(kind=str, metavar="PROFILE",
        help="Profile with maneuvers: motorway, or what `fit --maneuvers RECORDING` makes.")],
    count: Annotated[int, flag("-n", "--count", min=1, max=100_000, help="Variations.")] = 100,
    replace: Annotated[bool, flag("--replace",
        help="Lane changes that are shorter than those of real drivers get their durations, too.")] = False,
    speeds: Annotated[bool, flag(
        help="Draw the change of speed beside each lane change, too, of vehicles that keep theirs.")] = False,
    seed: int = 0,
    allow: Paths = (),
    library: Paths = (),
    force: bool = False,
) -> Variations:  # fmt: skip
    """Write variations of a scenario in which lane changes last as long as those of real drivers.

    Drawn are durations, or rates where the scenario states rates, from the profile's law for the gap ahead, with
    --speeds changes of speed; start, lane and all else stay the scenario's. What is written shorter than 95 % of the
    law's is varied about itself, as much as the law varies: no test gets milder. Parameters that the scenario has for
    this, as those of `reconstruct` and `template` do, are used, others declared. `convert` and `detect` take the
    distribution.

    Parameters
    ----------
    scenario : str or Path
        Maneuver-based OpenSCENARIO file.
    output : str or Path
        Folder for the scenario with its parameters, and the parameter distribution of `convert` and other tools.
    force : bool
        Replace files that this package did not write.

    Raises
    ------
    FormatError, PlaybackError
        The scenario can't be played, or has no lane change with a duration.
    DriverProfileError
        The profile holds no maneuvers.
    """
    profile = given_profile(like, library)
    if profile.maneuvers is None:
        what = f"profile {profile.name} holds no maneuvers: fit TABLE... --maneuvers RECORDING makes one that does"
        raise DriverProfileError(what)
    played = play_scenario(Path(scenario), allowed=as_paths(allow))
    draft = Draft(played.scenario, played.motion)
    drawn = _drawn(
        draft, played, profile.maneuvers, count, np.random.default_rng(seed), with_speeds=speeds, replaces=replace
    )
    if not drawn.changes:
        raise FormatError("no lane change with a duration or rate of its own begins", path=Path(scenario))
    path = Path(scenario)
    folder = output_folder(output)
    varied, sets = folder / path.name, folder / f"{path.stem}-like-{profile.name}.xosc"
    rewrite_paths(draft, varied)
    values = {one.parameter: one.values for one in drawn.changes} | drawn.speed_changes
    distribution = _distribution(draft.version, varied.name, values, f"{path.name} like {profile.name}, seed {seed}")
    texts = {varied: build.document(draft.root).decode(), sets: build.document(distribution).decode()}
    claim(texts, [path], force=force)
    with together():
        for place, text in texts.items():
            write_atomically(place, text.rstrip() + "\n" + template_mark(text))
    roads = () if played.scenario.road_file is None else (played.scenario.road_file.parent,)
    some = sorted({k for one in drawn.changes for k in np.argsort(one.durations)[[0, count // 2, -1]].tolist()})
    after = [
        play_scenario(varied, parameters={name: f"{rows[k]:.3f}" for name, rows in values.items()},
                      allowed=(*as_paths(allow), *(one.parent for one in played.scenario.input_files), *roads),
                      roads=RoadSearch(folders=roads))  # what is written elsewhere has none beside it
        for k in some
    ]  # fmt: skip
    return Variations(varied, sets, drawn.changes, drawn.speed_changes, _closest([played]), _closest(after))


class VariedChange(NamedTuple):
    """One lane change: its parameter, and what is drawn for it."""

    parameter: str
    is_rate: bool  # its parameter is a rate [m/s], not a duration [s]
    written: float  # duration of the nominal run [s]
    law: tuple[float, float, float]  # 5, 50, 95 % of the profile's [s]
    about_itself: bool  # drawn about what is written, which is shorter than 95 % of the profile's
    durations: list[float]  # of each variation [s]
    values: list[float]  # of the parameter, likewise

    def __str__(self) -> str:
        low, high = min(self.durations), max(self.durations)
        drawn = f"{np.median(self.durations):.1f} s ({low:.1f} to {high:.1f} s)"
        what = f"{self.parameter}: {drawn}, written {self.written:.1f} s"
        theirs = f"the profile's take {self.law[1]:.1f} s ({self.law[0]:.1f} to {self.law[2]:.1f} s)"
        how = f", varied about itself: {theirs}; --replace takes theirs" if self.about_itself else f"; {theirs}"
        return what + how + ("; stated as a rate" if self.is_rate else "")


class _Drawn(NamedTuple):
    """Lane changes, and changes of speed by parameter, for each variation [m/s]."""

    changes: list[VariedChange]
    speed_changes: dict[str, list[float]]


def _drawn(
    draft: Draft, played: Played, maneuvers: Maneuvers, count: int, rng: np.random.Generator, *, with_speeds: bool,
    replaces: bool,
) -> _Drawn:  # fmt: skip
    """Draw; the draft's lane changes refer to these parameters."""
    changes, lanes = _lane_changes(draft, played), RoadLanes(played.network)
    declarations = draft.root.find("{*}ParameterDeclarations")
    if declarations is None:
        declarations = etree.Element("ParameterDeclarations")
        draft.root.insert(1, declarations)
    drawn, declared = _Drawn([], {}), {parameter_name(item.get("name") or "") for item in declarations}

    def declare(action: PlayedAction, what: str, value: float) -> str:
        name = _free_name(f"{action.actor}_{action.path[-1]}_{what}", declared)
        etree.SubElement(declarations, "ParameterDeclaration", name=name, parameterType="double", value=f"{value:g}")
        declared.add(name)
        return name

    for action, dynamics in changes:
        stated, value = action.action.content.dynamics, dynamics.get("value") or ""
        is_rate = stated.dimension is DynamicsDimension.RATE
        name = parameter_name(value) if value.startswith("$") else ""
        if any(name == one.parameter for one in drawn.changes):
            continue
        if name not in declared:
            name = declare(action, "rate" if is_rate else "duration", stated.value)
            dynamics.set("value", f"${name}")
        vehicle = next(one for one in played.motion.entities if one.name == action.actor)
        row = min(int(np.searchsorted(vehicle.time, action.start)), len(vehicle.time) - 1)
        gap = vehicle_next(vehicle, row, played.motion.entities, lanes).gap
        low, middle, high = maneuvers.duration(np.array([-NORMAL_90, 0.0, NORMAL_90]), gap).tolist()
        assert action.end is not None
        written = action.end - action.start if is_rate else stated.value
        is_short, normal = written < low and not replaces, rng.standard_normal(count)
        durations = maneuvers.duration(normal, gap) * (written / middle if is_short else 1.0)
        values = stated.value * written / durations if is_rate else durations
        drawn.changes.append(
            VariedChange(
                name, is_rate, written, (low, middle, high), is_short, durations.tolist(), np.round(values, 3).tolist()
            )
        )
        side = "left" if leads_left(vehicle, played.network, action.start, action.end) else "right"
        law = maneuvers.speed_change.get(side)
        if with_speeds and law is not None and not is_rate and draft.version >= (1, 1) and _keeps_speed(action, played):
            change = declare(action, "speed_change", 0.0)  # 1.0 has no expressions
            _add_speed_change(dynamics, action, float(vehicle.speed[row]), change, f"${name}")
            speeds = law.mean.value + law.deviation.value * rng.standard_normal(count)
            drawn.speed_changes[change] = np.round(speeds, 3).tolist()
    return drawn


def _keeps_speed(change: PlayedAction, played: Played) -> bool:
    """Whether a vehicle changes lanes alone, and nothing of the scenario's drives it faster or slower meanwhile."""
    end = np.inf if change.end is None else change.end
    at = next(one for one in played.scenario.storyboard.events() if one.path == change.path[:-1])
    return len(at.actors) == 1 and not any(
        one.actor == change.actor and isinstance(one.action.content, LONGITUDINAL) and one.start < end
        and (one.end is None or one.end > change.start)
        for one in played.motion.actions
    )  # fmt: skip


def _add_speed_change(
    dynamics: etree._Element, change: PlayedAction, speed: float, parameter: str, duration: str
) -> None:
    """Beside a lane change, in its event: from a speed [m/s] to one that is by so much higher when it ends."""
    action = next(dynamics.iterancestors("{*}Action"))
    beside = etree.Element("Action", name=f"{change.path[-1]} {parameter}")
    speed_action = build.sub(beside, "PrivateAction/LongitudinalAction/SpeedAction")
    build.sub(speed_action, "SpeedActionDynamics", dynamicsShape="sinusoidal", dynamicsDimension="time", value=duration)
    to = f"${{{build.decimal(speed, 4)} + ${parameter}}}"  # a target relative to itself runs away in some players
    build.sub(speed_action, "SpeedActionTarget/AbsoluteTargetSpeed", value=to)
    event = action.getparent()
    assert event is not None
    build.insert_indented(event, event.index(action) + 1, beside)


def _lane_changes(draft: Draft, played: Played) -> list[tuple[PlayedAction, etree._Element]]:
    """The scenario's own that end and state a time or a rate, in order of their begin, with the elements that do."""
    changes = []
    for action in sorted(played.motion.actions, key=lambda action: (action.start, action.path)):
        is_shared = action.action.place.path != str(played.scenario.path)  # it is a catalog's
        if is_shared or action.actor is None or not isinstance(action.action.content, LaneChangeAction):
            continue
        written = action.action.content.dynamics
        dynamics = source_of(action.action, played.scenario, draft.root).find(".//{*}LaneChangeActionDynamics")
        is_timed = written.dimension in (DynamicsDimension.TIME, DynamicsDimension.RATE)
        is_over = action.end is not None and action.end > action.start and written.shape is not DynamicsShape.STEP
        if dynamics is not None and is_timed and is_over:
            changes.append((action, dynamics))
    return changes


def _free_name(wanted: str, taken: set[str]) -> str:
    plain = re.sub(r"\W", "_", wanted, flags=re.ASCII)
    names = chain([plain], (f"{plain}_{k}" for k in numbers(2)))
    return next(name for name in names if name not in taken)


class Follower(NamedTuple):
    """Who is behind a vehicle that crosses a marking: the least of several runs; infinite: nobody, or nobody closes."""

    headway: float  # [s]
    time_to_collision: float  # with both speeds kept [s]

    def __str__(self) -> str:
        if not np.isfinite(self.headway):
            return "nobody behind"
        closing = f"{self.time_to_collision:.1f} s to a collision"
        return f"headway {self.headway:.2f} s, {closing if np.isfinite(self.time_to_collision) else 'not closing'}"


def _closest(runs: list[Played]) -> dict[str, Follower]:
    """By vehicle that changes lanes."""
    followers = dict[str, Follower]()
    for played in runs:
        lanes, vehicles = RoadLanes(played.network), played.motion.entities
        for action in played.motion.actions:
            vehicle = next((one for one in vehicles if one.name == action.actor), None)
            if vehicle is None or not isinstance(action.action.content, LaneChangeAction) or action.end is None:
                continue
            first, last = np.searchsorted(vehicle.time, (action.start, action.end + played.motion.step)).tolist()
            for row in (first + 1 + np.flatnonzero(np.diff(vehicle.lane[first:last]))).tolist():
                behind = vehicle_next(vehicle, row, vehicles, lanes, ahead=False)
                known = followers.get(vehicle.name, Follower(np.inf, np.inf))
                least = np.fmin(known, (behind.headway, behind.time_to_collision)).tolist()
                followers[vehicle.name] = Follower(*least)
    return followers


def _distribution(
    version: tuple[int, int], scenario: str, drawn: dict[str, list[float]], description: str
) -> etree._Element:
    """The document that gives the parameters their values, a set for each variation."""
    root = etree.Element("OpenSCENARIO")
    minor = max(version[1], 1)  # 1.0 has no parameter distributions
    build.sub(root, "FileHeader", revMajor="1", revMinor=str(minor), date=build.HEADER_DATE, description=description,
        author=f"xosc-lateral {__version__}")  # fmt: skip
    owner = build.sub(root, "ParameterValueDistribution")
    build.sub(owner, "ScenarioFile", filepath=scenario)
    holder = build.sub(owner, "Deterministic/DeterministicMultiParameterDistribution/ValueSetDistribution")
    for values in zip(*drawn.values(), strict=True):
        variation = build.sub(holder, "ParameterValueSet")
        for name, value in zip(drawn, values, strict=True):
            build.sub(variation, "ParameterAssignment", parameterRef=name, value=build.decimal(value, 3))
    etree.indent(root, "  ")
    return root


@dataclass(frozen=True, eq=False, repr=False)
class Variations(Result):
    """What was written."""

    scenario: Path  # with a parameter for each lane change
    distribution: Path  # of their values
    changes: list[VariedChange]
    speed_changes: dict[str, list[float]]  # by parameter, for each variation [m/s]
    # who is behind a vehicle that crosses a marking: as written, and in the variations in which a lane change is
    # shortest, middling and longest
    before: dict[str, Follower]
    after: dict[str, Follower]

    @property
    def durations(self) -> dict[str, list[float]]:
        """By parameter, for each variation. [s]"""
        return {one.parameter: one.durations for one in self.changes}

    def headline(self) -> str:
        """One line."""
        count = len(self.changes[0].durations)
        return f"{counted(count, 'variation')} of {counted(len(self.changes), 'lane change')}: {self.distribution}"

    def __str__(self) -> str:
        speeds = (
            f"{name}: {np.median(values):.1f} m/s ({min(values):.1f} to {max(values):.1f} m/s)"
            for name, values in self.speed_changes.items()
        )
        return "\n".join(
            [self.headline(), *(f"  {line}" for line in (*map(str, self.changes), *speeds, *self._least_gaps()))]
        )

    def _least_gaps(self) -> Iterator[str]:
        for name in sorted(self.before.keys() | self.after.keys()):
            was, now = (found.get(name, "never") for found in (self.before, self.after))
            yield f"'{name}' crosses the marking: {was} as written, {now} at least in the variations"

    def to_frame(self) -> pd.DataFrame:
        """One row per variation, a column per parameter. [s], [m/s]"""
        return pd.DataFrame({one.parameter: one.values for one in self.changes} | self.speed_changes)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        return {
            "scenario": str(self.scenario), "distribution": str(self.distribution), "durations": self.durations,
            "rates": {one.parameter: one.values for one in self.changes if one.is_rate},
            "about_themselves": [one.parameter for one in self.changes if one.about_itself],
            "speed_changes": self.speed_changes,
            "followers": {
                when: {name: {key: value if np.isfinite(value) else None for key, value in one._asdict().items()}
                       for name, one in found.items()}
                for when, found in (("before", self.before), ("after", self.after))
            },
        }  # fmt: skip
