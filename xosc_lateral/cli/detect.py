"""`xosc-lateral detect`: what cut-in detectors do on scenarios and on measured traffic."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Allow, Library, Mapped, RoadPath, Seed, TimeLimit, Written, command, naming_option

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()


@command(
    app, "detect", VERBS["detect"],
    "detect cut-in.xosc --variants 5 -p motorway --detector lateral-speed:threshold=0.15,hold=0.4",
    "detect scenarios/ drives.parquet -o table.csv --report detectors.html",
    "detect recording.csv --road road.xodr --detector logistic --train scenarios/ --sensor usual",
    'detect cut-in.xosc --ego Ego --detector "python mine.py"',
)
def detect(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...",
        help="Scenarios, folders, drive tables, recordings.", show_default=False)],
    *,
    detector: Annotated[list[str] | None, typer.Option(metavar='NAME[:OPTION=VALUE,...]|"COMMAND"',
        help="lateral-speed (threshold, hold), marking-distance, wandering-zone, time-to-line, fuzzy, logistic "
        "(threshold each), all, or a program of yours; may be repeated. Default: all.")] = None,
    ego: Annotated[str | None, typer.Option(metavar="NAME",
        help="Count cut-ins into its lane; none: into any neighbouring lane.")] = None,
    output: Annotated[str | None, typer.Option("--output", "-o", metavar="TABLE",
        help="Every threshold: .csv, .csv.gz, .parquet.")] = None,
    report: Annotated[str | None, typer.Option(metavar="PAGE.html", help="Page with curves and worst cases.")] = None,
    variants: Annotated[int, typer.Option(help="Lifelike variants of each scenario, beside it.", min=0,
        max=10_000)] = 0,
    profile: Annotated[list[str] | None, typer.Option("--profile", "-p", metavar="NAME|PATH",
        help="Who drives the variants; may be repeated.")] = None,
    train: Annotated[list[Path] | None, typer.Option(metavar="SOURCE",
        help="What logistic is trained on; may be repeated.")] = None,
    sensor: Annotated[str, typer.Option(metavar="noise=M,delay=S,rate=HZ",
        help="What detectors see through; usual: 0.05, 0.1, 20.")] = "",
    threshold: Annotated[float, typer.Option(help="Score above which a program's answer is an alarm.")] = 0.5,
    answer_time: Annotated[float, typer.Option(help="A program has to answer within [s].", min=0.01, max=3600)] = 10.0,
    seed: Seed = 0,
    road: Annotated[Path | None, typer.Option("--road", help="OpenDRIVE file of a recording without one.",
        show_default=False)] = None,
    mapped: Mapped, library: Library = None, allow: Allow = None, road_path: RoadPath = None,
    time_limit: TimeLimit = None, reply: Written,
) -> None:
    """Count false alarms in lane keeping, cut-ins seen and the time before the marking, source by source."""
    from xosc_lateral import detect
    from xosc_lateral.files.output_paths import claim, output_file
    from xosc_lateral.files.output_tables import output_suffixes
    from xosc_lateral.workflows.detection.observation import read_sensor
    from xosc_lateral.workflows.result import PAGE_SUFFIXES

    table = None if output is None else output_file(output, "detection.csv", output_suffixes())
    page = None if report is None else output_file(report, "detection.html", PAGE_SUFFIXES)
    claim([table, page], [source for source in sources if source.is_file()], force=reply.force)
    with naming_option("--sensor"):
        read_sensor(sensor)
    with naming_option("--detector"):
        result = detect(
            sources, detectors=detector or ("all",), ego=ego, variants=variants, profiles=profile or ("motorway",),
            train=train or (), sensor=sensor, threshold=threshold, answer_time=answer_time, seed=seed, road=road,
            columns=mapped.mapping(), library=library or (), allow=allow or (), road_path=road_path or (),
            time_limit=time_limit,
        )
    if table is not None:
        result.write(table, force=reply.force)
    if page is not None:
        result.write_report(page, force=reply.force)
    reply.say(result)
