"""`xosc-lateral fit`: drives into a profile; `sample`: offsets from one; `evaluate`: how true one is to drives."""

from __future__ import annotations

from typing import Annotated
from warnings import catch_warnings, simplefilter

import typer

import xosc_lateral as xl
from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Options, Strict, Tables, Writing, command, refuse_warnings, write_stdout

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()


@command(
    app, "check", VERBS["check"],
    "check drives.csv.gz --report health.html", "check drives.csv.gz --write-mapping mapping.toml",
)
def check(
    tables: Tables, *,
    report: Annotated[str | None, typer.Option(metavar="PAGE.html", help="Write a page with figures.")] = None,
    write_mapping: Annotated[str | None, typer.Option(metavar="FILE.toml",
        help="Write the mapping that is proposed.")] = None,
    options: Annotated[Options, xl.check],
    reply: Writing,
) -> None:
    """What tables of drives hold: columns, units, signs, gaps, sensor noise; what can be fitted, and what not."""
    page, mapping = reply.claim(tables, page=(report, "health.html"), mapping=(write_mapping, "mapping.toml"))
    health = xl.check(tables, **options)
    if page is not None:
        health.write_report(page, force=reply.force)
    if mapping is not None:
        health.write_mapping(mapping, force=reply.force)
    reply.say(health)
    if health.read is None:
        raise typer.Exit(1)


@command(
    app, "fit", VERBS["fit"],
    "fit drives.csv.gz -o mine.json", "fit monday.csv tuesday.csv -o profiles/ --name anna --map speed=v_kmh:km/h",
    "fit smoothed.csv -o mine.json --valid-below 0.3",
)
def fit(
    tables: Tables, *,
    output: Annotated[str, typer.Option("--output", "-o", metavar="PROFILE.json",
        help="Profile to write: file, folder/, or -.")],
    options: Annotated[Options, xl.fit],
    strict: Strict = False,
    reply: Writing,
) -> None:
    """Fit a driver profile to measured drives."""
    from xosc_lateral.files.profiles import describe_profile, profile_bytes, profile_record
    from xosc_lateral.workflows.profiles.fit import fit_warnings

    usual = options["name"] or tables[0].name.split(".")[0]
    (written,) = reply.claim(tables, profile=(output, f"{usual}.json"))
    options["name"] = options["name"] or (usual if written is None else written.stem)
    with catch_warnings(record=True) as caught:
        simplefilter("always", UserWarning)
        profile = xl.fit(tables, **options)
    if written is None:
        write_stdout(profile_bytes(profile))
    else:
        xl.write_profile(profile, written, force=reply.force)
    facts = None if written is None else {"output": str(written), **profile_record(profile)}
    reply.say_words(describe_profile(profile), facts)
    warned = [*(str(one.message) for one in caught), *fit_warnings(profile, options.get("sensor_noise"))]
    reply.warn(warned, strict=strict)
    refuse_warnings(warned, strict)


@command(
    app, "sample", VERBS["sample"],
    "sample -p motorway --duration 600 --speed 33 --seed 1 -o offsets.csv",
    "sample -p mine.json --like drives.parquet --snippet 10 -o snippets.parquet",
)
def sample(
    *,
    output: Annotated[str, typer.Option("--output", "-o", metavar="OUT",
        help="Table: .csv, .csv.gz, .parquet, folder/, - .")],
    options: Annotated[Options, xl.sample],
    strict: Strict = False,
    reply: Writing,
) -> None:
    """Sample offsets from a profile (one of --like, --context, --duration)."""
    if sum(name in options for name in ("like", "context", "duration")) != 1:
        raise typer.BadParameter("give one of --like, --context, --duration")
    (written,) = reply.claim([*options.get("like", ()), *options.get("context", ())], table=(output, "offsets.csv"))
    made = xl.sample(**options)
    if written is None:
        write_stdout(made.csv())
        reply.say_words(made.headline(), None)
    else:
        written = made.write(output, force=reply.force)
        reply.say_words(f"{made.headline()} in {written}", {"output": str(written), **made.to_dict()})
    reply.warn(made.warnings, strict=strict)
    refuse_warnings(made.warnings, strict)


@command(app, "evaluate", VERBS["evaluate"], "evaluate drives.csv.gz -p mine.json --report evaluation.html")
def evaluate(
    tables: Tables, *,
    report: Annotated[str | None, typer.Option(metavar="PAGE.html", help="Write a report with figures.")] = None,
    options: Annotated[Options, xl.evaluate],
    reply: Writing,
) -> None:
    """Score a profile on measured drives, beside other real drivers: metrics, spectrum, classifiers."""
    (page,) = reply.claim(tables, page=(report, "evaluation.html"))
    result = xl.evaluate(drives=tables, **options)
    if page is not None:
        result.write_report(page, force=reply.force)
    reply.say(result)
