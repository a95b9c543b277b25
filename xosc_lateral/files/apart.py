"""Readers that hand a file to other people's compiled code run in a process of their own, within limits.

What a library does there (crashes, takes memory without end, never returns) ends in one line that names the file; it
starts no program, connects to nowhere, and finds no package that turns texts into code.
"""

from __future__ import annotations

import atexit
import sys
from collections.abc import Callable
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from xosc_lateral.base import process
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.limits import (
    PACKING_RATIO,
    PARSER_MEMORY,
    PARSER_TIME,
    PARSER_TIME_PER_SIZE,
    SMALL_PARSER_MEMORY,
)
from xosc_lateral.files import source
from xosc_lateral.files.held import Held, held_at, hold_again

REFUSED_MODULES = ("sympy",)
"""Packages that make code of texts; asammdf hands formulas to it where it is installed."""

REFUSED_EVENTS = ("os.system", "os.exec", "os.posix_spawn", "os.fork", "subprocess.Popen", "socket.connect")
"""Of Python's audit: what no reader of a file does."""

P = ParamSpec("P")
Made = TypeVar("Made")

_readers = process.Processes("xosc_lateral.files.apart:serve")
atexit.register(_readers.end)
_serves = False


def apart(read: Callable[P, Made]) -> Callable[P, Made]:
    """Let a function of a module, whose first argument is the file's path, run there; it gives what can be pickled.

    Raises what it raises; `FormatError`: it took too much time or memory, or the process broke down.
    """

    @wraps(read)
    def call(*args: P.args, **keywords: P.kwargs) -> Made:
        if _serves:
            return read(*args, **keywords)
        path = Path(str(args[0]))
        megabytes = source.check_regular(path).st_size / 1e6
        seconds = PARSER_TIME.value + PARSER_TIME_PER_SIZE.value * megabytes
        memory = min(PARSER_MEMORY.value, SMALL_PARSER_MEMORY.value + PACKING_RATIO.value * megabytes)
        named = (read.__module__, read.__qualname__, args, keywords, held_at(path))
        try:
            made, parsed = _readers.call(_read, *named, seconds=seconds, megabytes=memory + 3.0 * megabytes)
        except MemoryError as error:
            raise FormatError(PARSER_MEMORY.refusal(memory), path=path) from error
        except process.ProcessEndedError as ended:
            why = f"took longer than {seconds:.0f} s" if ended.late else "the library that reads it broke down"
            raise FormatError(f"can't be read: {why}; it is damaged, or made for that", path=path) from ended
        for name, digest in parsed.items():
            source.take_over(Path(name), digest)
        return made  # type: ignore[no-any-return]

    return call


def _read(
    module: str, name: str, args: tuple[Any, ...], keywords: dict[str, Any], held: Held | None
) -> tuple[Any, dict[Any, str]]:
    """What a function gives there, and the files that it parsed, with their hashes; `held`: files in memory."""
    before, _held = dict(source.parsed_files()), held and hold_again(held)
    made = getattr(import_module(module), name)(*args, **keywords)
    return made, {path: digest for path, digest in source.parsed_files().items() if before.get(path) != digest}


def serve() -> None:
    """Read files for who asks; nothing that is imported meanwhile may run a program."""
    global _serves
    _serves = True
    sys.modules.update(dict.fromkeys(REFUSED_MODULES))  # type: ignore[arg-type]  # None: there is none
    sys.addaudithook(_refuse)
    process.serve()


def _refuse(event: str, _: object) -> None:
    if event in REFUSED_EVENTS:
        raise PermissionError(f"{event}: readers of files may not")
