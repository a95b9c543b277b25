"""Work in processes of our own that end where it exceeds its limits: nothing else goes with them.

A call goes through a pipe, and so does its answer. Who asked kills a process that does not answer in time; the system
refuses it more memory than it may have. It ends with who started it: at once on Linux, else when it has answered.
"""

from __future__ import annotations

import ctypes
import os
import pickle
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import MappingProxyType
from typing import IO, Any, cast

from xosc_lateral.base.signals import ENDING


# ---- memory that this process has and may have ----
def status_bytes(column: int) -> int:
    """Memory by a column of /proc/self/statm (0: all, 1: resident); 0: the system does not say. [byte]"""
    if not sys.platform.startswith("linux"):
        return 0
    return int(Path("/proc/self/statm").read_bytes().split()[column]) * os.sysconf("SC_PAGE_SIZE")


def free_bytes() -> float:
    """What this process can still take of the machine, its container and its own limit; infinite: not known. [byte]"""
    if not sys.platform.startswith("linux"):
        return float("inf")
    import resource

    free = [_of_machine(), _of_container()]
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit != resource.RLIM_INFINITY:
        free.append(limit - status_bytes(0))
    return min(free)


def _of_machine() -> float:
    available = (line.split()[1] for line in _lines("/proc/meminfo") if line.startswith("MemAvailable:"))
    return 1024.0 * float(next(available, "inf"))


def _of_container() -> float:
    """By the second version of Linux's control groups, as containers and batch systems set it."""
    group = next((line[3:].strip() for line in _lines("/proc/self/cgroup") if line.startswith("0::")), None)
    if group is None:
        return float("inf")
    free, folder = float("inf"), Path("/sys/fs/cgroup", group.lstrip("/"))
    for place in (folder, *folder.parents):
        limit, used = (_lines(place / name)[:1] for name in ("memory.max", "memory.current"))
        if limit and used and limit[0].strip() != "max":
            free = min(free, float(limit[0]) - float(used[0]))
        if place == Path("/sys/fs/cgroup"):
            break
    return free


def _lines(path: str | Path) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []


@contextmanager
def address_space(megabytes: float) -> Iterator[None]:
    """Let this process map so much more memory; without effect where the system has no such limit, or in a thread."""
    size = status_bytes(0)
    if size == 0 or threading.current_thread() is not threading.main_thread():
        yield
        return
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    allowed = size + int(1e6 * megabytes)
    if hard != resource.RLIM_INFINITY:
        allowed = min(allowed, hard)
    resource.setrlimit(resource.RLIMIT_AS, (allowed, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


# ---- processes with limits ----
MUCH_MEMORY = 1e9
"""A process that has held so much more than at its start is not used again. [byte]"""

PR_SET_PDEATHSIG = 1
"""Of Linux's prctl(2), from <linux/prctl.h>: the signal that this process gets when its parent ends."""


class ProcessEndedError(Exception):
    """It ended before it answered; `late`: it was killed when its time was over."""

    def __init__(self, late: bool) -> None:
        super().__init__(late)
        self.late = late


def cores() -> int:
    """Processors that this process may use, by its affinity and by its container's share."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    with suppress(OSError, ValueError):  # "max": no limit
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text().split()
        count = min(count, max(1, round(int(quota) / int(period))))
    return count


class Processes:
    """Processes of one kind, started as they are needed and used again; threads may call beside each other.

    `entry`: "module:function" that serves there, `serve` at the end; `environment`: variables beside those of here.
    """

    def __init__(self, entry: str, environment: Mapping[str, str] = MappingProxyType({})) -> None:
        self._entry, self._environment = entry.split(":"), environment
        self._idle: list[subprocess.Popen[bytes]] = []
        self._busy: set[subprocess.Popen[bytes]] = set()
        self._over = False
        if hasattr(os, "register_at_fork"):
            os.register_at_fork(after_in_child=self._idle.clear)  # they serve the parent

    def call(self, work: Callable[..., Any], *arguments: Any, seconds: float, megabytes: float) -> Any:
        """What `work` gives there, or raises; `ProcessEndedError`: nothing came. All of it has to be picklable."""
        if self._over:
            raise ProcessEndedError(late=False)
        process = self._ready()
        self._busy.add(process)
        requests, answers = cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout)
        timer, goes_on = threading.Timer(seconds, process.kill), False
        timer.start()
        try:
            pickle.dump((str(Path.cwd()), megabytes, work, arguments), requests, protocol=5)
            requests.flush()
            made, error, goes_on = pickle.load(answers)
        except (EOFError, OSError, pickle.UnpicklingError) as broken:
            raise ProcessEndedError(late=timer.finished.is_set()) from broken  # it has gone off: nobody cancelled it
        finally:
            timer.cancel()
            self._busy.discard(process)
            if goes_on:
                self._idle.append(process)
            else:
                _end(process)
        if error is not None:
            raise error
        return made

    def end(self) -> None:
        """Kill them all; who waits for an answer, or asks later, gets none."""
        self._over = True
        for process in [*self._busy]:
            process.kill()
        while self._idle:
            _end(self._idle.pop())

    def _ready(self) -> subprocess.Popen[bytes]:
        """One that waits and lives (somebody may have ended it meanwhile), or a new one."""
        while self._idle:
            process = self._idle.pop()
            if process.poll() is None:
                return process
            _end(process)
        paths = [path for path in sys.path if path]  # not the working folder, which may be anybody's
        module, name = self._entry
        code = f"import sys; sys.path[:] = {paths!r}; from {module} import {name}; {name}()"
        return subprocess.Popen(
            [sys.executable, "-P", "-c", code],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **self._environment},
            start_new_session=True,  # a terminal sends its signals to a session: who started them decides
        )


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    for pipe in (process.stdin, process.stdout):
        with suppress(OSError):  # it is gone, and did not take all
            cast(IO[bytes], pipe).close()
    process.wait()


def serve() -> None:
    """Answer calls until nobody asks any more; what libraries print goes to standard error."""
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    begin = status_bytes(1)
    while True:
        try:
            folder, megabytes, work, arguments = pickle.load(requests)
        except EOFError:
            return
        os.chdir(folder)
        made: Any = None
        error: Exception | None = None
        try:
            with address_space(megabytes):
                made = work(*arguments)
        except Exception as raised:
            error = raised
        pickle.dump((made, error, status_bytes(1) - begin < MUCH_MEMORY), answers, protocol=5)
        answers.flush()
