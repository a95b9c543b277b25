"""Compiled loops with their cache on disk, where there is a folder for it."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any, TypeVar, cast

Body = TypeVar("Body", bound=Callable[..., Any])


def njit(body: Body) -> Body:
    """Compile with numba, without its lock.

    The compiled code is kept beside the module or in the user's cache. Who has neither (a read-only installation, a
    service without a home) compiles once per process: numba itself would refuse.
    """
    # A `.numba_config.yaml` in the working folder, which may be anybody's, must not say where compiled code lies.
    for name in ("NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"):
        os.environ.setdefault(name, "")
    import numba

    try:
        compiled = numba.njit(cache=True, nogil=True)(body)
    except RuntimeError:
        compiled = numba.njit(nogil=True)(body)
    return cast(Body, compiled)
