"""`xosc-lateral live`: drivers in a simulation that runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Force, Library, Osi, Profile, Quiet, Seed, Verbose, Written, command, pairs, warn

if TYPE_CHECKING:
    from xosc_lateral.workflows.live.call import LiveRun

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()
group = typer.Typer(help="Drivers in a simulation that runs.", no_args_is_help=True)
app.add_typer(group, name="live", short_help=VERBS["live"])
export = typer.Typer(help="Drivers as parts for other tools.", no_args_is_help=True)
app.add_typer(export, name="export", short_help=VERBS["export"])

FCD = "x,y,angle,type,speed,pos,posLat,lane"  # What `import fcd` reads; SUMO leaves `posLat` out unless told.


@dataclass(frozen=True, slots=True)
class Driven:
    """Options of both simulators: who drives, and what is written of the run."""

    profile: Profile = "motorway"
    vehicle: Annotated[list[str] | None, typer.Option("--vehicle", metavar="NAME=PROFILE",
        help="Another profile for one vehicle; may be repeated.")] = None
    ego: Annotated[list[str] | None, typer.Option(metavar="NAME",
        help="Vehicle under test: not driven; may be repeated.")] = None
    seed: Seed = 0
    states: Annotated[str | None, typer.Option("--states", metavar="OUT",
        help="Table of where everybody was: .csv, .csv.gz, .parquet.")] = None
    osi: Osi = None
    library: Library = None

    def run(self, live: Callable[..., LiveRun], source: Path, reply: Written, **settings: Any) -> None:
        """Run a simulation of that source, and write and say what came out."""
        from xosc_lateral.files.osi import SUFFIXES, osi_wanted
        from xosc_lateral.files.output_paths import claim, output_file
        from xosc_lateral.files.tables import TABLE_SUFFIXES

        table = None if self.states is None else output_file(self.states, "states.csv", TABLE_SUFFIXES)
        trace = None if self.osi is None else output_file(self.osi, f"{source.stem}_gt.mcap", SUFFIXES)
        claim([table, trace], [source], force=reply.force)
        osi_wanted(trace)
        others = pairs(self.vehicle, "--vehicle")
        drivers = {"profile": self.profile, "profiles": others, "ego": self.ego or (), "folders": self.library or ()}
        run = live(source, seed=self.seed, **drivers, **settings)
        if table is not None:
            run.write(table, force=reply.force)
        if trace is not None:
            run.write_osi(trace, force=reply.force)
        warn(run.warnings)
        reply.say(run)


@command(
    group, "esmini", "Play a scenario in esmini, through your library of it.",
    "live esmini cut-in.xosc --player-library libesminiLib.so --ego Ego --states states.csv",
)
def esmini(
    scenario: Annotated[Path, typer.Argument(help="Scenario (.xosc).", show_default=False)],
    player_library: Annotated[Path, typer.Option(help="libesminiLib.so or esminiLib.dll of esmini 3.",
        show_default=False)],
    duration: Annotated[float, typer.Option(help="Ends here, if not before. [s]", min=0.01, max=86_400)] = 3600.0,
    step: Annotated[float, typer.Option(help="Length of a step. [s]", min=0.001, max=0.2)] = 0.01,
    window: Annotated[bool, typer.Option("--window", help="Open esmini's window.")] = False,
    *, driven: Driven, reply: Written,
) -> None:
    """Play a scenario in esmini with drivers in its vehicles; its triggers and maneuvers stay as written."""
    from xosc_lateral.workflows.live.call import live_esmini

    settings = {"duration": duration, "step": step, "window": window}
    driven.run(live_esmini, scenario, reply, library=player_library, **settings)


@command(
    group, "sumo", "Run a SUMO simulation (extra sumo).",
    "live sumo run.sumocfg -p motorway --seed 1 --lateral-resolution 4 --states states.parquet",
)
def sumo(
    config: Annotated[Path, typer.Argument(help="Configuration (.sumocfg).", show_default=False)],
    duration: Annotated[float, typer.Option(help="Ends here, if not before or as configured. [s]", min=0.01,
        max=1e7)] = 86_400.0,
    lateral_resolution: Annotated[float | None,
        typer.Option(help="Switch the sublane model on [m]; default: as configured.", min=0.01, max=5.0)] = None,
    fcd_output: Annotated[Path | None, typer.Option(metavar="FCD.xml",
        help="SUMO's own output of where everybody was.")] = None,
    *, driven: Driven, reply: Written,
) -> None:
    """Run a SUMO simulation with the sublane model and drivers in its vehicles; lane changes stay SUMO's."""
    from xosc_lateral.workflows.live.call import live_sumo

    options = () if fcd_output is None else ("--fcd-output", str(fcd_output), "--fcd-output.attributes", FCD)
    settings = {"duration": duration, "lateral_resolution": lateral_resolution, "options": options}
    driven.run(live_sumo, config, reply, **settings)


