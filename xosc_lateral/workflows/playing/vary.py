"""`vary`: a scenario's lane changes as the drivers of a maneuver profile take them, as parameter distributions."""

from __future__ import annotations

import re
from dataclasses import dataclass
from itertools import chain
from itertools import count as numbers
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from lxml import etree

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.version import __version__
from xosc_lateral.workflows.options import ProfileLike, declare_options, flag
from xosc_lateral.workflows.result import PathLike, Paths, Result, given_profile
from xosc_lateral.world.motion.segments import leads_left
from xosc_lateral.world.scenario.enums import DynamicsDimension, DynamicsShape
from xosc_lateral.world.scenario.private_actions import LONGITUDINAL, LaneChangeAction

if TYPE_CHECKING:
    from xosc_lateral.drivers.model.maneuvers import Maneuvers
    from xosc_lateral.files.openscenario.write.draft import Draft
    from xosc_lateral.workflows.conversion.load import Played
    from xosc_lateral.world.motion.nominal import EntityMotion, PlayedAction
    from xosc_lateral.world.surroundings.lane_order import RoadLanes


@declare_options
def vary(
    scenario: PathLike,
    output: PathLike,
    *,
    like: Annotated[ProfileLike, flag(kind=str, metavar="PROFILE",
        help="Profile with maneuvers: `fit --maneuvers RECORDING` makes one.")],
    count: Annotated[int, flag("-n", "--count", min=1, max=100_000, help="Variations.")] = 100,
    speeds: Annotated[bool, flag(
        help="Draw the change of speed beside each lane change, too, of vehicles that keep theirs.")] = False,
    seed: int = 0,
    allow: Paths = (),
    library: Paths = (),
    force: bool = False,
) -> Variations:  # fmt: skip
    """Write variations of a scenario in which lane changes last as long as those of real drivers.

    Drawn are durations, with --speeds changes of speed; start, lane and all else stay the scenario's. Each is one of
    the profile's lane changes to that side: those at about its speed, in such a lane, as far behind the vehicle ahead
    come first. Parameters that the scenario has for durations, as those of `reconstruct` and `template` do, are used,
    others declared. `convert` and `detect` take the distribution.

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
    from xosc_lateral.base.errors import DriverProfileError, FormatError
    from xosc_lateral.files.atomic import together, write_atomically
    from xosc_lateral.files.openscenario.write import build
    from xosc_lateral.files.openscenario.write.draft import Draft
    from xosc_lateral.files.openscenario.write.fit import rewrite_paths
    from xosc_lateral.files.output_paths import claim, output_folder, template_mark
    from xosc_lateral.workflows.conversion.load import play_scenario
    from xosc_lateral.workflows.result import as_paths

    profile = given_profile(like, library)
    if profile.maneuvers is None:
        what = f"profile {profile.name} holds no maneuvers: fit TABLE... --maneuvers RECORDING makes one that does"
        raise DriverProfileError(what)
    played = play_scenario(Path(scenario), allowed=as_paths(allow))
    draft = Draft(played.scenario, played.motion)
    drawn = _drawn(draft, played, profile.maneuvers, count, np.random.default_rng(seed), with_speeds=speeds)
    if not drawn.durations:
        raise FormatError("no lane change with a duration of its own begins", path=Path(scenario))
    path = Path(scenario)
    folder = output_folder(output)
    varied, sets = folder / path.name, folder / f"{path.stem}-like-{profile.name}.xosc"
    rewrite_paths(draft, varied)
    values = drawn.durations | drawn.speed_changes
    distribution = _distribution(draft.version, varied.name, values, f"{path.name} like {profile.name}, seed {seed}")
    texts = {varied: build.document(draft.root).decode(), sets: build.document(distribution).decode()}
    claim(texts, [path], force=force)
    with together():
        for place, text in texts.items():
            write_atomically(place, text.rstrip() + "\n" + template_mark(text))
    return Variations(varied, sets, drawn.durations, drawn.speed_changes)


class _Drawn(NamedTuple):
    """Parameter -> a value for each variation: durations [s] and changes of speed [m/s]."""

    durations: dict[str, list[float]]
    speed_changes: dict[str, list[float]]


def _drawn(
    draft: Draft, played: Played, maneuvers: Maneuvers, count: int, rng: np.random.Generator, *, with_speeds: bool
) -> _Drawn:
    """Draw; the draft's lane changes refer to these parameters."""
    from xosc_lateral.files.openscenario.references import parameter_name
    from xosc_lateral.world.surroundings.lane_order import RoadLanes

    changes, lanes = _lane_changes(draft, played), RoadLanes(played.network)
    declarations = draft.root.find("{*}ParameterDeclarations")
    if declarations is None:
        declarations = etree.Element("ParameterDeclarations")
        draft.root.insert(1, declarations)
    drawn, declared = _Drawn({}, {}), {parameter_name(item.get("name") or "") for item in declarations}

    def declare(action: PlayedAction, what: str, value: float) -> str:
        name = _free_name(f"{action.actor}_{action.path[-1]}_{what}", declared)
        etree.SubElement(declarations, "ParameterDeclaration", name=name, parameterType="double", value=f"{value:g}")
        declared.add(name)
        return name

    for action, dynamics in changes:
        written = dynamics.get("value") or ""
        name = parameter_name(written) if written.startswith("$") else ""
        if name in drawn.durations:
            continue
        if name not in declared:
            name = declare(action, "duration", action.action.content.dynamics.value)
            dynamics.set("value", f"${name}")
        vehicle = next(one for one in played.motion.entities if one.name == action.actor)
        row = min(int(np.searchsorted(vehicle.time, action.start)), len(vehicle.time) - 1)
        weights = _weights(action, vehicle, row, played, lanes, maneuvers)
        rows = rng.choice(len(weights), size=count, p=weights)
        drawn.durations[name] = np.round(maneuvers.column("duration")[rows], 3).tolist()
        if with_speeds and draft.version >= (1, 1) and _keeps_speed(action, played):  # 1.0 has no expressions
            change = declare(action, "speed_change", 0.0)
            _add_speed_change(dynamics, action, float(vehicle.speed[row]), change, f"${name}")
            drawn.speed_changes[change] = np.round(maneuvers.column("speed_change")[rows], 3).tolist()
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
    from xosc_lateral.files.openscenario.write import build

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
    """The scenario's own that last for a time, in order of their begin, with the elements that say how long."""
    from xosc_lateral.files.openscenario.write.draft import source_of

    changes = []
    for action in sorted(played.motion.actions, key=lambda action: (action.start, action.path)):
        is_shared = action.action.place.path != str(played.scenario.path)  # it is a catalog's
        if is_shared or action.actor is None or not isinstance(action.action.content, LaneChangeAction):
            continue
        written = action.action.content.dynamics
        dynamics = source_of(action.action, played.scenario, draft.root).find(".//{*}LaneChangeActionDynamics")
        is_timed = written.dimension is DynamicsDimension.TIME and written.shape is not DynamicsShape.STEP
        if dynamics is not None and is_timed:
            changes.append((action, dynamics))
    return changes


