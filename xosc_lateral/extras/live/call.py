"""`live`: drivers in a simulation that runs, from its start to its end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from xosc_lateral.base.errors import SimulationError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.note import Note, notes, warnings
from xosc_lateral.base.plugins import service
from xosc_lateral.extras.live.loop import SimulatorScene, later_actions, motion_of, not_driven, run_to_end, sumo_network
from xosc_lateral.files.osi import SUFFIXES
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.files.output_tables import RECOGNISED_BY
from xosc_lateral.workflows.options import SHARED, declare_options, flag, profile_and_entities, texts
from xosc_lateral.workflows.result import PathLike, Paths, ProfileLike, Result, given_profile
from xosc_lateral.world.scenario.controllers import is_named_under_test

STATE_COLUMNS = (*RECOGNISED_BY, "offset", "driver", "steered")
"""Columns of a run: where vehicles are; offset from the lane's centre, positive left; the driver's; if it counts."""

TRACE_COLUMNS = (*STATE_COLUMNS, "z", "pitch", "roll")
"""The same with what only a trace has."""


PROFILE = flag("--profile", "-p", kind=list[str] | None, metavar="PROFILE|NAME=PROFILE", show_default=False,
    gives=partial(profile_and_entities, keyword="profiles"),
    help="Driver profile (default motorway). For one vehicle NAME=PROFILE; may be repeated.")  # fmt: skip
PROFILES = flag(kind=list[str] | None, read=texts, said_by="--profile", help="Another profile for one vehicle.")
EGO = flag(
    kind=list[str] | None,
    metavar="NAME",
    help="Vehicle under test: not driven; may be repeated. "
    "Those called ego, hero, ... are found by themselves. none: there is none.",
)
FOLDERS = replace(SHARED["library"], flags=("--library",))


@declare_options
def live_esmini(
    scenario: PathLike,
    library: Annotated[Any, flag("--player-library", kind=Path, show_default=False,
        help="libesminiLib.so or esminiLib.dll of esmini 3.")], *,
    duration: Annotated[float, flag(help="Ends here, if not before. [s]", min=0.01, max=86_400)] = 3600.0,
    step: Annotated[float, flag(help="Length of a step. [s]", min=0.001, max=0.2)] = 0.01,
    window: Annotated[bool, flag("--window", help="Open esmini's window.")] = False,
    profile: Annotated[ProfileLike, PROFILE] = "motorway",
    profiles: Annotated[Mapping[str, ProfileLike] | None, PROFILES] = None,
    ego: Annotated[Sequence[str] | None, EGO] = None,
    seed: int = 0,
    neighbours: str = "borrow",
    folders: Annotated[Paths, FOLDERS] = (),
) -> LiveRun:  # fmt: skip
    """Play a scenario in esmini with drivers in its vehicles.

    The `library` is the user's own: its path, a `ctypes.CDLL`, or an object with the same functions. Raises
    `SimulationError` or `FormatError` in one line.
    """
    from xosc_lateral.extras.live.esmini import EsminiTraffic
    from xosc_lateral.extras.live.esmini_library import open_player
    from xosc_lateral.workflows.conversion.result import Neighbours

    chosen = given_profile(profile, folders)
    others = {name: given_profile(one, folders) for name, one in (profiles or {}).items()}
    if not Path(scenario).is_file():
        raise FileNotFoundError(2, "No such file or directory", str(scenario))
    player = open_player(library, scenario, window=window)
    events: list[tuple[float, str, int]] = []
    try:

        def note(_name: bytes, _kind: int, state: int, path: bytes) -> None:
            events.append((round(player.SE_GetSimulationTime(), 6), path.decode(errors="replace"), state))

        traffic = EsminiTraffic(
            player, scenario, chosen, ego=ego, seed=seed, profiles=others, neighbours=Neighbours(neighbours),
            on_element=note,
        )  # fmt: skip
        traffic.steer(0.0)
        rows = run_to_end(traffic, duration, step)
    finally:
        player.SE_Close()
    settings = {"scenario": Path(scenario).name, "profile": chosen.name, "seed": seed}
    under_test = [one.name for one in traffic.entities if one.name in traffic.ego]
    scene = SimulatorScene(traffic.entities, lambda: traffic.network, under_test)
    standing = [name for name in sorted(traffic.waits) if len({row[2:4] for row in rows if row[1] == name}) == 1]
    stood = [f"{name!r} stood all the time: its controller waits for another program; drive it in a loop of your own "
             "with EsminiTraffic" for name in standing]  # fmt: skip
    warned = warnings([*traffic.warnings, *traffic.traffic.fault_lines(), *stood])
    noted = notes([*later_actions(Path(scenario), traffic.spans, duration), *not_driven(traffic.undriven)])
    return LiveRun(rows, settings, (*warned, *noted), scene, events)


@declare_options
def live_sumo(
    config: PathLike, *,
    duration: Annotated[float, flag(help="Ends here, if not before or as configured. [s]", min=0.01,
        max=1e7)] = 86_400.0,
    lateral_resolution: Annotated[float | None,
        flag(help="Switch the sublane model on [m]; default: as configured.", min=0.01, max=5.0)] = None,
    profile: Annotated[ProfileLike, PROFILE] = "motorway",
    profiles: Annotated[Mapping[str, ProfileLike] | None, PROFILES] = None,
    ego: Annotated[Sequence[str] | None, EGO] = None,
    seed: int = 0,
    options: Sequence[str] = (),
    neighbours: str = "borrow",
    folders: Annotated[Paths, FOLDERS] = (),
) -> LiveRun:  # fmt: skip
    """Run a SUMO simulation with drivers in its vehicles; the extra `sumo`.

    SUMO's own random seed is as `config` (``.sumocfg``) says; `options` are further words of its command line. Raises
    `SimulationError` in one line.
    """
    from xosc_lateral.extras.live.sumo import SumoTraffic, start
    from xosc_lateral.workflows.conversion.result import Neighbours

    chosen = given_profile(profile, folders)
    others = {name: given_profile(one, folders) for name, one in (profiles or {}).items()}
    if not Path(config).is_file():
        raise FileNotFoundError(2, "No such file or directory", str(config))
    sublane = [] if lateral_resolution is None else ["--lateral-resolution", f"{lateral_resolution:g}"]
    connection = start(["-c", str(config), *sublane, *options])
    try:
        net = str(connection.simulation.getOption("net-file"))
        traffic = SumoTraffic(
            connection, chosen, ego=ego, seed=seed, profiles=others, neighbours=Neighbours(neighbours)
        )
        end = traffic.time() + duration
        configured = float(connection.simulation.getEndTime())  # of which SUMO makes nothing by itself here
        end = min(end, configured) if configured > 0.0 else end
        rows, time = run_to_end(traffic, end, float(connection.simulation.getDeltaT())), traffic.time()
    finally:
        connection.close()
    if strangers := sorted({*traffic.ego.named, *others} - traffic.entities.keys()):
        seen = f"; there were {', '.join(sorted(traffic.entities)[:5])} ..." if traffic.entities else ""
        raise SimulationError(f"{config}: no vehicle {strangers[0]!r} until {time:g} s{seen}")
    settings = {"scenario": Path(config).name, "profile": chosen.name, "seed": seed}
    counts = [f"SUMO reports {count} {what}" for what, count in traffic.counts.items() if count]
    under_test = [name for name in traffic.entities if name in traffic.ego]
    scene = SimulatorScene(tuple(traffic.entities.values()), partial(sumo_network, net), under_test, is_road=False)
    noted = notes(not_driven({name: f"it is under test{traffic.ego.why(name)}" for name in under_test}))
    warned = warnings([*traffic.warnings, *traffic.traffic.fault_lines(), *counts])
    return LiveRun(rows, settings, (*warned, *noted), scene)


class LiveRun(Result):
    """A run of a simulation with drivers in it."""

    usual_table = "states.csv"
    __slots__ = ("_messages", "_rows", "_scene", "_settings", "events")

    def __init__(
        self,
        rows: Sequence[tuple[Any, ...]],
        settings: Mapping[str, Any],
        messages: Sequence[Note],
        scene: SimulatorScene,
        events: Sequence[tuple[float, str, int]] = (),
    ) -> None:
        self._rows = pd.DataFrame(rows, columns=list(TRACE_COLUMNS))
        self._settings, self._scene = dict(settings), scene
        self._messages = tuple(messages)
        self.events = tuple(events)
        """Changes of storyboard elements: time [s], path, state."""

    @property
    def messages(self) -> tuple[Note, ...]:
        """What a user has to know, and what else drivers did or did not."""
        return self._messages

    def headline(self) -> str:
        """One line."""
        rows = self._rows
        names, steered = rows["name"].nunique(), rows["name"][rows["steered"].astype(bool)].nunique()
        time = rows["time"].iloc[-1] if len(rows) else 0.0
        source, profile, seed = (self._settings[key] for key in ("scenario", "profile", "seed"))
        return f"{source}: {time:g} s, {steered} of {names} vehicles driven by {profile}, seed {seed}"

    def __str__(self) -> str:
        return "\n".join([self.headline(), *self.message_lines()])

    def to_frame(self) -> pd.DataFrame:
        """One row per vehicle and step, see `STATE_COLUMNS`; SI units, offsets positive left of travel."""
        return self._rows[list(STATE_COLUMNS)]

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them: what ran, without its rows."""
        messages = {"warnings": list(self.warnings), "notes": list(self.notes)}
        return {
            "rows": len(self._rows),
            **messages,
            "messages": self.message_records(),
            **self._settings,
        }

    def _provenance(self) -> Mapping[str, Any]:
        return self._settings

    def write_osi(self, path: PathLike, *, force: bool = False) -> Path:
        """Write an ASAM OSI trace (extra `osi`): ``.mcap`` or ``.osi``, one `GroundTruth` per step.

        Raises `SimulationError` if SUMO's network can't be made a road.
        """
        output = output_file(path, f"{Path(self._settings['scenario']).stem}_gt.mcap", SUFFIXES)
        claim([output], force=force)
        network = self._scene.network()
        motion = motion_of(self._rows, self._scene, network)
        names = (entity.name for entity in motion.entities if is_named_under_test(entity.name))
        host = next(iter((*self._scene.ego, *names)), None)
        service("write_osi")(output, motion, network, host=host, description=self.headline())
        return output
