"""`xosc-lateral evaluate`: how true a profile is to measured drives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""

    @app.command()
    def evaluate(
        tables: Annotated[
            list[Path], typer.Argument(metavar="TABLE...", help="Drive tables: .csv, .csv.gz, .parquet.")
        ],
        profile: Annotated[str, typer.Option("--profile", "-p", metavar="NAME|PATH", help="Driver profile.")],
        report: Annotated[Path | None, typer.Option(metavar="OUT.html", help="Write a report with figures.")] = None,
        as_json: Annotated[bool, typer.Option("--json", help="Print the scores as JSON.")] = False,
        seed: Annotated[int, typer.Option(help="Same inputs and seed, same numbers.", min=0)] = 0,
        classify: Annotated[bool, typer.Option(help="Train a classifier (extra `classifier`).")] = True,
        columns: Annotated[
            list[str] | None,
            typer.Option("--map", metavar="NAME=COLUMN[:UNIT]", help="Foreign header, e.g. speed=v_kmh:km/h."),
        ] = None,
        library: Annotated[list[Path] | None, typer.Option(help="Folder with further profiles.")] = None,
    ) -> None:
        """Score a profile: ten metrics, the paper's four evaluations, distances and floors, spectrum, classifier."""
        from xosc_lateral.driver.series import all_runs
        from xosc_lateral.formats.atomic import refuse_targets
        from xosc_lateral.formats.drives import parse_map, read_drives
        from xosc_lateral.formats.profiles import read_profile
        from xosc_lateral.loop.scores import score_profile
        from xosc_lateral.report.evaluation import evaluation_json, evaluation_text, write_evaluation

        refuse_targets([report], tables)
        driver = read_profile(profile, library or [])
        runs = all_runs(read_drives(tables, parse_map(columns or [])))
        scores = score_profile(driver, runs, seed=seed, classify=classify)
        if report is not None:
            write_evaluation(scores, driver, tables, report)
        typer.echo(evaluation_json(scores, driver, tables) if as_json else evaluation_text(scores, driver, tables))
