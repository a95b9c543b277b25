"""`xosc-lateral profiles`: the library of driver profiles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Library = Annotated[list[Path] | None, typer.Option(help="Folder with further profiles; may be repeated.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print as JSON.")]
Profile = Annotated[str, typer.Argument(metavar="NAME|PATH", help="Driver profile.")]


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    profiles = typer.Typer(help="Profiles that come with the package, and your own.", no_args_is_help=True)

    @profiles.command("list")
    def list_(library: Library = None, as_json: AsJson = False) -> None:
        """Names, models and sources of all profiles."""
        from xosc_lateral.report.cards import list_text

        typer.echo(list_text(library or [], as_json=as_json))

    @profiles.command("show")
    def show(name: Profile, library: Library = None, as_json: AsJson = False) -> None:
        """One profile's card: what it does, where it comes from, how true it is."""
        from xosc_lateral.formats.profiles import read_profile
        from xosc_lateral.report.cards import card_text

        typer.echo(card_text(read_profile(name, library or []), as_json=as_json))

    @profiles.command("compare")
    def compare(
        one: Profile,
        other: Profile,
        library: Library = None,
        seed: Annotated[int, typer.Option(help="Of the free runs that are compared.", min=0)] = 0,
        as_json: AsJson = False,
    ) -> None:
        """How two profiles differ, metric by metric."""
        from xosc_lateral.formats.profiles import read_profile
        from xosc_lateral.report.cards import compare_text

        first, second = (read_profile(name, library or []) for name in (one, other))
        typer.echo(compare_text(first, second, seed=seed, as_json=as_json))

    app.add_typer(profiles, name="profiles")
