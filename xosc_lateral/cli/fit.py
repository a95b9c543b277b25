"""`xosc-lateral fit`: drives into a profile; `sample`: offsets from one; `evaluate`: how true one is to drives."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import (
    Library,
    Mapped,
    Profile,
    Seed,
    Tables,
    With,
    Written,
    command,
    warn,
    write_stdout,
)

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()


def _known_model(text: str) -> str:
    from xosc_lateral.base.errors import DriverProfileError
    from xosc_lateral.drivers.model.core.registry import model_named

    try:
        return model_named(text).model.kind
    except DriverProfileError as error:
        raise typer.BadParameter(str(error)) from error


@command(
    app, "fit", VERBS["fit"],
    "fit drives.csv.gz -o mine.json", "fit monday.csv tuesday.csv -o profiles/ --name anna --map speed=v_kmh:km/h",
    "fit smoothed.csv -o mine.json --valid-below 0.3",
)
def fit(
    tables: Tables, *,
    output: Annotated[str, typer.Option("--output", "-o", metavar="PROFILE.json",
        help="Profile to write: file, folder/, or -.")],
    model: Annotated[str, typer.Option(parser=_known_model, metavar="[two-level|autoregressive|PLUG-IN]",
        help="two-level: Neis and Beyerer; autoregressive: the default; best: the same.")] = "autoregressive",
    corrected: Annotated[bool, typer.Option("--corrected",
        help="Two-level model: freed of its fit's bias, by simulation.")] = False,
    mapped: Mapped,
    name: Annotated[str, typer.Option(help="Name of the profile; default: the file's name.")] = "",
    source: Annotated[str, typer.Option(help="Description of the drives, for the provenance.")] = "",
    licence: Annotated[str, typer.Option(help="Licence of the drives, for the provenance.")] = "",
    sensor_noise: Annotated[float | None,
        typer.Option(help="Standard deviation of the sensor's error, rounding included [m]; default: estimated.",
        min=1e-4, max=2)] = None,
    left_hand: Annotated[bool, typer.Option("--left-hand", help="Drives of left-hand traffic.")] = False,
    neighbours: Annotated[bool | None, typer.Option("--neighbours/--no-neighbours",
        help="Whether to fit how drivers keep away from vehicles beside them; default: where they are known.")] = None,
    valid_below: Annotated[float | None, typer.Option(metavar="HZ", min=0.02, max=2.5,
        help="Frequency up to which tables show driving that do not state it: smoothed tracks. [Hz]")] = None,
    prior: Annotated[
        str,
        typer.Option(
            metavar="PROFILE|none",
            help="Whose fast movement it has above the band that the tables show; rural: only where they state one.",
        ),
    ] = "rural", library: Library = None, reply: Written,
) -> None:
    """Fit a driver profile to measured drives."""
    from xosc_lateral import fit, write_profile
    from xosc_lateral.files.output_paths import STDOUT, claim, output_file
    from xosc_lateral.files.profiles import describe_profile, profile_bytes, profile_record
    from xosc_lateral.workflows.profiles.fit import fit_warnings
    from xosc_lateral.workflows.profiles.profiles import PROFILE_SUFFIXES

    usual = name or tables[0].name.split(".")[0]
    written = None if output == STDOUT else output_file(output, f"{usual}.json", PROFILE_SUFFIXES)
    claim([written], tables, force=reply.force)
    profile = fit(
        tables, name=name or (usual if written is None else written.stem), model=model, corrected=corrected,
        columns=mapped.mapping(), source=source, licence=licence, sensor_noise=sensor_noise, left_hand=left_hand,
        neighbours=neighbours, valid_below=valid_below, prior=None if prior == "none" else prior, library=library or (),
    )
    if written is None:
        write_stdout(profile_bytes(profile))
    else:
        write_profile(profile, written, force=reply.force)
    facts = None if written is None else {"output": str(written), **profile_record(profile)}
    reply.say_words(describe_profile(profile), facts)
    warn(fit_warnings(profile, sensor_noise))


Table = list[Path] | None


@command(
    app, "sample", VERBS["sample"],
    "sample -p motorway --duration 600 --speed 33 --seed 1 -o offsets.csv",
    "sample -p mine.json --like drives.parquet --snippet 10 -o snippets.parquet",
)
def sample(
    *, profile: Profile,
    output: Annotated[str, typer.Option("--output", "-o", metavar="OUT",
        help="Table: .csv, .csv.gz, .parquet, folder/, - .")],
    seed: Seed = 0,
    like: Annotated[Table, typer.Option(metavar="TABLE",
        help="For each measured snippet, one with the same start and context.")] = None,
    snippet: Annotated[float, typer.Option(help="Length of a snippet with --like. [s]", min=0.2, max=1e6)] = 10.0,
    context: Annotated[Table, typer.Option(metavar="TABLE",
        help="One free run per drive of the table, under its context.")] = None,
    duration: Annotated[float | None, typer.Option(help="One free run of this length. [s]", min=0.2, max=9e6)] = None,
    speed: Annotated[float, typer.Option(help="Speed of the free run. [m/s]", min=0, max=150)] = 30.0,
    lane_width: Annotated[float | None, typer.Option(help="Lane width of the free run [m]; default: the profile's.",
        min=1, max=10)] = None,
    with_: With = None, mapped: Mapped, library: Library = None, reply: Written,
) -> None:
    """Sample offsets from a profile (one of --like, --context, --duration)."""
    from xosc_lateral import sample
    from xosc_lateral.files.output_paths import STDOUT, claim, output_file
    from xosc_lateral.files.output_tables import output_suffixes

    if sum(choice is not None for choice in (like, context, duration)) != 1:
        raise typer.BadParameter("give one of --like, --context, --duration")
    if output != STDOUT:
        inputs = [*(like or []), *(context or [])]
        claim([output_file(output, "offsets.csv", output_suffixes())], inputs, force=reply.force)
    how: dict[str, Any] = {"snippet": snippet, "speed": speed, "lane_width": lane_width, "with_sensor": bool(with_)}
    how |= {"columns": mapped.mapping(), "library": library or ()}
    made = sample(profile, like=like, context=context, duration=duration, seed=seed, **how)
    if output == STDOUT:
        write_stdout(made.csv())
        reply.say_words(made.headline(), None)
    else:
        written = made.write(output, force=reply.force)
        reply.say_words(f"{made.headline()} in {written}", {"output": str(written), **made.to_dict()})
    warn(made.warnings)


@command(app, "evaluate", VERBS["evaluate"], "evaluate drives.csv.gz -p mine.json --report evaluation.html")
def evaluate(
    tables: Tables, *, profile: Profile,
    report: Annotated[str | None, typer.Option(metavar="PAGE.html", help="Write a report with figures.")] = None,
    seed: Seed = 0,
    classify: Annotated[bool, typer.Option(help="Also train classifiers (extra `classifier`).")] = True,
    mapped: Mapped, library: Library = None, reply: Written,
) -> None:
    """Score a profile on measured drives, beside other real drivers: metrics, spectrum, classifiers."""
    from xosc_lateral import evaluate
    from xosc_lateral.files.output_paths import claim, output_file
    from xosc_lateral.workflows.result import PAGE_SUFFIXES

    page = None if report is None else output_file(report, "evaluation.html", PAGE_SUFFIXES)
    claim([page], tables, force=reply.force)
    result = evaluate(profile, tables, seed=seed, classify=classify, columns=mapped.mapping(), library=library or ())
    if page is not None:
        result.write_report(page, force=reply.force)
    reply.say(result)
