"""`xosc-lateral benchmark`: lateral models of the field, side by side."""

from __future__ import annotations

from typing import Annotated

import typer

from xosc_lateral.cli.words import AsJson, Columns, Force, Library, Quiet, Seed, Tables, examples, pairs, say


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    benchmark = typer.Typer(help="Compare lateral models from the literature.", no_args_is_help=True)
    epilog = examples("benchmark realism drives.parquet -o board/")
    benchmark.command("realism", short_help="Rank lateral models on measured drives.", epilog=epilog)(realism)
    app.add_typer(benchmark, name="benchmark", short_help="Compare lateral models from the literature.")


def realism(
    tables: Tables,
    output: Annotated[
        str | None,
        typer.Option("--output", "-o", metavar="FOLDER/", help="Folder for board.json, board.md and board.html."),
    ] = None,
    model: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only these models; may be repeated.")] = None,
    profile: Annotated[
        list[str] | None,
        typer.Option(
            "--profile", "-p", metavar="NAME|PATH", help="Also score this profile of your own; may be repeated."
        ),
    ] = None,
    seed: Seed = 0,
    resamples: Annotated[
        int, typer.Option(help="Bootstrap resamples of the drives, for the intervals.", min=10, max=10_000)
    ] = 200,
    classify: Annotated[bool, typer.Option(help="Also train classifiers (extra `board`; takes minutes).")] = True,
    columns: Columns = None,
    library: Library = None,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Fit every model to half of the drives and rank it on the other half: distances, floors, intervals."""
    from xosc_lateral.api.benchmark import benchmark_realism, board_files
    from xosc_lateral.baselines.catalogue import MODELS
    from xosc_lateral.formats.output_paths import claim
    from xosc_lateral.report.progress import no_progress, shown_progress

    for name in model or ():
        if name not in MODELS:
            raise typer.BadParameter(f"{name!r}: there are {', '.join(MODELS)}", param_hint="--model")
    if output is not None:
        claim(board_files(output), tables, force=force)
    with no_progress() if quiet else shown_progress("benchmark") as progress:
        board = benchmark_realism(
            tables,
            models=model,
            profiles=profile or (),
            library=library or (),
            seed=seed,
            resamples=resamples,
            classify=classify,
            columns=pairs(columns, "--map"),
            progress=progress,
        )
    if output is not None:
        board.write(output, force=force)
    say(board, as_json=as_json, quiet=quiet)
