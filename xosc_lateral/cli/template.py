"""`xosc-lateral template`: maneuver-based scenarios to start from."""

from __future__ import annotations

from typing import Annotated

import typer

from xosc_lateral.cli.words import AsJson, Force, Quiet, examples, pairs, say, say_json


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    group = typer.Typer(help="Maneuver-based motorway scenarios to start from.", no_args_is_help=True)
    group.command("list", short_help="Templates, or one template's settings.", epilog=examples("template list cut-in"))(
        list_
    )
    write_help = examples("template write cut-in -o out/ --set ego_speed=28")
    group.command("write", short_help="Write a scenario and its road.", epilog=write_help)(write)
    app.add_typer(group, name="template", short_help="Scenarios to start from.")


def list_(
    name: Annotated[str | None, typer.Argument(help="Show this template's settings.", show_default=False)] = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """List the templates, or one template's settings with units, defaults and ranges."""
    from xosc_lateral import list_templates

    say(list_templates(name), as_json=as_json, quiet=quiet)


def write(
    name: Annotated[str, typer.Argument(help="Template; `template list` names them.", show_default=False)],
    output: Annotated[str, typer.Option("--output", "--out", "-o", help="Folder to write to.", show_default=False)],
    settings: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Change a setting; may be repeated.")
    ] = None,
    force: Force = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Write a template's scenario and its road."""
    from xosc_lateral import write_template

    chosen: dict[str, str] = pairs(settings, "--set")
    written = write_template(name, output, force=force, **chosen)
    if as_json:
        say_json({"template": name, "settings": chosen, "outputs": [str(path) for path in written]})
    elif not quiet:
        for path in written:
            typer.echo(path)
