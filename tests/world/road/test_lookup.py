"""Look-ups of many owners agree with a plain bisection of each."""

from __future__ import annotations

from bisect import bisect_right

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from xosc_lateral.world.road.piecewise import Lookup

# Starts a few rounding errors apart, on a long axis: what a single searchsorted would get wrong.
starts = st.lists(
    st.one_of(st.floats(0.0, 1e5), st.integers(0, 5).map(lambda i: 1000.0 + i * 1e-12)),
    min_size=1, max_size=6, unique=True,
).map(sorted)  # fmt: skip


@given(st.lists(starts, min_size=1, max_size=5), st.data())
def test_any_mixture_of_owners_is_found_as_by_bisection(owners, data):
    lookup = Lookup(owners)
    places = st.tuples(st.integers(0, len(owners) - 1), st.floats(-10.0, 2e5))
    asked = data.draw(st.lists(places, min_size=1, max_size=20))
    # every start itself, exactly
    asked += [(i, s) for i, own in enumerate(owners) for s in own]
    first = np.cumsum([0] + [len(own) for own in owners])
    expected = [first[i] + max(bisect_right(owners[i], s) - 1, 0) for i, s in asked]
    owner, s = np.array([i for i, _ in asked], dtype=np.int32), np.array([s for _, s in asked])
    assert np.broadcast_to(lookup.find(owner, s), len(s)).tolist() == expected
    for i, at, piece in zip(owner.tolist(), s, expected, strict=True):
        assert int(np.ravel(lookup.find(i, np.array([at])))[0]) == piece
