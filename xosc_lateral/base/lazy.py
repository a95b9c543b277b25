"""Heavy packages, imported when something of them is first used: pandas takes half a second, numba one."""

from __future__ import annotations

import os
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar, cast

__all__ = ["interpolate", "njit", "pa", "parquet", "pd", "spatial"]


class _Lazy:
    def __init__(self, name: str) -> None:
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(import_module(self._name), attribute)


if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    from pyarrow import parquet
    from scipy import interpolate, spatial
else:
    pd, pa, parquet, interpolate, spatial = map(
        _Lazy, ("pandas", "pyarrow", "pyarrow.parquet", "scipy.interpolate", "scipy.spatial")
    )

Body = TypeVar("Body", bound=Callable[..., Any])


def njit(body: Body) -> Body:
    """Compile a loop with numba, without its lock.

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
