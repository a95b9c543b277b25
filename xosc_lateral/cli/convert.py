"""`xosc-lateral convert`: the main job."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from xosc_lateral.cli.words import (
    Allow,
    AsJson,
    Force,
    Library,
    Osi,
    Parameters,
    Quiet,
    Road,
    RoadPath,
    Seed,
    TimeLimit,
    With,
    examples,
    pairs,
    say,
    warn,
    write_stdout,
)
from xosc_lateral.enrich.neighbours import Neighbours
from xosc_lateral.formats.openscenario.write.target import Player
from xosc_lateral.limits import JOB_MEMORY, JOB_TIMEOUT
from xosc_lateral.pipeline.settings import OutputMode

if TYPE_CHECKING:
    from xosc_lateral.api.convert import Conversion

EXAMPLES = examples(
    "convert cut-in.xosc -o lifelike.xosc --seed 1 --report report.html",
    "convert scenarios/ -o enriched/ --variants 3 --jobs 2",
    "convert cut-in.xosc -o - --entity Truck=motorway-vehicle-3 | grep Vertex",
)


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("convert", short_help="Make scenarios lifelike: one, several, a folder.", epilog=EXAMPLES)(convert)


def convert(
    scenario: Annotated[
        list[str],
        typer.Argument(
            help="Maneuver-based scenario (.xosc); several files, a folder, a glob or a table: a batch.",
            show_default=False,
        ),
    ],
    output: Annotated[
        str | None,
        typer.Option(
            "-o", "--output", help="File, folder/, or - for stdout; default NAME_lifelike.xosc. Batch: a folder."
        ),
    ] = None,
    profile: Annotated[
        str, typer.Option("--profile", "-p", help="Name or path of a driver profile; auto: motorway, the population.")
    ] = "auto",
    seed: Seed = 0,
    entity: Annotated[
        list[str] | None, typer.Option(metavar="NAME=PROFILE", help="Profile of one entity; may be repeated.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Enrich only this entity; may be repeated.")
    ] = None,
    ego: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Vehicle under test: left as it is; may be repeated. Those with an external controller are found "
            "by themselves. none: there is none.",
        ),
    ] = None,
    neighbours: Annotated[
        Neighbours | None,
        typer.Option(
            help="How drivers answer to vehicles beside them: as their profile alone says; borrow: by a population's "
            "law where that is not known (default); none: not at all.",
            show_default=False,
        ),
    ] = None,
    variants: Annotated[int, typer.Option(help="Number of outputs, each with different offsets.", min=1)] = 1,
    report: Annotated[
        str | None,
        typer.Option(metavar="PAGE.html", help="Page that shows what was added; for a batch, a folder of pages."),
    ] = None,
    osi: Osi = None,
    context: Annotated[
        Path | None, typer.Option(help="Table of context over time (columns time, wind_speed, ...).")
    ] = None,
    parameter: Parameters = None,
    library: Library = None,
    mode: Annotated[
        OutputMode,
        typer.Option(
            help="trajectory: play the maneuvers out; lane-offset: keep them reactive; auto: by vehicle, as it depends "
            "on a vehicle under test."
        ),
    ] = OutputMode.AUTO,
    player: Annotated[
        Player, typer.Option("--for", help="Who plays it: standard, or made for esmini or CARLA's ScenarioRunner.")
    ] = Player.STANDARD,
    version: Annotated[
        str | None,
        typer.Option(
            metavar="1.0..1.4", help="Version of OpenSCENARIO to write; default: the input's.", show_default=False
        ),
    ] = None,
    allow: Allow = None,
    road: Road = None,
    road_path: RoadPath = None,
    resample: Annotated[
        int, typer.Option(help="Attempts at most, while vehicles collide or leave their lane.", min=1)
    ] = 1,
    time_limit: TimeLimit = None,
    with_: With = None,
    jobs: Annotated[int, typer.Option(help="Batch: number of processes; -1: one per core.")] = 1,
    job_timeout: Annotated[
        float, typer.Option(help="Batch: time limit per scenario [s].", min=1, max=86_400)
    ] = JOB_TIMEOUT.value,
    job_memory: Annotated[
        float, typer.Option(help="Batch: memory limit per scenario [MB].", min=100, max=1e6)
    ] = JOB_MEMORY.value,
    cluster: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Batch: address of a dask scheduler.")] = None,
    strict: Annotated[
        bool,
        typer.Option("--strict", help="Exit with 1 on warnings, a missing vehicle catalog, or no entity enriched."),
    ] = False,
    log_json: Annotated[bool, typer.Option("--log-json", help="Batch: progress as JSON lines on stderr.")] = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Give every car in a scenario the lateral movement of a real driver."""
    from xosc_lateral.cli.batches import convert_batch, is_batch

    _check_target(player, version, mode)
    settings: dict[str, Any] = {
        "profile": profile,
        "entity": pairs(entity, "--entity"),
        "only": only or None,
        "ego": _egos(ego),
        "neighbours": None if neighbours is None else neighbours.value,
        "seed": seed,
        "context": context,
        "parameters": pairs(parameter, "--set"),
        "attempts": resample,
        "mode": mode.value,
        "player": player.value,
        "version": version,
        "library": library or (),
        "allow": allow or (),
        "road": road,
        "road_path": road_path or (),
        "time_limit": time_limit,
        "with_sensor": bool(with_),
        "strict": strict,
        "force": force,
    }
    if is_batch(scenario):
        if osi is not None:
            raise typer.BadParameter("traces are written for a single scenario", param_hint="--osi")
        if jobs == 0 or jobs < -1:
            raise typer.BadParameter("at least 1, or -1 for one per core", param_hint="--jobs")
        if report is not None and Path(report).is_file():
            raise typer.BadParameter("of a batch: a folder, not a file", param_hint="--report")
        show = "json" if log_json else "quiet" if quiet else "auto"
        convert_batch(
            scenario,
            output,
            {
                **settings,
                "variants": variants,
                "report": report,
                "workers": jobs,
                "cluster": cluster,
                "show": show,
                "job_timeout": job_timeout,
                "job_memory": job_memory,
            },
            strict=strict,
            quiet=quiet,
            as_json=as_json,
        )
    else:
        _convert_one(Path(scenario[0]), output, settings, variants, report, osi, strict, quiet, as_json)


