"""`xosc-lateral import`: other people's recordings into the standard drive table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from xosc_lateral.cli.words import (
    AsJson,
    Columns,
    Force,
    MappingFile,
    Quiet,
    examples,
    mapped,
    pairs,
    say_json,
    write_stdout,
)

Source = Annotated[Path, typer.Argument(metavar="SOURCE", help="File or folder to read.", show_default=False)]
Output = Annotated[
    str, typer.Option("--output", "-o", metavar="TABLE", help="Drive table: .parquet, .csv, .csv.gz, folder/, - .")
]
KeepCut = Annotated[
    bool, typer.Option("--keep-cut", help="Keep rows that would be cut; the column `state` gives the reason.")
]


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    formats = typer.Typer(cls=_WithPlugins, help="Convert recordings in other formats into the standard drive table.")
    dlr_example = examples("import dlr-ht tasi-0.15.4-py3-none-any.whl -o drives.parquet")
    formats.command("dlr-ht", short_help="DLR Highway Traffic.", epilog=dlr_example)(dlr_ht)
    formats.command("levelx", short_help="highD and exiD.", epilog=examples("import levelx highD/ -o highd.parquet"))(
        levelx
    )
    mf4_example = examples("import mf4 log.mf4 -o drive.parquet --map offset=Lane_Lat --map lane_width=Lane_Width")
    formats.command("mf4", short_help="ASAM MDF bus logs.", epilog=mf4_example)(mf4)
    tracks_example = examples("import tracks tracks.csv --road road.xodr -o drives.parquet --map vehicle=obj")
    formats.command("tracks", short_help="Tracks on an OpenDRIVE road.", epilog=tracks_example)(tracks)
    fcd_example = examples("import fcd fcd.xml --net run.net.xml -o drives.parquet")
    formats.command("fcd", short_help="SUMO's FCD output.", epilog=fcd_example)(fcd)
    commonroad_example = examples("import commonroad DEU_A9-1_1_T-1.xml -o drives.parquet")
    formats.command("commonroad", short_help="CommonRoad scenarios.", epilog=commonroad_example)(commonroad)
    osi_example = examples(
        "import osi cut-in_gt.mcap -o drives.parquet", "import osi a.mcap b.mcap --host host -o ego.csv"
    )
    formats.command("osi", short_help="ASAM OSI traces.", epilog=osi_example)(osi)
    table_example = examples("import table --propose monday.csv > company.toml") + examples(
        "import table *.csv --mapping company.toml -o drives.parquet"
    )
    formats.command("table", short_help="Tables of drives under other names.", epilog=table_example)(table)
    app.add_typer(formats, name="import", short_help="Convert recordings into drive tables.", no_args_is_help=True)


def dlr_ht(
    source: Source,
    output: Output,
    max_gap: Annotated[
        float, typer.Option(help="Longest gap between two cameras that is kept [s].", min=0, max=60)
    ] = 1.0,
    keep_cut: KeepCut = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """DLR Highway Traffic: the wheel of tasi 0.15.4, the data set's zip, or its trajectory CSV."""
    from xosc_lateral.formats.importers.cuts import CutSettings

    settings = {"settings": CutSettings(max_gap=max_gap), "keep_cut": keep_cut}
    _import("dlr-ht", [source], output, settings, force, quiet, as_json)


def levelx(
    source: Source,
    output: Output,
    keep_cut: KeepCut = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Recordings of highD or exiD: a folder, or one XX_tracks.csv with its two meta files beside it."""
    _import("levelx", [source], output, {"keep_cut": keep_cut}, force, quiet, as_json)


def table(
    sources: Annotated[list[Path], typer.Argument(metavar="TABLE...", help="Tables of drives.", show_default=False)],
    output: Annotated[str, typer.Option("--output", "-o", metavar="TABLE", help="Drive table, or - .")] = "-",
    mapping_file: MappingFile = None,
    columns: Columns = None,
    propose: Annotated[
        bool, typer.Option("--propose", help="Write the first version of a mapping of these tables, with comments.")
    ] = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Tables of drives under a company's own names, units and words, by a saved mapping."""
    if not propose:
        _import("table", sources, output, {"mapping": mapped(columns, mapping_file)}, force, quiet, as_json)
        return
    from xosc_lateral.formats.atomic import write_atomically
    from xosc_lateral.formats.importers.foreign_table import propose_mapping
    from xosc_lateral.formats.output_paths import STDOUT, claim, output_file

    text = propose_mapping(sources)
    if output == STDOUT:
        write_stdout(text)
        return
    path = output_file(output, "mapping.toml", (".toml",))
    claim([path], sources, force=force)
    write_atomically(path, text)


def mf4(
    sources: Annotated[
        list[Path], typer.Argument(metavar="SOURCE...", help="Logs; each is a drive of its own.", show_default=False)
    ],
    output: Output,
    channels: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="NAME=CHANNEL[:UNIT]",
            help="Channel of a column, e.g. speed=v_veh:km/h; default unit: the file's.",
        ),
    ] = None,
    mapping_file: MappingFile = None,
    step: Annotated[
        float, typer.Option(help="Time step of the table, to which channels are interpolated [s].", min=0.001, max=1)
    ] = 0.04,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """ASAM MDF bus logs (extra `mdf`). They need a channel map, since signal names differ from car to car."""
    from xosc_lateral.formats.importers.mf4 import channels_wanted

    if not channels and mapping_file is None:
        raise typer.BadParameter(channels_wanted(sources[0]), param_hint="--map")
    _import(
        "mf4",
        sources,
        output,
        {"channels": channels or (), "step": step, "mapping": mapping_file},
        force,
        quiet,
        as_json,
    )


