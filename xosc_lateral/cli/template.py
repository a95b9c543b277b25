"""`xosc-lateral template`: maneuver-based scenarios to start from."""

from __future__ import annotations

from typing import Annotated

import typer

from xosc_lateral.cli import VERBS, group_of_verbs
from xosc_lateral.cli.words import Printing, Written, command, pairs

app = group_of_verbs()
group = typer.Typer(help="Maneuver-based motorway scenarios to start from.", no_args_is_help=True)
app.add_typer(group, name="template", short_help=VERBS["template"])


@command(group, "list", "Templates, or one template's settings.", "template list cut-in")
def list_(
    name: Annotated[str | None, typer.Argument(help="Show this template's settings.", show_default=False)] = None,
    *,
    said: Printing,
) -> None:
    """List the templates, or one template's settings with units, defaults and ranges."""
    from xosc_lateral import list_templates

    said.say(list_templates(name))


@command(group, "write", "Write a scenario and its road.", "template write cut-in -o out/ --set ego_speed=28")
def write(
    name: Annotated[str, typer.Argument(help="Template; `template list` names them.", show_default=False)],
    *,
    output: Annotated[str, typer.Option("--output", "--out", "-o", help="Folder to write to.", show_default=False)],
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a setting; may be repeated.")
    ] = None,
    said: Written,
) -> None:
    """Write a template's scenario and its road."""
    from xosc_lateral import write_template

    chosen: dict[str, str] = pairs(settings, "--set")
    written = write_template(name, output, force=said.force, **chosen)
    said.say_written(written, template=name, settings=chosen)
