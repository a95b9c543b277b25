"""`xosc-lateral convert`: the main job; `verify`: whether outputs are what it makes today; `reproduce`: once more."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

import xosc_lateral as xl
from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.signals import Interrupted
from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Options, Printing, Writing, command, say, say_json, write_stdout
from xosc_lateral.files.openscenario.write.draft import Player
from xosc_lateral.files.remote import address, is_url, sent_back
from xosc_lateral.workflows.conversion.settings import ConvertSettings, OutputMode

if TYPE_CHECKING:
    from xosc_lateral.workflows.batch.workers import JobLimits
    from xosc_lateral.workflows.conversion.conversion import Conversion

# What is said of one option stays together.
# fmt: off
app = group_of_verbs()

class _WithPanels(TyperCommand):
    """Options of a batch under a heading of their own, which Typer has only where rich formats."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        usual = {"argument": "Arguments", "option": "Options"}
        panels = grouped(
            (getattr(param, "rich_help_panel", None) or usual[param.param_type_name], record)
            for param in self.get_params(ctx) if (record := param.get_help_record(ctx)) is not None
        )
        for title, records in panels.items():
            with formatter.section(title):
                formatter.write_dl(records)


@command(
    app, "convert", VERBS["convert"],
    "convert cut-in.xosc -o lifelike.xosc --seed 1 --report report.html",
    "convert scenarios/ -o enriched/ --variants 3 --jobs 2",
    "convert cut-in.xosc -o - -p Truck=motorway-vehicle-1 | grep Vertex",
    cls=_WithPanels,
)
def convert(
    scenario: Annotated[list[str],
        typer.Argument(help="Maneuver-based scenario (.xosc); several files, a folder, a glob or a table: a batch.",
        show_default=False)],
    *,
    output: Annotated[str | None, typer.Option("-o", "--output",
        help="File, folder/, or - for stdout; default NAME_lifelike.xosc. Batch: a folder.")] = None,
    settings: Annotated[Options, ConvertSettings],
    batch: Annotated[Options, xl.convert_many],
    report: Annotated[list[str] | None, typer.Option(metavar="FILE",
        help="What was added, by the file's ending: page (.html), Markdown with the numbers and two pictures for a "
        "pull request (.md), ASAM OSI trace with lanes, boxes and motion (.mcap, .osi; extra osi). May be repeated. "
        "Of a batch: a folder of pages.")] = None,
    reply: Writing,
) -> None:
    """Give every car in a scenario the lateral movement of a real driver."""
    from xosc_lateral.workflows.batch.request import is_single
    from xosc_lateral.workflows.batch.workers import JobLimits
    from xosc_lateral.workflows.opened import scenarios_at

    _refuse_together(settings)
    options = {**settings, "force": reply.force}
    places = scenarios_at(scenario[0]) if is_url(scenario[0]) else scenario
    if len(places) == 1 and is_single(places[0]) and batch.get("shard") is None:
        limits = JobLimits(**{name.removeprefix("job_"): batch[name] for name in batch if name.startswith("job_")})
        with sent_back(output, *(report or ())) as (target, *files):
            reports = _reports([text for text in files if text is not None])
            _convert_one(
                Path(places[0]), target, reports, options, limits, batch["variants"], reply, labels=batch["labels"]
            )
        return
    folder = next(iter(report or ()), None)
    if folder is not None and (len(report or ()) > 1 or Path(folder).is_file() or set(_reports([folder])) != {"page"}):
        raise typer.BadParameter("of a batch: one folder of pages", param_hint="--report")
    options |= {**batch, "report": folder, "show": "quiet" if reply.quiet else "json" if reply.logs_json else "auto"}
    _convert_batch(scenario, output, options, reply)


def _refuse_together(settings: Mapping[str, Any]) -> None:
    """Settings that can be had alone, but not with each other."""
    try:
        ConvertSettings(player=settings.get("player", Player.STANDARD), version=settings.get("version"))
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--version") from error
    if settings.get("player") is Player.CARLA and settings["mode"] is OutputMode.LANE_OFFSET:
        raise typer.BadParameter("CARLA's lane offsets have no shape; use --mode trajectory", param_hint="--player")


def _reports(files: Sequence[str]) -> dict[str, str]:
    """What is to be written beside an output, by its kind: "page", "summary", "trace"."""
    from xosc_lateral.files.osi import SUFFIXES
    from xosc_lateral.workflows.conversion.summary import SUMMARY_SUFFIXES

    kinds = {**dict.fromkeys(SUMMARY_SUFFIXES, "summary"), **dict.fromkeys(SUFFIXES, "trace")}
    by_kind = dict[str, str]()
    for text in files:
        kind = kinds.get(PurePath(text).suffix.lower(), "page")
        if kind in by_kind:
            raise typer.BadParameter(f"{by_kind[kind]} and {text}: one {kind} of an output", param_hint="--report")
        by_kind[kind] = text
    return by_kind


