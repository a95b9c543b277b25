"""`xosc-lateral live`: drivers in a simulation that runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import xosc_lateral as xl
from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import (
    Force,
    Options,
    Osi,
    Quiet,
    Strict,
    Verbose,
    Writing,
    command,
    refuse_warnings,
    say,
)
from xosc_lateral.workflows.options import Paths

if TYPE_CHECKING:
    from xosc_lateral.extras.live.call import LiveRun

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()
group = typer.Typer(help="Drivers in a simulation that runs.", no_args_is_help=True)
app.add_typer(group, name="live", short_help=VERBS["live"])
export = typer.Typer(help="Drivers as parts for other tools.", no_args_is_help=True)
app.add_typer(export, name="export", short_help=VERBS["export"])

FCD_COLUMNS = "x,y,angle,type,speed,pos,posLat,lane"  # What `import fcd` reads; SUMO leaves `posLat` out unless told.


@dataclass(frozen=True, slots=True)
class Outputs:
    """What is written of the run of a simulator."""

    states: Annotated[str | None, typer.Option("--states", metavar="OUT",
        help="Table of where everybody was: .csv, .csv.gz, .parquet.")] = None
    osi: Osi = None
    strict: Strict = False

    def run(self, live: Callable[..., LiveRun], source: Path, reply: Writing, **options: Any) -> None:
        """Run a simulation of that source, and write and say what came out."""
        from xosc_lateral.files.atomic import together

        table, trace = reply.claim(
            [source], table=(self.states, "states.csv"), trace=(self.osi, f"{source.stem}_gt.mcap")
        )
        run = live(source, **options)
        with together():
            if table is not None:
                run.write(table, force=reply.force)
            if trace is not None:
                run.write_osi(trace, force=reply.force)
        reply.warn(run.warnings, strict=self.strict)
        reply.say(run)
        refuse_warnings(run.warnings, self.strict)


@command(
    group, "esmini", "Play a scenario in esmini, through your library of it.",
    "live esmini cut-in.xosc --player-library libesminiLib.so --ego Ego --states states.csv",
)
def esmini(
    scenario: Annotated[Path, typer.Argument(help="Scenario (.xosc).", show_default=False)],
    *, options: Annotated[Options, xl.live_esmini], outputs: Outputs, reply: Writing,
) -> None:
    """Play a scenario in esmini with drivers in its vehicles; its triggers and maneuvers stay as written."""
    outputs.run(xl.live_esmini, scenario, reply, **options)


@command(
    group, "sumo", "Run a SUMO simulation (extra sumo).",
    "live sumo run.sumocfg -p motorway --seed 1 --lateral-resolution 4 --states states.parquet",
)
def sumo(
    config: Annotated[Path, typer.Argument(help="Configuration (.sumocfg).", show_default=False)], *,
    fcd_output: Annotated[Path | None, typer.Option(metavar="FCD.xml",
        help="SUMO's own output of where everybody was.")] = None,
    options: Annotated[Options, xl.live_sumo], outputs: Outputs, reply: Writing,
) -> None:
    """Run a SUMO simulation with the sublane model and drivers in its vehicles; lane changes stay SUMO's."""
    words = () if fcd_output is None else ("--fcd-output", str(fcd_output), "--fcd-output.attributes", FCD_COLUMNS)
    outputs.run(xl.live_sumo, config, reply, options=words, **options)


@command(
    group, "stdio", "Answer over a pipe: one line of JSON in, one out.",
    "live stdio -p motorway --seed 1 --road motorway.xodr",
)
def stdio(
    *, profile: str = "motorway", seed: int = 0,
    road: Annotated[Path | None, typer.Option(help="OpenDRIVE file that vehicles' places are on.")] = None,
    library: Paths = (), verbose: Verbose = False,
) -> None:
    """Answer lines on standard input, as docs/schemas/live.json has them, until there are no more."""
    import os
    import sys

    from xosc_lateral.extras.live.stdio import Pipe, lines_of

    pipe = Pipe(xl.read_profile(profile, library), seed=seed, road=road)
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
    "export fmu -p motorway --fmi 3.0 -o driver.fmu",
)
def fmu(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT.fmu", help="The unit.")],
    profile: str = "motorway",
    fmi: Annotated[Fmi, typer.Option(help="Version of FMI.")] = Fmi.TWO,
    compiler: Annotated[list[str] | None, typer.Option(metavar="CC",
        help="C compiler to make a binary with; may be repeated. Default: the host's.")] = None,
    library: Paths = (), force: Force = False, quiet: Quiet = False, verbose: Verbose = False,
) -> None:
    """Write a driver as a functional mock-up unit for co-simulation: C source, with binaries where a compiler is."""
    from xosc_lateral.files.output_paths import claim

    claim([output], force=force)
    driver = xl.read_profile(profile, library)
    platforms = xl.export_fmu(driver, output, fmi=fmi, compilers=compiler or ())
    content = f"C source, binaries for {', '.join(platforms) or 'no platform'}"
    if not quiet:
        say(f"{driver.name} as FMI {fmi} in {output}: {content}", err=True)


@command(export, "c", "C99 source for a test bench.", "export c -p motorway -o driver/")
def c_source(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER/", help="Folder of the files.")],
    profile: str = "motorway", library: Paths = (), force: Force = False, quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write a driver as C99 without dependencies: header, source, numbers, a CMake file and an example loop."""
    written = xl.export_c(xl.read_profile(profile, library), output, force=force)
    if not quiet:
        say(f"wrote {', '.join(str(path) for path in written)}", err=True)
