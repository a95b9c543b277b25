"""Memory that this process has and may have."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


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
