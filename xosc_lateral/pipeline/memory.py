"""Memory of this process: what it holds, and how much more it may map."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def address_space(megabytes: float) -> Iterator[None]:
    """Let this process map so much more memory; without effect where the system has no such limit, or in a thread."""
    size = _status_bytes(0)
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


def resident() -> int:
    """Memory that this process holds. [byte]; 0 where the system does not say."""
    return _status_bytes(1)


def _status_bytes(column: int) -> int:
    if not sys.platform.startswith("linux"):
        return 0
    return int(Path("/proc/self/statm").read_bytes().split()[column]) * os.sysconf("SC_PAGE_SIZE")
