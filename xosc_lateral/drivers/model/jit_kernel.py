"""Loops that run compiled when the work is worth it, and as the same plain Python body when it is not.

Importing numba costs 0.4 s, more than a scenario of a minute needs altogether; a sample of hours needs it. Both ways
run the same operations in the same order, so the numbers are the same to the last bit (no fast-math, no fused
multiply-add).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from xosc_lateral.base.lazy import njit

WORTH_IMPORTING = 50_000
"""Loop steps from which on numba is imported for them: three hours of driving. Who samples that much does so often."""

WORTH_CALLING = 200
"""Loop steps from which on the compiled loop is used when numba is there already."""


def worth_compiling(steps: int) -> bool:
    """Whether a loop of so many steps is faster compiled, the import of numba counted in."""
    return steps >= WORTH_IMPORTING or (steps >= WORTH_CALLING and "numba" in sys.modules)


def prepare(steps: int) -> None:
    """Have numba loaded when so many steps are worth it: for work that is then done in blocks that are not."""
    if worth_compiling(steps):
        import numba  # noqa: F401


class JitKernel:
    """A function over arrays with a plain Python body; call it with the count of its steps first.

    The body indexes its arguments with whole numbers only. It gets lists in plain Python (three times as fast as arrays
    there) and arrays when compiled, and writes its results into its array arguments.
    """

    def __init__(self, body: Callable[..., Any]) -> None:
        self.body = body
        self._compiled: Callable[..., Any] | None = None

    def __call__(self, steps: int, inputs: Sequence[Any], outputs: Sequence[np.ndarray[Any, Any]]) -> Any:
        """Run ``body(*inputs, *outputs)``; its return value is handed through."""
        if worth_compiling(steps):
            return self.compiled()(*inputs, *outputs)
        lists = [output.tolist() for output in outputs]
        result = self.body(*(value.tolist() if isinstance(value, np.ndarray) else value for value in inputs), *lists)
        for output, values in zip(outputs, lists, strict=True):
            output[...] = values
        return result

    def compiled(self) -> Callable[..., Any]:
        """The compiled body; from the cache on disk where there is one."""
        if self._compiled is None:
            self._compiled = njit(self.body)
        return self._compiled
