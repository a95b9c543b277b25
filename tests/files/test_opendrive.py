"""The OpenDRIVE reader: what it takes, what it repairs, what it refuses and how it says so."""

from __future__ import annotations

import copy
import math
import random
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.opendrive.reader import read_opendrive

DATA = Path(__file__).parents[1] / "data" / "xodr"
VALID = sorted((DATA / "valid").glob("*.xodr"))
INVALID = sorted((DATA / "invalid").glob("*.xodr"))


def test_the_collected_files_are_there():
    assert len(VALID) >= 10
    assert len(INVALID) >= 20


@pytest.mark.parametrize("path", VALID, ids=lambda path: path.stem)
def test_a_valid_file_is_read_and_every_place_on_its_lanes_is_finite(path):
    network = read_opendrive(path)
    for index, road in enumerate(network.roads):
        for section in road.sections:
            for lane in section.lanes:
                assert all(abs(value) < 1e6 for value in network.pose_at(index, lane.id, section.start))


@pytest.mark.parametrize("path", INVALID, ids=lambda path: path.stem)
def test_an_invalid_file_is_refused_in_one_line_that_says_where_and_what(path):
    with pytest.raises(FormatError) as caught:
        read_opendrive(path)
    message = str(caught.value)
    assert message.replace(f"{path.parent}/", "").startswith(path.with_suffix(".txt").read_text().strip())
    assert "\n" not in message


def test_an_external_entity_is_never_opened(tmp_path):
    secret = tmp_path / "secret.txt"
    secret.write_text("sesame")
    road = tmp_path / "road.xodr"
    road.write_text(
        f'<!DOCTYPE OpenDRIVE [<!ENTITY s SYSTEM "{secret.as_uri()}">]>\n'
        '<OpenDRIVE><road id="&s;" length="1"/></OpenDRIVE>'
    )
    with pytest.raises(FormatError, match="entity declarations") as caught:
        read_opendrive(road)
    assert "sesame" not in str(caught.value)  # a number may be part of the test's own folder


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FormatError, match=r"nowhere\.xodr"):
        read_opendrive(tmp_path / "nowhere.xodr")


def test_what_is_odd_but_clear_is_repaired_and_noted_with_its_line():
    network = read_opendrive(DATA / "valid" / "odd.xodr")
    notes = [str(note).split("odd.xodr:")[1] for note in network.notes]
    assert "10: geometry of length 0 m left out" in notes
    assert "6: length=250 m, but the geometry ends at 200 m: 200 m used" in notes
    assert "18: lane -2 has neither width nor border: taken as 0 m wide" in notes
    assert "25: road without lane sections: it has no lanes" in notes
    assert network.roads[0].length == 200.0
    assert network.geo_reference == "+proj=utm +zone=32"
    assert [lane.id for lane in network.lanes_at(0, 2.0)] == [-1, -2, -3]
    assert network.lanes_at(1, 5.0) == ()


def test_the_same_note_is_counted_and_not_repeated(tmp_path):
    text = (DATA / "valid" / "straight.xodr").read_text()
    zero = '<geometry s="5" x="0" y="0" hdg="0" length="0"><line/></geometry>'
    path = tmp_path / "road.xodr"
    path.write_text(text.replace("<planView>", "<planView>" + 3 * zero))
    (note,) = read_opendrive(path).notes
    assert note.what.endswith("geometry of length 0 m left out (and 2 more)")


def test_attributes_of_road_links_and_junctions_are_kept():
    network = read_opendrive(DATA / "valid" / "junction.xodr")
    (junction,) = network.junctions.values()
    assert [(c.incoming_road, c.connecting_road, c.lanes) for c in junction.connections] == [
        ("west", "west-south", ((-1, -1),)),
        ("west", "west-east", ((-1, -1),)),
        ("south", "south-east", ()),
    ]
    link = network.roads[network.index_of("west-south")].successor
    assert link is not None
    assert (link.element_type, link.element_id, link.contact) == ("road", "south", "end")
    assert network.roads[network.index_of("west-south")].junction == "T"
    assert network.roads[0].junction is None


def test_a_side_that_a_one_sided_section_leaves_out_goes_on_and_keeps_its_links():
    (road,) = read_opendrive(DATA / "valid" / "sections.xodr").roads
    assert road.section_starts == (0.0, 100.0, 200.0, 300.0)
    assert [sorted(lane.id for lane in section.lanes) for section in road.sections] == [
        [-1, 1],
        [-2, -1, 1],
        [-2, -1, 1],
        [-1, 1],
    ]
    assert [section.by_id[1].successors for section in road.sections[:3]] == [(1,), (1,), ()]
    assert [section.by_id[-2].predecessors for section in road.sections[1:3]] == [(-1,), (-2,)]
    assert road.sections[2].by_id[1].type == "exit"


