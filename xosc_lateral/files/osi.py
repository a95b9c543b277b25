"""ASAM OSI traces [1]_, out and in, through asam-osi-utilities and osi-python (extra `osi`).

References
----------
.. [1] ASAM OSI (Open Simulation Interface) 3.8, with its trace file formats.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from xosc_lateral.base.errors import XoscLateralError

SUFFIXES = (".mcap", ".osi")  # of traces: several channels and an index; messages one after the other


def osi(module: str) -> Any:
    """A module of `osi3` or `osi_utilities`. Raises `XoscLateralError`: They are not installed."""
    import logging

    try:
        imported = import_module(module)
    except ImportError as error:
        raise XoscLateralError("OSI traces need more packages: pip install 'xosc-lateral[osi]'") from error
    logging.getLogger("osi_utilities").addHandler(logging.NullHandler())  # what it logs, we raise
    return imported


def osi_wanted(trace: Path | None) -> None:
    """Refuse a trace that can't be written, before any work is done; None: none is wanted."""
    if trace is not None:
        osi("osi_utilities")
        osi("osi3.osi_groundtruth_pb2")
