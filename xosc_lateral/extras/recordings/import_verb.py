"""`xosc-lateral import`: other people's recordings into the standard drive table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

import xosc_lateral as xl
from xosc_lateral.base.plugins import plugin_names
from xosc_lateral.cli import TYPER_STYLE, VERBS, group_of_verbs
from xosc_lateral.cli.words import Options, Writing, command, pairs, with_options, write_stdout
from xosc_lateral.extras.recordings.importers import GROUP, IMPORTERS, find_importer


@dataclass(frozen=True, slots=True, kw_only=True)
class _Table(Writing):
    """Options of all formats: the table to write."""

    output: Annotated[
        str, typer.Option("--output", "-o", metavar="TABLE", help="Drive table: .parquet, .csv, .csv.gz, folder/, - .")
    ]

    def fill(self, name: str, sources: Path | Sequence[Path], **options: Any) -> None:
        """Read recordings of a format, write them as a table, and say what they are."""
        files = [sources] if isinstance(sources, Path) else sources
        (table,) = self.claim(files, table=(self.output, "drives.parquet"))
        imported = xl.import_drives(name, sources, **options)
        if table is None:
            write_stdout(imported.csv())
            self.say_words(str(imported), None)
        else:
            written = imported.write(self.output, force=self.force)
            self.say_words(str(imported), {"output": str(written), **imported.to_dict()})


class _WithPlugins(TyperGroup):
    """Formats with options of their own, then others, of the package or of plug-ins, with ``--set KEY=VALUE``."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(dict.fromkeys([*super().list_commands(ctx), *IMPORTERS, *plugin_names(GROUP)]))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        known = super().get_command(ctx, cmd_name)
        return _plain_command(cmd_name) if known is None and cmd_name in self.list_commands(ctx) else known


def _plain_command(name: str) -> Any:
    formats = typer.Typer(context_settings=TYPER_STYLE["context_settings"], rich_markup_mode=None)

    def run(
        sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...", show_default=False)],
        *,
        settings: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE")] = None,
        table: _Table,
    ) -> None:
        table.fill(name, sources, **pairs(settings, "--set"))

    help_text = (find_importer(name).__doc__ or "Another format.").strip()
    formats.command(name, help=help_text, short_help=help_text.splitlines()[0])(with_options(run))
    return typer.main.get_command(formats)


# What is said of one option stays together.
# fmt: off
app = group_of_verbs()
group = typer.Typer(cls=_WithPlugins, help="Convert recordings in other formats into the standard drive table.")
app.add_typer(group, name="import", short_help=VERBS["import"], no_args_is_help=True)


def _add(
    name: str, short: str, *examples: str, sources: str = "File or folder to read.", metavar: str = "SOURCE",
) -> None:
    """Add a format with the options of its importer, and its first paragraph as help; `metavar`: of the sources."""
    importer = find_importer(name)
    kind: Any = list[Path] if metavar.endswith("...") else Path

    def run(sources: Any, *, options: Options, table: _Table) -> None:
        if name == "mf4" and not options["columns"].columns:
            from xosc_lateral.extras.recordings.importers.mf4 import channels_wanted

            raise typer.BadParameter(channels_wanted(sources[0]), param_hint="--map")
        table.fill(name, sources, **options)

    run.__doc__ = str(importer.__doc__).partition("\n\n")[0]
    argument = typer.Argument(metavar=metavar, help=sources, show_default=False)
    annotations = {"sources": Annotated[kind, argument], "options": Annotated[Options, importer], "table": _Table}
    run.__annotations__ = annotations
    command(group, name, short, *examples)(run)


_add("dlr-ht", "DLR Highway Traffic.", "import dlr-ht tasi-0.15.4-py3-none-any.whl -o drives.parquet")
_add("dlr-ut", "DLR Urban Traffic.", "import dlr-ut tasi-0.15.4-py3-none-any.whl -o city.parquet")
_add("levelx", "highD and exiD.", "import levelx highD/ -o highd.parquet")
_add(
    "mf4", "ASAM MDF bus logs.",
    "import mf4 log.mf4 -o drive.parquet --map offset=Lane_Lat --map lane_width=Lane_Width",
    sources="Logs; each is a drive of its own.", metavar="SOURCE...",
)
_add(
    "tracks", "Tracks on an OpenDRIVE road.",
    "import tracks tracks.csv --road road.xodr -o drives.parquet --map vehicle=obj",
)
_add(
    "fcd", "SUMO's FCD output.", "import fcd fcd.xml --net run.net.xml -o drives.parquet",
    sources="What --fcd-output wrote (.xml).",
)
_add(
    "openacc", "OpenACC, AstaZero campaign.",
    "import openacc ASta_040719_platoon3.csv ASta_050719_platoon1.csv -o drives.parquet",
    sources="Files of one track (.csv, .csv.gz).", metavar="FILE...",
)
_add(
    "commonroad", "CommonRoad scenarios.", "import commonroad DEU_A9-1_1_T-1.xml -o drives.parquet",
    sources="Scenarios (.xml).", metavar="SOURCE...",
)
_add(
    "osi", "ASAM OSI traces.",
    "import osi cut-in_gt.mcap -o drives.parquet", "import osi a.mcap b.mcap --host host -o ego.csv",
    sources="Traces (.mcap, .osi).", metavar="TRACE...",
)
_add(
    "table", "Tables of drives under other names.",
    "import table *.csv --mapping company.toml -o drives.parquet",
    sources="Tables of drives.", metavar="TABLE...",
)
