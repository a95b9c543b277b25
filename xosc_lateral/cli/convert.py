"""`xosc-lateral convert`: the main job."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli.words import pairs
from xosc_lateral.pipeline.settings import ConvertSettings, Mode


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("convert")(convert)


def convert(
    scenario: Annotated[
        list[str],
        typer.Argument(
            help="Maneuver-based scenario (.xosc); folder, glob, table or several: batch.", show_default=False
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Default: NAME_lifelike.xosc. Of a batch: folder.")
    ] = None,
    profile: Annotated[str, typer.Option(help="Name or path; auto: by the vehicle's class.")] = "auto",
    seed: Annotated[int, typer.Option(help="Same inputs and seed, same bytes.", min=0)] = 0,
    entity: Annotated[list[str] | None, typer.Option(metavar="NAME=PROFILE", help="Profile of one entity.")] = None,
    only: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Enrich this entity alone.")] = None,
    variants: Annotated[int, typer.Option(help="Write so many, each with other offsets.", min=1)] = 1,
    report: Annotated[Path | None, typer.Option(help="HTML page about what was changed.")] = None,
    context: Annotated[Path | None, typer.Option(help="Table of context over time (time, wind_speed, ...).")] = None,
    parameter: Annotated[list[str] | None, typer.Option("--set", metavar="NAME=VALUE")] = None,
    library: Annotated[list[Path] | None, typer.Option(help="Folder with further profiles.")] = None,
    mode: Annotated[
        Mode, typer.Option(help="trajectory: maneuvers are played out; lane-offset: maneuvers stay reactive.")
    ] = Mode.TRAJECTORY,
    allow: Annotated[list[Path] | None, typer.Option(help="Folder that roads and catalogs may lie in.")] = None,
    resample: Annotated[int, typer.Option(help="Attempts while cars touch or leave their lane.", min=1)] = 1,
    time_limit: Annotated[float, typer.Option(help="End of a scenario without one [s].", min=0.1, max=86_400)] = 60.0,
    jobs: Annotated[int, typer.Option(help="Batch: processes; -1: one per core.")] = 1,
    cluster: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Batch: dask scheduler to work on.")] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Batch: failures alone.")] = False,
    log_json: Annotated[bool, typer.Option("--log-json", help="Batch: progress as JSON lines.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="For machines.")] = False,
) -> None:
    """Give every car in a scenario the lateral movement of a real driver."""
    from xosc_lateral.cli.batches import convert_batch, is_batch
    from xosc_lateral.pipeline.convert import convert_variants
    from xosc_lateral.report.conversion import as_text, to_json, write_report

    settings = ConvertSettings(
        profile=profile,
        entity_profiles=pairs(entity, "--entity"),
        only=frozenset(only) if only else None,
        seed=seed,
        context=context,
        parameters=pairs(parameter, "--set"),
        attempts=resample,
        mode=mode,
        libraries=tuple(library or ()),
        allowed=tuple(allow or ()),
        time_limit=time_limit,
    )
    if is_batch(scenario):
        if jobs == 0 or jobs < -1:
            raise typer.BadParameter("at least 1, or -1 for one per core", param_hint="--jobs")
        if report is not None:
            raise typer.BadParameter("a page is made of one scenario, not of a batch", param_hint="--report")
        display = "json" if log_json else "quiet" if quiet else "auto"
        convert_batch(
            scenario, output, settings, variants=variants, jobs=jobs, cluster=cluster, display=display, as_json=as_json
        )
        return
    for conversion in convert_variants(Path(scenario[0]), output, settings, variants=variants, report=report):
        where = write_report(conversion, report, variants=variants) if report else None
        typer.echo(to_json(conversion, where) if as_json else as_text(conversion, where))