def _convert_one(
    source: Path, output: str | None, reports: Mapping[str, str], options: dict[str, Any], limits: JobLimits,
    variants: int, reply: Writing, *, labels: bool,
) -> None:
    from xosc_lateral.files.atomic import together
    from xosc_lateral.files.osi import osi_wanted
    from xosc_lateral.files.output_paths import STDOUT, claim, label_files, numbered, output_file
    from xosc_lateral.workflows.batch.workers import for_one
    from xosc_lateral.workflows.conversion.conversion import osi_files
    from xosc_lateral.workflows.conversion.convert import convert, default_output, output_scenario
    from xosc_lateral.workflows.conversion.summary import SUMMARY_SUFFIXES, pictures_beside
    from xosc_lateral.workflows.result import PAGE_SUFFIXES

    def limited(target: Path | None, **more: Any) -> Conversion:
        return for_one(lambda path: convert(path, target, **more, **options), source, limits)

    report, osi, summary = (reports.get(kind) for kind in ("page", "trace", "summary"))
    if output == STDOUT:
        if variants > 1 or reply.as_json or osi is not None or summary is not None or labels:
            raise typer.BadParameter("standard output takes a single scenario and no other output", param_hint="-o -")
        result = limited(None, report=report)
        write_stdout(result.data)
        reply.say(result, err=True)
        unclean = bool(result.warnings) or not result.enriched
    else:
        here = Path(source.name) if address(source) else source
        written = default_output(here) if output is None else output_scenario(output, source)
        page = None if report is None else output_file(report, f"{written.stem}.html", PAGE_SUFFIXES)
        trace = None if osi is None else osi_files(osi, source)[0]
        words = None if summary is None else output_file(summary, f"{written.stem}.md", SUMMARY_SUFFIXES)
        files = [
            [None if path is None else numbered(path, variant, variants) for path in (written, page, trace, words)]
            for variant in range(variants)
        ]
        osi_wanted(trace)
        outputs, pages, traces, summaries = zip(*files, strict=True)
        both = [path for one in traces if one is not None for path in osi_files(one, source)]
        both += [path for one in outputs if labels and one is not None for path in label_files(one)]
        both += [path for one in summaries if one is not None for path in (one, *pictures_beside(one))]
        claim([*outputs, *pages, *both], [source], force=reply.force)
        unclean = False
        for variant, (path, its_page, its_trace, its_summary) in enumerate(files, start=1):
            with together():
                result = limited(path, variant=variant, report=its_page)
                if its_trace is not None:
                    result.write_osi(its_trace, force=True)
                if labels and path is not None:
                    result.write_labels(path, force=True)
                if its_summary is not None:
                    result.write_summary(its_summary, force=True)
            reply.say(result)
            if reply.quiet or reply.as_json:
                strict = options["strict"]
                reply.warn(result.warnings if strict else filter(None, [result.cut_off]), strict=strict)
            unclean |= bool(result.warnings) or not result.enriched
    if options["strict"] and unclean:
        raise typer.Exit(1)


def _convert_batch(inputs: Sequence[str], output: str | None, options: Mapping[str, Any], reply: Writing) -> None:
    """Convert all of them; exit code 1 if any failed, or with `--strict` if anything is to be said of any."""
    from xosc_lateral.workflows.batch.call import convert_many

    if output is None or output == "-":
        raise typer.BadParameter(
            "several scenarios need a folder for their outputs, -o FOLDER; of one, -o names the output", param_hint="-o"
        )

    def show(row: Mapping[str, Any]) -> None:
        if reply.as_json:
            say_json({"kind": "output", **row})

    try:
        result = convert_many(list(inputs), output, on_outcome=show, **options)
    except Interrupted as signal:
        if signal.finished < 0:
            raise
        what = f"{signal.finished} outputs in {output} are finished, and the same command continues"
        say(f"xosc-lateral: interrupted; {what}", err=True)
        raise typer.Exit(128 + signal.number) from None
    reply.say_words(str(result), {"kind": "summary", **result.totals()}, err=False)
    if result.cut_off and (reply.quiet or reply.as_json):
        line = f"{len(result.cut_off)} runs end at the time limit, not by themselves: {result.cut_off[0]} is one"
        reply.warn([line], strict=options["strict"])
    if result.failed or (options["strict"] and (result.with_warnings or result.nobody_enriched)):
        raise typer.Exit(1)


@command(app, "verify", VERBS["verify"], "verify enriched/", "verify lifelike.xosc --json")
def verify(
    outputs: Annotated[list[Path], typer.Argument(metavar="OUTPUT...",
        help="Converted scenarios, or folders with a manifest.", show_default=False)],
    *, options: Annotated[Options, xl.verify], jobs: int = 1, reply: Printing,
) -> None:
    """Make outputs again in memory and name those that differ, and why: edited, other inputs, another version."""
    result = xl.verify(outputs, **options, workers=0 if jobs == 1 else jobs)
    reply.say(result, even=bool(result.failing))
    if result.failing:
        raise typer.Exit(1)


@command(
    app, "reproduce", VERBS["reproduce"],
    "reproduce lifelike.xosc -o again.xosc", "reproduce enriched/ -o again/ --jobs 2",
)
def reproduce(
    output: Annotated[Path, typer.Argument(metavar="OUTPUT", help="Converted scenario, or a folder with a manifest.",
        show_default=False)],
    new: Annotated[str, typer.Option("--output", "-o", help="File or folder to write to.", show_default=False)],
    *, options: Annotated[Options, xl.reproduce], reply: Writing,
) -> None:
    """Make an output, or a folder of them, again and compare the content; exit code 1 if it differs."""
    result = xl.reproduce(output, new, **options, force=reply.force)
    reply.say(result, even=bool(result.failing))
    if result.failing:
        raise typer.Exit(1)
