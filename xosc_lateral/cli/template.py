"""`xosc-lateral template`: maneuver-based scenarios to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    group = typer.Typer(help="Maneuver-based motorway scenarios to start from.", no_args_is_help=True)
    group.command("list")(list_templates)
    group.command("write")(write_template)
    app.add_typer(group, name="template")


def list_templates(
    name: Annotated[str | None, typer.Argument(help="Show this template's settings.", show_default=False)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="For machines.")] = False,
) -> None:
    """List the templates, or one template's settings with units, defaults and ranges."""
    from xosc_lateral.report.templates import as_text, to_json
    from xosc_lateral.templates import TEMPLATES, find_template

    chosen = TEMPLATES if name is None else (find_template(name),)
    typer.echo(to_json(chosen) if as_json else as_text(chosen, with_settings=name is not None))


def write_template(
    name: Annotated[str, typer.Argument(help="Template; `template list` names them.", show_default=False)],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder to write to.", show_default=False)],
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a setting; may be repeated.")
    ] = None,
) -> None:
    """Write a template's scenario and its road."""
    from xosc_lateral.formats.atomic import write_atomically
    from xosc_lateral.templates import find_template, read_settings

    for file, text in find_template(name).files(read_settings(settings or [])).items():
        write_atomically(out / file, text)
        typer.echo(out / file)