def tracks(
    source: Source,
    output: Output,
    road: Annotated[Path, typer.Option("--road", metavar="FILE.xodr", help="Road on which the tracks lie.")],
    columns: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            metavar="NAME=COLUMN[:UNIT]",
            help="vehicle, time, x, y, heading, speed, length, vehicle_class, e.g. heading=psi:deg.",
        ),
    ] = None,
    mapping_file: MappingFile = None,
    keep_cut: KeepCut = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """A table of tracks (x, y and heading of any recording) on a known road: lanes, offsets, neighbours."""
    options = {"road": road, "columns": columns or (), "mapping": mapping_file, "keep_cut": keep_cut}
    _import("tracks", [source], output, options, force, quiet, as_json)


def fcd(
    source: Annotated[Path, typer.Argument(help="What --fcd-output wrote (.xml).", show_default=False)],
    output: Output,
    net: Annotated[Path | None, typer.Option(help="Road network (.net.xml): widths and counts of lanes.")] = None,
    lane_width: Annotated[float, typer.Option(help="Without a network. [m]", min=1, max=10)] = 3.2,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """SUMO's FCD output of a run with the sublane model: a drive for every vehicle."""
    _import("fcd", [source], output, {"net": net, "lane_width": lane_width}, force, quiet, as_json)


def commonroad(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...", help="Scenarios (.xml).", show_default=False)],
    output: Output,
    keep_cut: KeepCut = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """CommonRoad scenarios (extra `commonroad`): recorded obstacles between the bounds of their lanelets."""
    _import("commonroad", sources, output, {"keep_cut": keep_cut}, force, quiet, as_json)


def osi(
    sources: Annotated[
        list[Path], typer.Argument(metavar="TRACE...", help="Traces (.mcap, .osi).", show_default=False)
    ],
    output: Output,
    host: Annotated[
        str | None,
        typer.Option("--host", metavar="ID", help="Keep this vehicle alone: its id or name; host: the host vehicle."),
    ] = None,
    road: Annotated[
        Path | None, typer.Option("--road", metavar="FILE.xodr", help="Take lanes from here, not from the trace.")
    ] = None,
    channel: Annotated[str | None, typer.Option("--channel", metavar="TOPIC", help="Of an MCAP file.")] = None,
    keep_cut: KeepCut = False,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """ASAM OSI traces of ground truth or sensor views (extra `osi`): vehicles between the boundaries of their lanes."""
    options = {"host": host, "road": road, "channel": channel, "keep_cut": keep_cut}
    _import("osi", sources, output, options, force, quiet, as_json)


def _import(
    name: str,
    sources: Sequence[Path],
    output: str,
    options: dict[str, Any],
    force: bool,
    quiet: bool,
    as_json: bool,
) -> None:
    from xosc_lateral import import_drives
    from xosc_lateral.formats.output_paths import STDOUT, claim, output_file
    from xosc_lateral.formats.output_tables import harmless_frame, output_suffixes

    if output != STDOUT:
        files = [source for source in sources if source.is_file()]
        claim([output_file(output, "drives.parquet", output_suffixes())], files, force=force)
    imported = import_drives(name, sources[0] if len(sources) == 1 else sources, **options)
    written = None
    if output == STDOUT:
        write_stdout(harmless_frame(imported.to_frame()).to_csv(index=False, lineterminator="\n"))
    else:
        written = imported.write(output, force=force)
    if as_json and written is not None:
        say_json({"output": str(written), **imported.to_dict()})
    elif not quiet:
        typer.echo(str(imported), err=True)


class _WithPlugins(TyperGroup):
    """Formats with options of their own, then others, of the package or of plug-ins, with ``--set KEY=VALUE``."""

    def list_commands(self, ctx: Any) -> list[str]:
        own = super().list_commands(ctx)
        return [*own, *(name for name in _formats() if name not in own)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        known = super().get_command(ctx, cmd_name)
        return _plain_command(cmd_name) if known is None and cmd_name in _formats() else known


def _formats() -> list[str]:
    from xosc_lateral.formats.importers import GROUP, IMPORTERS
    from xosc_lateral.plugins import plugin_names

    return [*IMPORTERS, *plugin_names(GROUP)]


def _plain_command(name: str) -> Any:
    from xosc_lateral.formats.importers import find_importer

    one = typer.Typer(context_settings={"help_option_names": ["-h", "--help"]}, rich_markup_mode=None)

    def command(
        sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...", show_default=False)],
        output: Output,
        settings: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE")] = None,
        force: Force = False,
        quiet: Quiet = False,
        as_json: AsJson = False,
    ) -> None:
        _import(name, sources, output, dict(pairs(settings, "--set")), force, quiet, as_json)

    help_text = (find_importer(name).__doc__ or "Another format.").strip()
    one.command(name, help=help_text, short_help=help_text.splitlines()[0])(command)
    return typer.main.get_command(one)
