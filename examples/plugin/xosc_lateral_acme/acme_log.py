"""Logs of the (made-up) ACME recorder: a line each `seconds left_cm right_cm kmh`, separated by blanks."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from xosc_lateral import FormatError


def import_acme_log(source: Path, *, licence: str = "your own recording") -> pd.DataFrame:
    """ACME recorder logs; --set licence=... for the provenance.

    Parameters
    ----------
    source : Path
        The log.
    licence : str
        For the provenance.

    Returns
    -------
    DataFrame
        A drive table, in SI units.

    Raises
    ------
    FormatError
        A line that does not hold four numbers.
    """
    rows = []
    for number, line in enumerate(source.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            time, left, right, speed = map(float, line.split())
        except ValueError:
            raise FormatError(f"{line!r}, expected four numbers", path=source, line=number) from None
        rows.append((time, left / 100.0, right / 100.0, speed / 3.6))
    return pd.DataFrame(rows, columns=["time", "distance_left", "distance_right", "speed"])
