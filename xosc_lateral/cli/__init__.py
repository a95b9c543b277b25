"""The command line: one verb per file; this module only gathers them and turns errors into exit codes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any, cast

import typer

from xosc_lateral import __version__
from xosc_lateral.errors import XoscLateralError

app = typer.Typer(
    name="xosc-lateral",
    help="Lifelike lateral movement for OpenSCENARIO traffic.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,  # units in help texts are in brackets, which rich would take for markup
)

# One module per verb, named like it; each has `register(app)`. They import nothing heavy at the top.
VERBS = ("convert", "play", "segments", "import_", "fit", "sample", "evaluate", "close_loop", "profiles", "template")

for _verb in VERBS:
    import_module(f"xosc_lateral.cli.{_verb}").register(app)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"xosc-lateral {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Lifelike lateral movement for OpenSCENARIO traffic."""


def _in_words(error: XoscLateralError | OSError) -> str:
    """What went wrong; the system's errors in the form of ours, file first and without their number."""
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror[0].lower()}{error.strerror[1:]}"
    return str(error)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; 0 done, 1 the input is at fault (one line on stderr), 2 wrong usage."""
    try:
        code = app(args=None if argv is None else list(argv), standalone_mode=False)
    except (XoscLateralError, OSError) as error:
        print(f"xosc-lateral: {' '.join(_in_words(error).split())}", file=sys.stderr)
        code = 1
    except typer.Abort:
        code = 130
    except Exception as error:
        # Typer's usage errors come from a click that is vendored in some of its releases: told by their duck shape.
        if not hasattr(error, "exit_code") or not hasattr(error, "format_message"):
            raise
        usage = cast(Any, error)
        usage.show()
        code = usage.exit_code
    if argv is None:
        sys.exit(code)
    return int(code or 0)