def test_every_public_road_is_read(shared):
    paths = sorted((shared / "corpus").rglob("*.xodr"))
    assert len(paths) >= 29
    for path in paths:
        network = read_opendrive(path)
        assert network.roads
        for note in network.notes:
            assert "0 m wide" in note.what, note


def _damage(root: etree._Element, rng: random.Random) -> None:
    """Do to a file what hands, tools and disks do: change or drop an attribute, drop or repeat an element."""
    element = rng.choice(list(root.iter(etree.Element)))
    parent = element.getparent()
    what = rng.choice(["change", "change", "drop attribute", "drop", "repeat"])
    if what == "change" and element.attrib:
        element.set(
            rng.choice(list(element.attrib)), rng.choice(["", "nan", "-1", "0", "1e9", "abc", "1e-300", "start"])
        )
    elif what == "drop attribute" and element.attrib:
        del element.attrib[rng.choice(list(element.attrib))]
    elif what == "drop" and parent is not None:
        parent.remove(element)
    elif what == "repeat" and parent is not None:
        parent.append(copy.deepcopy(element))


@pytest.mark.parametrize("path", VALID, ids=lambda path: path.stem)
def test_a_damaged_file_is_refused_in_one_line_or_gives_finite_places(path, tmp_path):
    rng = random.Random(path.stem)
    damaged = tmp_path / "damaged.xodr"
    refused = 0
    for _ in range(25):
        tree = etree.parse(str(path))
        for _ in range(rng.choice([1, 1, 3])):
            _damage(tree.getroot(), rng)
        tree.write(str(damaged))
        try:
            network = read_opendrive(damaged)
        except FormatError as error:
            refused += 1
            assert "\n" not in str(error)
            continue
        for index, road in enumerate(network.roads):
            for section in road.sections:
                for lane in section.lanes:
                    poses = network.lane_to_world(index, lane.id, [section.start, math.nextafter(section.end, 0.0)])
                    assert np.isfinite(np.array(poses)).all()
                    assert network.advance(index, lane.id, section.start, 500.0).remaining <= 500.0
    assert 0 < refused < 25


def test_the_offset_of_the_header_moves_what_leaves_the_program(tmp_path):
    """Moved by (100, 200, 3), then turned by 90 degrees about the origin."""
    text = (DATA / "valid" / "odd.xodr").read_text()
    path = tmp_path / "moved.xodr"
    path.write_text(text.replace("</header>", '<offset x="100" y="200" z="3" hdg="1.5707963267948966"/></header>'))
    offset = read_opendrive(path).header_offset
    x, y, z, heading = offset.apply(*(np.array([value]) for value in (1.0, 2.0, 0.5, 0.25)))
    assert (x[0], y[0], z[0], heading[0]) == pytest.approx((-202.0, 101.0, 3.5, 0.25 + np.pi / 2))
    assert offset.undo(-202.0, 101.0) == pytest.approx((1.0, 2.0))
    assert not read_opendrive(DATA / "valid" / "odd.xodr").header_offset


@pytest.mark.parametrize("order", [("permanent", "temporary"), ("temporary", "permanent"), (None, "temporary")])
def test_of_two_lane_layers_the_permanent_one_counts(tmp_path, order):
    """OpenDRIVE 1.9: lanes, offsets and links of the other one are no part of it."""
    layers = {
        "permanent": (0.0, 3.5, '<successor id="-1"/><successor id="-1" layer="temporary"/>', ""),
        "temporary": (1.35, 3.0, '<successor id="-9" layer="temporary"/>', 'direction="reversed"'),
    }
    written = ""
    for layer in order:
        offset, width, link, direction = layers[layer or "permanent"]
        named = f'layer="{layer}"' if layer else ""
        sections = "".join(
            f'<laneSection s="{s}"><center><lane id="0" type="none"/></center><right><lane id="-1" type="driving" '
            f'{direction}><link>{link}</link><width sOffset="0" a="{width}" b="0" c="0" d="0"/></lane></right>'
            "</laneSection>"
            for s in ((0, 60) if layer != "temporary" else (20, 40))
        )
        written += f'<lanes {named}><laneOffset s="0" a="{offset}" b="0" c="0" d="0"/>{sections}</lanes>'
    path = tmp_path / "layers.xodr"
    path.write_text(
        '<OpenDRIVE><header revMajor="1" revMinor="9"/><road id="1" length="100" junction="-1"><planView>'
        f'<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>{written}</road></OpenDRIVE>'
    )
    network = read_opendrive(path)
    assert [section.start for section in network.roads[0].sections] == [0.0, 60.0]
    assert network.roads[0].sections[0].by_id[-1].successors == (-1,)
    assert network.travel_direction(0, -1) == 1
    for s in (10.0, 30.0, 50.0, 90.0):
        assert network.lane_state_at(0, -1, s)[::2] == pytest.approx((-1.75, 3.5))
    assert any("temporary lanes are left out" in note.what for note in network.notes)
