"""Names of zones: the same everywhere, and where each passage of one begins and ends."""

from __future__ import annotations

import numpy as np

from xosc_lateral.drives.zones import at_zones, passages, zone_codes, zones_along


def test_a_name_has_one_code_in_every_table_and_none_where_it_is_empty():
    one, other = zone_codes(["south 1", "", "south 2"]), zone_codes(["south 2", "south 1"])
    assert one[0] == other[1] and one[2] == other[0] and one[0] != one[2]
    assert np.isnan(one[1])
    assert one[0] == float(int(one[0]))  # exact as a float, so that it survives any copy


def test_ten_thousand_names_have_ten_thousand_codes():
    assert len(np.unique(zone_codes([f"road {k % 7} lane {k % 3}, {k} m" for k in range(10_000)]))) == 10_000


def test_values_are_those_of_the_rows_zones():
    codes = zone_codes(["b", "a", "c", "", "b"])
    np.testing.assert_array_equal(at_zones(codes, ("a", "b"), (1.0, 2.0)), [2.0, 1.0, np.nan, np.nan, 2.0])
    assert np.isnan(at_zones(codes, (), ())).all()


def test_passages_end_where_the_zone_does_and_short_or_unknown_ones_are_none():
    names = np.array(["a"] * 5 + ["b"] * 2 + [""] * 9 + ["a"] * 4)
    assert passages(names, 3) == [("a", slice(0, 5)), ("a", slice(16, 20))]
    assert passages(names[:0], 3) == []


def test_zones_are_pieces_of_a_lane_and_no_lane_has_none():
    strand = np.array(["road 1 lane -1", "road 1 lane -1", "road 1 lane -2", "", "road 1 lane -1"])
    named = zones_along(strand, np.array([99.9, 100.0, 100.0, np.nan, -0.1]))
    assert named.tolist() == [
        "road 1 lane -1, 0 m",
        "road 1 lane -1, 100 m",
        "road 1 lane -2, 100 m",
        "",
        "road 1 lane -1, -100 m",
    ]
