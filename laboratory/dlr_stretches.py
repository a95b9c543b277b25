"""The DLR recording row by row: where every vehicle is along the road, and its stretches of road-following."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from xosc_lateral.extras.recordings.importers.dlr_ht import (
    STEP,
    fit_reference_line,
    import_dlr_ht,
    read_tracks,
    travels_north,
)


def along_road(tracks: pd.DataFrame) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """Carriageway of each row, and its place along the reference line and aside from it [m], shape (n,) each."""
    north = travels_north(tracks)
    _, place, aside = fit_reference_line(tracks[["center_easting", "center_northing"]].to_numpy(), north)
    return north, place, aside


@dataclass(frozen=True, eq=False)
class Recording:
    """Rows of all tracks at 20 Hz.

    Parameters
    ----------
    table : DataFrame
        As imported, with what is cut.
    vehicle : array, shape (n,)
    north : bool array, shape (n,)
        Carriageway.
    place : array, shape (n,)
        Along the road, the same way for both carriageways. [m]
    """

    table: pd.DataFrame
    vehicle: NDArray[np.int64]
    north: NDArray[np.bool_]
    place: NDArray[np.float64]

    @classmethod
    def read(cls, source: Path) -> Recording:
        """From the data set's wheel, zip or table."""
        tracks = read_tracks(source)
        north, place, _ = along_road(tracks)
        table = import_dlr_ht(source, keep_cut=True).table
        assert len(table) == len(tracks), "with keep_cut, no row is dropped"
        return cls(table, tracks["vehicle"].to_numpy(), north, place)

    def stretches(self, least: float) -> Iterator[slice]:
        """Rows of each stretch of road-following that lasts so long. [s]"""
        kept = (self.table["state"] == "kept").to_numpy()
        edges = np.flatnonzero(np.diff(kept) | (np.diff(self.vehicle) != 0)) + 1
        for first, last in pairwise([0, *edges.tolist(), len(kept)]):
            if kept[first] and (last - first) * STEP >= least:
                yield slice(first, last)
