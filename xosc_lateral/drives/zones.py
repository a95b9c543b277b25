"""Zones: the stretches of road or fields of view that a recording is made of, by the names that its table gives them.

A sensor beside the road is not equally good everywhere, and a place is the same for all who pass it. So a zone is no
quantity that a driver responds to: it says whose rows were recorded under the same conditions.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from hashlib import blake2b
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Names = NDArray[np.object_]
"""Texts, each kept once however many rows it is of."""

ZONE = "zone"
"""Column of drive tables, and of the context of what is sampled, where it holds `zone_codes`."""

LENGTH = 100.0
"""Of a zone that an import makes: as short as makes sense while passages last some seconds (docs/design/sensor.md).
[m]"""

CODE_BYTES = 6
"""Of a name's code: whole numbers below 2^48 are exact as float64; two of a thousand names share one in 1 of 600
million tables."""


@lru_cache(maxsize=4096)
def _code(name: str) -> float:
    return float(int.from_bytes(blake2b(name.encode(), digest_size=CODE_BYTES).digest(), "big")) if name else np.nan


def zone_codes(names: Names | Sequence[str]) -> FloatArray:
    """Names as numbers, the same in every table, shape (n,); NaN where a name is empty: not known. [-]"""
    known, place = numbered(names)
    return np.array([_code(name) for name in known], dtype=np.float64)[place]


def numbered(names: Names | Sequence[str]) -> tuple[list[str], NDArray[np.int64]]:
    """The different names, sorted, and which of them each row has, shape (n,)."""
    rows = [*names]
    known = sorted(set(rows))
    number = {name: k for k, name in enumerate(known)}
    return known, np.array([number[name] for name in rows], dtype=np.int64)


def at_zones(codes: FloatArray, names: Sequence[str], values: Sequence[float]) -> FloatArray:
    """The value of the zone of each row, shape (n,); NaN where it is none of these. [unit of the values]"""
    own, order = _in_order(tuple(names))
    if not len(own):
        return np.full(np.shape(codes), np.nan)
    place = np.minimum(np.searchsorted(own, codes), len(own) - 1)
    return np.where(own[place] == codes, np.asarray(values, dtype=np.float64)[order[place]], np.nan)


@lru_cache(maxsize=64)
def _in_order(names: tuple[str, ...]) -> tuple[FloatArray, NDArray[np.intp]]:
    """Codes of the names, rising, and which name each is of."""
    codes = zone_codes(names)
    order = np.argsort(codes)
    return codes[order], order


def zones_along(strand: Names, place: FloatArray) -> NDArray[np.object_]:
    """Names of zones of `LENGTH`, shape (n,), empty where a row is on no strand.

    Parameters
    ----------
    strand : array of str, shape (n,)
        What a zone never goes beyond: a lane of a road. Lanes apart, since each has a centre line of its own, and that
        has its own errors.
    place : array, shape (n,)
        Along it. [m]
    """
    on = strand != ""
    number = np.floor(np.where(on, place, 0.0) / LENGTH).astype(np.int64)
    strands, which = numbered(strand)
    kinds, row = np.unique(np.column_stack([which, number]), axis=0, return_inverse=True)
    names = [f"{strands[one]}, {piece * LENGTH:.0f} m" if strands[one] else "" for one, piece in kinds.tolist()]
    return np.array(names, dtype=np.object_)[row.ravel()]


def passages(names: Names, least: int) -> list[tuple[str, slice]]:
    """Stretches of rows within one zone, of at least so many rows: its name, and the rows. Unknown zones: none."""
    if not len(names):
        return []
    ends = np.flatnonzero(names[1:] != names[:-1]) + 1
    bounds = [0, *ends.tolist(), len(names)]
    parts = [slice(first, last) for first, last in pairwise(bounds)]
    return [(str(names[rows.start]), rows) for rows in parts if names[rows.start] and rows.stop - rows.start >= least]
