"""`xosc-lateral sample`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Table = list[Path] | None


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""

    @app.command()
    def sample(
        profile: Annotated[str, typer.Option("--profile", "-p", metavar="NAME|PATH", help="Driver profile.")],
        output: Annotated[Path, typer.Option("--output", "-o", metavar="OUT", help="Table: .csv or .parquet.")],
        seed: Annotated[int, typer.Option(help="Same inputs and seed, same bytes.", min=0)],
        like: Annotated[
            Table, typer.Option(metavar="TABLE", help="For each real snippet one of the same start.")
        ] = None,
        snippet: Annotated[float, typer.Option(help="Length of a snippet with --like. [s]", min=0.2, max=1e6)] = 10.0,
        context: Annotated[Table, typer.Option(metavar="TABLE", help="One free run per drive of the table.")] = None,
        duration: Annotated[
            float | None, typer.Option(help="One free run of this length. [s]", min=0.2, max=9e6)
        ] = None,
        speed: Annotated[float, typer.Option(help="Speed of the free run. [m/s]", min=0, max=150)] = 30.0,
        lane_width: Annotated[
            float | None, typer.Option(help="Of the free run; else the profile's. [m]", min=1, max=10)
        ] = None,
        columns: Annotated[
            list[str] | None,
            typer.Option("--map", metavar="NAME=COLUMN[:UNIT]", help="Foreign header, e.g. speed=v_kmh:km/h."),
        ] = None,
        library: Annotated[list[Path] | None, typer.Option(help="Folder with further profiles.")] = None,
    ) -> None:
        """Sample offsets from a profile (one of --like, --context, --duration)."""
        if sum(choice is not None for choice in (like, context, duration)) != 1:
            raise typer.BadParameter("give one of --like, --context, --duration")
        from xosc_lateral.driver.snippets import sample_context, sample_free, sample_like
        from xosc_lateral.formats.atomic import refuse_targets
        from xosc_lateral.formats.drives import parse_map, read_drives
        from xosc_lateral.formats.offsets import sampling_provenance, write_offsets
        from xosc_lateral.formats.profiles import read_profile

        refuse_targets([output], [*(like or []), *(context or [])])
        driver = read_profile(profile, library or [])
        mapping = parse_map(columns or [])
        if like is not None:
            made = sample_like(driver, read_drives(like, mapping), snippet, seed)
            settings = sampling_provenance(driver, seed, like, snippet_s=snippet)
        elif context is not None:
            made = sample_context(driver, read_drives(context, mapping), seed)
            settings = sampling_provenance(driver, seed, context)
        else:
            made = sample_free(driver, duration or 0.0, seed, speed=speed, lane_width=lane_width)
            settings = sampling_provenance(driver, seed, duration_s=duration, speed=speed)
        rows = write_offsets(made, output, settings, snippets=like is not None)
        typer.echo(f"{rows} offsets in {output}", err=True)