@command(
    group, "stdio", "Answer over a pipe: one line of JSON in, one out.",
    "live stdio -p motorway --seed 1 --road motorway.xodr",
)
def stdio(
    profile: Profile = "motorway", seed: Seed = 0,
    road: Annotated[Path | None, typer.Option(help="OpenDRIVE file that vehicles' places are on.")] = None,
    library: Library = None,
) -> None:
    """Answer lines on standard input, as docs/schemas/live.json has them, until there are no more."""
    import os
    import sys

    from xosc_lateral.workflows.live.stdio import Pipe, lines_of
    from xosc_lateral.workflows.result import given_profile

    pipe = Pipe(given_profile(profile, library or ()), seed=seed, road=road)
    try:
        for line in pipe.answers(lines_of(sys.stdin.buffer)):
            print(line, flush=True)
    except BrokenPipeError:  # nobody listens any more; nor is there anybody to flush to at the end
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


class Fmi(StrEnum):
    """Versions of the standard."""

    TWO = "2.0"
    THREE = "3.0"


@command(
    export, "fmu", "A functional mock-up unit, C source and binaries.",
    "export fmu -p motorway --fmi 3.0 -o driver.fmu", "export fmu -p motorway --python -o driver.fmu",
)
def fmu(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.fmu", help="The unit.")],
    profile: Profile = "motorway",
    fmi: Annotated[Fmi, typer.Option(help="Version of FMI.")] = Fmi.TWO,
    compiler: Annotated[list[str] | None, typer.Option(metavar="CC",
        help="C compiler to make a binary with; may be repeated. Default: the host's.")] = None,
    python: Annotated[
        bool, typer.Option("--python", help="Call this package instead, where it is simulated (extra fmu).")
    ] = False, library: Library = None, force: Force = False, quiet: Quiet = False, verbose: Verbose = False,
) -> None:
    """Write a driver as a functional mock-up unit for co-simulation: C source, with binaries where a compiler is."""
    from xosc_lateral.files.output_paths import claim
    from xosc_lateral.workflows.live.fmu import export_fmu
    from xosc_lateral.workflows.result import given_profile

    if python and compiler:
        raise typer.BadParameter("a --python unit is not compiled", param_hint="--compiler")
    claim([output], force=force)
    driver = given_profile(profile, library or ())
    platforms = export_fmu(driver, output, fmi=fmi, python=python, compilers=compiler or ())
    content = "calling Python" if python else f"C source, binaries for {', '.join(platforms) or 'no platform'}"
    if not quiet:
        typer.echo(f"{driver.name} as FMI {fmi} in {output}: {content}", err=True)


@command(export, "c", "C99 source for a test bench.", "export c -p motorway -o driver/")
def c_source(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER/", help="Folder of the files.")],
    profile: Profile = "motorway", library: Library = None, force: Force = False, quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write a driver as C99 without dependencies: header, source, numbers, a CMake file and an example loop."""
    from xosc_lateral.workflows.live.c_driver import export_c
    from xosc_lateral.workflows.result import given_profile

    written = export_c(given_profile(profile, library or ()), output, force=force)
    if not quiet:
        typer.echo(f"wrote {', '.join(str(path) for path in written)}", err=True)
