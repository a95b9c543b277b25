"""`xosc-lateral import`: other people's recordings into the standard drive table."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from xosc_lateral.cli import TYPER_STYLE, VERBS, group_of_verbs
from xosc_lateral.cli.words import Mapped, MappingFile, Written, command, pairs, with_options, write_stdout

Source = Annotated[Path, typer.Argument(metavar="SOURCE", help="File or folder to read.", show_default=False)]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Table(Written):
    """Options of all formats: the table to write."""

    output: Annotated[
        str, typer.Option("--output", "-o", metavar="TABLE", help="Drive table: .parquet, .csv, .csv.gz, folder/, - .")
    ]

    def fill(self, name: str, *sources: Path, **options: Any) -> None:
        """Read recordings of a format, write them as a table, and say what they are."""
        from xosc_lateral import import_drives
        from xosc_lateral.files.output_paths import STDOUT, claim, output_file
        from xosc_lateral.files.output_tables import harmless_frame, output_suffixes

        if self.output != STDOUT:
            files = [source for source in sources if source.is_file()]
            claim([output_file(self.output, "drives.parquet", output_suffixes())], files, force=self.force)
        imported = import_drives(name, sources[0] if len(sources) == 1 else sources, **options)
        if self.output == STDOUT:
            write_stdout(harmless_frame(imported.to_frame()).to_csv(index=False, lineterminator="\n"))
            self.say_words(str(imported), None)
        else:
            written = imported.write(self.output, force=self.force)
            self.say_words(str(imported), {"output": str(written), **imported.to_dict()})


@dataclass(frozen=True, slots=True, kw_only=True)
class _CutTable(_Table):
    """The same of formats from which lane changes and the like are cut."""

    keep_cut: Annotated[
        bool, typer.Option("--keep-cut", help="Keep rows that would be cut; the column `state` gives the reason.")
    ] = False


class _WithPlugins(TyperGroup):
    """Formats with options of their own, then others, of the package or of plug-ins, with ``--set KEY=VALUE``."""

    def list_commands(self, ctx: Any) -> list[str]:
        names = super().list_commands(ctx)
        return [*names, *(name for name in _formats() if name not in names)]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        known = super().get_command(ctx, cmd_name)
        return _plain_command(cmd_name) if known is None and cmd_name in _formats() else known


def _formats() -> list[str]:
    from xosc_lateral.base.plugins import plugin_names
    from xosc_lateral.workflows.recordings.importers import GROUP, IMPORTERS

    return [*IMPORTERS, *plugin_names(GROUP)]


def _plain_command(name: str) -> Any:
    from xosc_lateral.workflows.recordings.importers import find_importer

    formats = typer.Typer(context_settings=TYPER_STYLE["context_settings"], rich_markup_mode=None)

    def run(
        sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...", show_default=False)],
        *,
        settings: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE")] = None,
        table: _Table,
    ) -> None:
        table.fill(name, *sources, **pairs(settings, "--set"))

    help_text = (find_importer(name).__doc__ or "Another format.").strip()
    formats.command(name, help=help_text, short_help=help_text.splitlines()[0])(with_options(run))
    return typer.main.get_command(formats)


# What is said of one option stays together.
# fmt: off
app = group_of_verbs()
group = typer.Typer(cls=_WithPlugins, help="Convert recordings in other formats into the standard drive table.")
app.add_typer(group, name="import", short_help=VERBS["import"], no_args_is_help=True)


@command(group, "dlr-ht", "DLR Highway Traffic.", "import dlr-ht tasi-0.15.4-py3-none-any.whl -o drives.parquet")
def dlr_ht(
    source: Source, *,
    max_gap: Annotated[float, typer.Option(help="Longest gap between two cameras that is kept [s].", min=0,
        max=60)] = 1.0,
    table: _CutTable,
) -> None:
    """DLR Highway Traffic: the wheel of tasi 0.15.4, the data set's zip, or its trajectory CSV."""
    from xosc_lateral.workflows.recordings.cuts import CutSettings

    table.fill("dlr-ht", source, settings=CutSettings(max_gap=max_gap), keep_cut=table.keep_cut)


@command(group, "levelx", "highD and exiD.", "import levelx highD/ -o highd.parquet")
def levelx(source: Source, *, table: _CutTable) -> None:
    """Recordings of highD or exiD: a folder, or one XX_tracks.csv with its two meta files beside it."""
    table.fill("levelx", source, keep_cut=table.keep_cut)


@command(
    group, "mf4", "ASAM MDF bus logs.",
    "import mf4 log.mf4 -o drive.parquet --map offset=Lane_Lat --map lane_width=Lane_Width",
)
def mf4(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...", help="Logs; each is a drive of its own.",
        show_default=False)],
    *,
    channels: Annotated[list[str] | None, typer.Option("--map", metavar="NAME=CHANNEL[:UNIT]",
        help="Channel of a column, e.g. speed=v_veh:km/h; default unit: the file's.")] = None,
    mapping_file: MappingFile = None,
    step: Annotated[float, typer.Option(help="Time step of the table, to which channels are interpolated [s].",
        min=0.001, max=1)] = 0.04,
    table: _Table,
) -> None:
    """ASAM MDF bus logs (extra `mdf`). They need a channel map, since signal names differ from car to car."""
    from xosc_lateral.workflows.recordings.importers.mf4 import channels_wanted

    if not channels and mapping_file is None:
        raise typer.BadParameter(channels_wanted(sources[0]), param_hint="--map")
    table.fill("mf4", *sources, channels=channels or (), step=step, mapping=mapping_file)


