"""How vehicles under test drive in the runs that an output is compared in."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.kit.generated import write
from xosc_lateral.workflows.conversion.ego_drives import drives
from xosc_lateral.workflows.conversion.load import play_scenario

OPPOSITE, PLAIN = {"kind": "opposite", "width": 3.5, "length": 900.0}, {"kind": "plain", "width": 3.5}


@pytest.mark.parametrize(
    ("road", "k", "lane"),
    [
        ({**OPPOSITE, "lanes": 1}, 0, 1),  # there is that of oncoming traffic alone
        ({**OPPOSITE, "lanes": 2}, 0, -2),
        ({**PLAIN, "lanes": 3}, 1, -1),
        ({**PLAIN, "lanes": 1}, 0, 1),
    ],
)
def test_an_ego_that_changes_lanes_takes_that_of_oncoming_traffic_where_there_is_no_other(
    tmp_path: Path, road: dict[str, object], k: int, lane: int
) -> None:
    ego = {"name": "Ego", "class": "car", "way": 0, "k": k, "d": 50.0, "v": 20.0}
    spec = {"minor": 2, "catalog": False, "parameters": False, "end": 5, "egos": [], "vehicles": [ego], "events": []}
    played = play_scenario(write.files({**spec, "road": road}, tmp_path), step=0.05)
    changes = [one.lanes for one in drives(played.motion, ["Ego"], played.network) if one.lanes]
    assert changes == [{"Ego": lane}]