def _warn_if_cut_off(result: Conversion, unsaid: bool) -> None:
    """Quiet, too: an output that ends before its scenario does is not what was asked for."""
    if unsaid and result.cut_off is not None:
        warn([result.cut_off])


def _egos(names: list[str] | None) -> list[str] | None:
    from xosc_lateral.pipeline.settings import egos_named

    try:
        egos_named(names or None)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--ego") from error
    return names or None


def _check_target(player: Player, version: str | None, mode: OutputMode) -> None:
    from xosc_lateral.formats.openscenario.write.target import target

    try:
        target(player.value, version)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--version") from error
    if player is Player.CARLA and mode is OutputMode.LANE_OFFSET:
        raise typer.BadParameter("CARLA's lane offsets have no shape; use --mode trajectory", param_hint="--for")


def _convert_one(
    source: Path,
    output: str | None,
    settings: dict[str, Any],
    variants: int,
    report: str | None,
    osi: str | None,
    strict: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    from xosc_lateral.api.convert import REPORT_SUFFIXES, convert, lifelike, osi_files, output_scenario
    from xosc_lateral.api.variants import variant_files, variant_set
    from xosc_lateral.formats.osi.extra import osi_wanted
    from xosc_lateral.formats.output_paths import STDOUT, claim, output_file
    from xosc_lateral.pipeline.convert import numbered

    if output == STDOUT:
        if variants > 1 or as_json or osi is not None:
            raise typer.BadParameter("standard output takes a single scenario and no other output", param_hint="-o -")
        result = convert(source, None, report=report, **settings)
        write_stdout(result.data)
        say(result, as_json=False, quiet=quiet, aside=True)
        _warn_if_cut_off(result, quiet)
        unclean = bool(result.warnings) or not result.enriched
    else:
        written = lifelike(source) if output is None else output_scenario(output, source)
        page = None if report is None else output_file(report, f"{written.stem}.html", REPORT_SUFFIXES)
        outputs = [numbered(written, variant, variants) for variant in range(variants)]
        pages = [None if page is None else numbered(page, variant, variants) for variant in range(variants)]
        files = variant_files(written, variants, settings["mode"], settings["player"])
        trace = None if osi is None else osi_files(osi, source)[0]
        traces = [None if trace is None else numbered(trace, variant, variants) for variant in range(variants)]
        both = [path for one in traces if one is not None for path in osi_files(one, source)]
        osi_wanted(trace)
        claim([*outputs, *pages, *both, *(files.all(variants) if files else ())], [source], force=settings["force"])
        unclean, replayed = False, True
        for variant, (path, its_page, trace) in enumerate(zip(outputs, pages, traces, strict=True)):
            result = convert(source, path, variant=variant, report=its_page, **settings)
            if trace is not None:
                result.write_osi(trace, force=True)
            say(result, as_json=as_json, quiet=quiet)
            _warn_if_cut_off(result, quiet or as_json)
            replayed &= result.is_replay
            unclean |= bool(result.warnings) or not result.enriched
        if files is not None and replayed:
            found = variant_set(outputs, written, source=source, force=True)
            if not (quiet or as_json):
                typer.echo(str(found))
        elif files is not None and not quiet:
            typer.echo("no set of the variants: it holds trajectories alone (--ego none writes them)", err=True)
    if strict and unclean:
        raise typer.Exit(1)