@command(
    group, "tracks", "Tracks on an OpenDRIVE road.",
    "import tracks tracks.csv --road road.xodr -o drives.parquet --map vehicle=obj",
)
def tracks(
    source: Source, *,
    road: Annotated[Path, typer.Option("--road", metavar="FILE.xodr", help="Road on which the tracks lie.")],
    columns: Annotated[list[str] | None, typer.Option("--map", metavar="NAME=COLUMN[:UNIT]",
        help="vehicle, time, x, y, heading, speed, length, vehicle_class, e.g. heading=psi:deg.")] = None,
    mapping_file: MappingFile = None, table: _CutTable,
) -> None:
    """A table of tracks (x, y and heading of any recording) on a known road: lanes, offsets, neighbours."""
    table.fill("tracks", source, road=road, columns=columns or (), mapping=mapping_file, keep_cut=table.keep_cut)


@command(group, "fcd", "SUMO's FCD output.", "import fcd fcd.xml --net run.net.xml -o drives.parquet")
def fcd(
    source: Annotated[Path, typer.Argument(help="What --fcd-output wrote (.xml).", show_default=False)],
    *,
    net: Annotated[Path | None,
        typer.Option(help="Road network (.net.xml): lanes, side of the road, who is on the next edge.")] = None,
    types: Annotated[Path | None, typer.Option(help="File with the vehicle types (.rou.xml): lengths.")] = None,
    lane_width: Annotated[float, typer.Option(help="Without a network. [m]", min=1, max=10)] = 3.2,
    table: _Table,
) -> None:
    """SUMO's FCD output of a run with the sublane model: a drive for every vehicle."""
    table.fill("fcd", source, net=net, types=types, lane_width=lane_width)


@command(
    group, "openacc", "OpenACC, AstaZero campaign.",
    "import openacc ASta_040719_platoon3.csv ASta_050719_platoon1.csv -o drives.parquet",
)
def openacc(
    sources: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Files of one track (.csv, .csv.gz).",
        show_default=False)],
    *,
    lane_width: Annotated[float, typer.Option(help="Of the road, which the files don't give. [m]", min=2, max=6)] = 3.5,
    table: _CutTable,
) -> None:
    """OpenACC's platoons on the closed loop of AstaZero: lane centre from all passes of all files."""
    table.fill("openacc", *sources, lane_width=lane_width, keep_cut=table.keep_cut)


@command(group, "commonroad", "CommonRoad scenarios.", "import commonroad DEU_A9-1_1_T-1.xml -o drives.parquet")
def commonroad(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...", help="Scenarios (.xml).", show_default=False)],
    *, table: _CutTable,
) -> None:
    """CommonRoad scenarios (extra `commonroad`): recorded obstacles between the bounds of their lanelets."""
    table.fill("commonroad", *sources, keep_cut=table.keep_cut)


@command(
    group, "osi", "ASAM OSI traces.",
    "import osi cut-in_gt.mcap -o drives.parquet", "import osi a.mcap b.mcap --host host -o ego.csv",
)
def osi(
    sources: Annotated[list[Path], typer.Argument(metavar="TRACE...", help="Traces (.mcap, .osi).",
        show_default=False)],
    *,
    host: Annotated[str | None, typer.Option("--host", metavar="ID",
        help="Keep this vehicle alone: its id or name; host: the host vehicle.")] = None,
    road: Annotated[Path | None, typer.Option("--road", metavar="FILE.xodr",
        help="Take lanes from here, not from the trace.")] = None,
    channel: Annotated[str | None, typer.Option("--channel", metavar="TOPIC", help="Of an MCAP file.")] = None,
    table: _CutTable,
) -> None:
    """ASAM OSI traces of ground truth or sensor views (extra `osi`): vehicles between the boundaries of their lanes."""
    table.fill("osi", *sources, host=host, road=road, channel=channel, keep_cut=table.keep_cut)


@command(
    group, "table", "Tables of drives under other names.",
    "import table --propose monday.csv > company.toml", "import table *.csv --mapping company.toml -o drives.parquet",
)
def table_(
    sources: Annotated[list[Path], typer.Argument(metavar="TABLE...", help="Tables of drives.", show_default=False)],
    *,
    output: Annotated[str, typer.Option("--output", "-o", metavar="TABLE", help="Drive table, or - .")] = "-",
    mapped: Mapped,
    propose: Annotated[bool, typer.Option("--propose",
        help="Write the first version of a mapping of these tables, with comments.")] = False,
    reply: Written,
) -> None:
    """Tables of drives under a company's own names, units and words, by a saved mapping."""
    if not propose:
        table = _Table(output=output, quiet=reply.quiet, as_json=reply.as_json, force=reply.force)
        table.fill("table", *sources, mapping=mapped.mapping())
        return
    from xosc_lateral.files.atomic import write_atomically
    from xosc_lateral.files.output_paths import STDOUT, claim, output_file
    from xosc_lateral.workflows.recordings.importers.foreign_table import propose_mapping

    text = propose_mapping(sources)
    if output == STDOUT:
        write_stdout(text)
        return
    path = output_file(output, "mapping.toml", (".toml",))
    claim([path], sources, force=reply.force)
    write_atomically(path, text)