def _free_name(wanted: str, taken: set[str]) -> str:
    plain = re.sub(r"\W", "_", wanted, flags=re.ASCII)
    names = chain([plain], (f"{plain}_{k}" for k in numbers(2)))
    return next(name for name in names if name not in taken)


def _weights(
    action: PlayedAction, vehicle: EntityMotion, row: int, played: Played, lanes: RoadLanes, maneuvers: Maneuvers
) -> FloatArray:
    """Of the profile's rows, by what the scenario's vehicle does in the row in which it begins to change lanes."""
    from xosc_lateral.world.surroundings.lane_order import vehicle_ahead

    end = float(vehicle.time[-1]) if action.end is None else action.end
    width = float(played.network.lane_width(int(vehicle.road[row]), int(vehicle.lane[row]), vehicle.s[row]))
    left = leads_left(vehicle, played.network, action.start, end)
    gap, _ = vehicle_ahead(vehicle, row, played.motion.entities, lanes)
    return maneuvers.weights(left=left, speed=float(vehicle.speed[row]), lane_width=width, gap=gap)


def _distribution(
    version: tuple[int, int], scenario: str, drawn: dict[str, list[float]], description: str
) -> etree._Element:
    """The document that gives the parameters their values, a set for each variation."""
    from xosc_lateral.files.openscenario.write.build import HEADER_DATE, decimal, sub

    root = etree.Element("OpenSCENARIO")
    minor = max(version[1], 1)  # 1.0 has no parameter distributions
    sub(root, "FileHeader", revMajor="1", revMinor=str(minor), date=HEADER_DATE, description=description,
        author=f"xosc-lateral {__version__}")  # fmt: skip
    owner = sub(root, "ParameterValueDistribution")
    sub(owner, "ScenarioFile", filepath=scenario)
    holder = sub(owner, "Deterministic/DeterministicMultiParameterDistribution/ValueSetDistribution")
    for values in zip(*drawn.values(), strict=True):
        variation = sub(holder, "ParameterValueSet")
        for name, value in zip(drawn, values, strict=True):
            sub(variation, "ParameterAssignment", parameterRef=name, value=decimal(value, 3))
    etree.indent(root, "  ")
    return root


@dataclass(frozen=True, eq=False, repr=False)
class Variations(Result):
    """What was written."""

    scenario: Path  # with a parameter for each lane change
    distribution: Path  # of their values
    durations: dict[str, list[float]]  # by parameter, for each variation [s]
    speed_changes: dict[str, list[float]]  # likewise [m/s]

    def headline(self) -> str:
        """One line."""
        count = len(next(iter(self.durations.values())))
        return f"{count} variations of {len(self.durations)} lane changes: {self.distribution}"

    def __str__(self) -> str:
        lines = [
            f"  {name}: {np.median(values):.1f} {unit} ({min(values):.1f} to {max(values):.1f} {unit})"
            for drawn, unit in ((self.durations, "s"), (self.speed_changes, "m/s"))
            for name, values in drawn.items()
        ]
        return "\n".join([self.headline(), *lines])

    def to_frame(self) -> pd.DataFrame:
        """One row per variation, a column per parameter. [s], [m/s]"""
        return pd.DataFrame(self.durations | self.speed_changes)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        return {
            "scenario": str(self.scenario), "distribution": str(self.distribution), "durations": self.durations,
            "speed_changes": self.speed_changes,
        }  # fmt: skip
