"""`xosc-lateral sample`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Library, Mapped, Profile, Seed, With, Written, command, warn, write_stdout

app = group_of_verbs()

Table = list[Path] | None


@command(
    app, "sample", VERBS["sample"],
    "sample -p motorway --duration 600 --speed 33 --seed 1 -o offsets.csv",
    "sample -p mine.json --like drives.parquet --snippet 10 -o snippets.parquet",
)  # fmt: skip
def sample(
    *,
    profile: Profile,
    output: Annotated[
        str, typer.Option("--output", "-o", metavar="OUT", help="Table: .csv, .csv.gz, .parquet, folder/, - .")
    ],
    seed: Seed = 0,
    like: Annotated[
        Table, typer.Option(metavar="TABLE", help="For each measured snippet, one with the same start and context.")
    ] = None,
    snippet: Annotated[float, typer.Option(help="Length of a snippet with --like. [s]", min=0.2, max=1e6)] = 10.0,
    context: Annotated[
        Table, typer.Option(metavar="TABLE", help="One free run per drive of the table, under its context.")
    ] = None,
    duration: Annotated[float | None, typer.Option(help="One free run of this length. [s]", min=0.2, max=9e6)] = None,
    speed: Annotated[float, typer.Option(help="Speed of the free run. [m/s]", min=0, max=150)] = 30.0,
    lane_width: Annotated[
        float | None, typer.Option(help="Lane width of the free run [m]; default: the profile's.", min=1, max=10)
    ] = None,
    with_: With = None,
    mapped: Mapped,
    library: Library = None,
    said: Written,
) -> None:
    """Sample offsets from a profile (one of --like, --context, --duration)."""
    from xosc_lateral import sample
    from xosc_lateral.files.output_paths import STDOUT, claim, output_file
    from xosc_lateral.files.output_tables import output_suffixes

    if sum(choice is not None for choice in (like, context, duration)) != 1:
        raise typer.BadParameter("give one of --like, --context, --duration")
    if output != STDOUT:
        inputs = [*(like or []), *(context or [])]
        claim([output_file(output, "offsets.csv", output_suffixes())], inputs, force=said.force)
    how: dict[str, Any] = {"snippet": snippet, "speed": speed, "lane_width": lane_width, "with_sensor": bool(with_)}
    how |= {"columns": mapped.mapping(), "library": library or ()}
    made = sample(profile, like=like, context=context, duration=duration, seed=seed, **how)
    if output == STDOUT:
        write_stdout(made.csv())
        said.say_words(made.headline(), None)
    else:
        written = made.write(output, force=said.force)
        said.say_words(f"{made.headline()} in {written}", {"output": str(written), **made.to_dict()})
    warn(made.warnings)
