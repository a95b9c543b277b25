"""Files that a scenario names: near by is allowed, elsewhere is not, whatever way the path is written."""

from __future__ import annotations

from pathlib import Path

import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.references import LEVELS_UP, Boundary, allowed_roots
from xosc_lateral.world.scenario.place import Place

PLACE = Place(path=Path("s.xosc"), line=7, element="LogicFile")


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    folder = tmp_path.joinpath(*"abcde")
    folder.mkdir(parents=True)
    return folder / "s.xosc"


def boundary(scenario: Path, *extra: Path) -> Boundary:
    return Boundary(scenario.parent, allowed_roots(scenario, extra))


@pytest.mark.parametrize("up", range(6))
def test_so_many_folders_up_are_allowed_and_no_more(scenario: Path, up: int) -> None:
    reference = "../" * up + "road.xodr"
    inside = boundary(scenario)
    assert inside.holds(inside.path(reference, PLACE)) is (up <= LEVELS_UP)
    if up <= LEVELS_UP:
        assert inside.inside(reference, PLACE) == Path(scenario.parents[up] / "road.xodr")
    else:
        with pytest.raises(FormatError, match=r"s\.xosc:7.*outside the scenario's folders"):
            inside.inside(reference, PLACE)


def test_backslashes_are_slashes(scenario: Path) -> None:
    inside = boundary(scenario)
    assert inside.inside("..\\roads\\r.xodr", PLACE) == inside.inside("../roads/r.xodr", PLACE)


def test_a_folder_that_is_allowed_by_name_is_allowed_with_all_that_is_in_it(scenario: Path, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere" / "roads"
    elsewhere.mkdir(parents=True)
    reference = str(elsewhere / "r.xodr")
    with pytest.raises(FormatError, match="allow its folder"):
        boundary(scenario).inside(reference, PLACE)
    assert boundary(scenario, elsewhere.parent).inside(reference, PLACE) == elsewhere / "r.xodr"


def test_a_link_leads_where_it_leads(scenario: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.mkdir()
    (scenario.parent / "roads").symlink_to(secret)
    with pytest.raises(FormatError, match="outside"):
        boundary(scenario).inside("roads/r.xodr", PLACE)


@pytest.mark.parametrize("reference", ["", "   ", "a\0b"])
def test_nothing_is_no_file(scenario: Path, reference: str) -> None:
    with pytest.raises(FormatError, match="empty file reference"):
        boundary(scenario).path(reference, PLACE)


def test_a_folder_to_allow_has_to_be_there(scenario: Path, tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="no such folder to allow"):
        allowed_roots(scenario, [tmp_path / "rodas"])


@pytest.mark.parametrize(
    ("folder", "highest"),
    [("/x", "/x"), ("/x/y", "/x"), ("/x/y/z", "/x/y"), ("/x/y/z/u", "/x/y"), ("/x/y/z/u/v/w", "/x/y/z")],
)
def test_a_scenario_near_the_root_does_not_open_the_whole_machine(folder: str, highest: str) -> None:
    """So many folders up only where at least as many lie between there and the root."""
    assert allowed_roots(Path(folder) / "s.xosc") == (Path(highest),)
