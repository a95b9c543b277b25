"""Readers that hand a file to other people's compiled code run in a process of their own, within limits.

That process is started when the first such file is read, and serves until this one ends or it has taken much memory.
What a library does there (crashes, takes memory without end, never returns) ends in one line that names the file; it
starts no program, connects to nowhere, and finds no package that turns texts into code.
"""

from __future__ import annotations

import atexit
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import IO, Any, ParamSpec, TypeVar, cast

from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.limits import PARSER_MEMORY, PARSER_TIME, PARSER_TIME_PER_SIZE
from xosc_lateral.base.memory import address_space, status_bytes
from xosc_lateral.files import source

REFUSED_MODULES = ("sympy",)
"""Packages that make code of texts; asammdf hands formulas to it where it is installed."""

REFUSED_EVENTS = ("os.system", "os.exec", "os.posix_spawn", "os.fork", "subprocess.Popen", "socket.connect")
"""Of Python's audit: what no reader of a file does."""

MUCH_MEMORY = 1e9
"""A process that has held so much more than at its start is not used again. [byte]"""

P = ParamSpec("P")
Made = TypeVar("Made")

_idle: list[subprocess.Popen[bytes]] = []
_serves = False
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)  # they serve the parent


@atexit.register
def _end_all() -> None:
    while _idle:
        _end(_idle.pop())


def apart(read: Callable[P, Made]) -> Callable[P, Made]:
    """Let a function of a module, whose first argument is the file's path, run there; it gives what can be pickled.

    Raises what it raises; `FormatError`: it took too much time or memory, or the process broke down.
    """

    @wraps(read)
    def call(*args: P.args, **keywords: P.kwargs) -> Made:
        return read(*args, **keywords) if _serves else cast(Made, _asked(read, args, keywords))

    return call


def _asked(read: Callable[..., Any], args: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
    path = Path(args[0])
    size = source.check_regular(path).st_size
    seconds = PARSER_TIME.value + PARSER_TIME_PER_SIZE.value * size / 1e6
    process = _ready()
    requests, answers = cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout)
    timer, goes_on = threading.Timer(seconds, process.kill), False
    timer.start()
    try:
        pickle.dump((read.__module__, read.__qualname__, args, keywords, seconds, size, str(Path.cwd())), requests)
        requests.flush()
        made, error, parsed, goes_on = pickle.load(answers)
    except (EOFError, OSError, pickle.UnpicklingError) as broken:
        late = timer.finished.is_set()  # it has gone off: nobody has cancelled it yet
        why = f"took longer than {seconds:.0f} s" if late else "the library that reads it broke down"
        raise FormatError(f"can't be read: {why}; it is damaged, or made for that", path=path) from broken
    finally:
        timer.cancel()
        if goes_on:
            _idle.append(process)
        else:
            process.kill()
            _end(process)
    for name, digest in parsed.items():
        source.take_over(Path(name), digest)
    if error is not None:
        raise error
    return made


def _ready() -> subprocess.Popen[bytes]:
    """One that waits and lives (somebody may have ended it meanwhile), or a new one."""
    while _idle:
        process = _idle.pop()
        if process.poll() is None:
            return process
        _end(process)
    return _started()


def _started() -> subprocess.Popen[bytes]:
    paths = [path for path in sys.path if path]  # not the working folder, which may be anybody's
    code = f"import sys; sys.path[:] = {paths!r}; from xosc_lateral.files.apart import serve; serve()"
    return subprocess.Popen([sys.executable, "-P", "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE)


def _end(process: subprocess.Popen[bytes]) -> None:
    for pipe in (process.stdin, process.stdout):
        with suppress(OSError):  # it is gone, and did not take all
            cast(IO[bytes], pipe).close()
    process.wait()


def serve() -> None:
    """Read files that the parent asks for, until it is gone; what libraries print goes to standard error."""
    global _serves
    _serves, begin = True, status_bytes(1)
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all: the parent decides
    sys.modules.update(dict.fromkeys(REFUSED_MODULES))  # type: ignore[arg-type]  # None: there is none
    sys.addaudithook(_refuse)
    while True:
        try:
            module, name, args, keywords, seconds, size, folder = pickle.load(requests)
        except EOFError:
            return
        os.chdir(folder)
        if hasattr(signal, "alarm"):
            signal.alarm(int(seconds) + 1)  # ends an orphan
        made: Any = None
        error: Exception | None = None
        before = dict(source.parsed_files())
        try:
            with address_space(PARSER_MEMORY.value + 3e-6 * size):
                made = getattr(import_module(module), name)(*args, **keywords)
        except MemoryError:
            error = FormatError(PARSER_MEMORY.refusal(PARSER_MEMORY.value), path=args[0])
        except Exception as raised:
            error = raised
        if hasattr(signal, "alarm"):
            signal.alarm(0)  # while it waits for the next file, nothing ends it but the parent
        parsed = {path: digest for path, digest in source.parsed_files().items() if before.get(path) != digest}
        goes_on = status_bytes(1) - begin < MUCH_MEMORY
        pickle.dump((made, error, parsed, goes_on), answers, protocol=5)
        answers.flush()


def _refuse(event: str, _: object) -> None:
    if event in REFUSED_EVENTS:
        raise PermissionError(f"{event}: readers of files may not")
