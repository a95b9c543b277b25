"""Pages from the command line: `view`, and the pages of a batch."""

from __future__ import annotations

import json
import re

import pytest

from xosc_lateral.cli import main


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenario")
    assert main(["template", "write", "cut-in", "-o", str(folder)]) == 0
    return folder / "cut-in.xosc"


def summary(capsys):
    return json.loads(capsys.readouterr().out.splitlines()[-1])


def test_view_writes_a_page_that_plays_the_maneuvers(scenario, tmp_path, capsys):
    page = tmp_path / "look.html"
    assert main(["view", str(scenario), "-o", str(page), "--no-open", "--time-limit", "5"]) == 0
    assert str(page) in capsys.readouterr().out
    html = page.read_text(encoding="utf-8")
    scene = json.loads(re.search(r'<script type="application/json" id="scene">(.*?)</script>', html)[1])
    assert [entity["name"] for entity in scene["entities"]] == ["Ego", "CutIn", "Truck"]
    assert scene["frames"] == 51
    assert not any("enriched" in entity for entity in scene["entities"])


def test_view_does_not_write_over_what_it_reads(scenario, capsys):
    before = scenario.read_bytes()
    assert main(["view", str(scenario), "-o", str(scenario), "--no-open"]) == 1
    assert scenario.read_bytes() == before
    assert capsys.readouterr().err.count("\n") == 1


def test_a_batch_gets_pages_pictures_and_an_index(scenario, tmp_path, capsys):
    source = tmp_path / "db"
    (source / "sub").mkdir(parents=True)
    for name in ("cut-in.xosc", "cut-in.xodr"):
        (source / "sub" / name).write_bytes(scenario.with_name(name).read_bytes())
    (source / "broken.xosc").write_text("<OpenSCENARIO", encoding="utf-8")
    out, pages = tmp_path / "out", tmp_path / "pages"
    arguments = [
        "convert",
        str(source),
        "-o",
        str(out),
        "--report",
        str(pages),
        "--quiet",
        "--json",
        "--time-limit",
        "3",
    ]
    assert main(arguments) == 1  # one of them is broken
    assert summary(capsys)["report"] == str(pages / "index.html")
    index = (pages / "index.html").read_text(encoding="utf-8")
    assert index.index("broken.xosc") < index.index("sub/cut-in.xosc")
    for link in re.findall(r'(?:href|src)="([^"#]+)"', index):
        assert (pages / link).is_file()
    assert (pages / "sub" / "cut-in.svg").is_file()

    (pages / "sub" / "cut-in.html").unlink()  # a page that is gone is made again, one that is there is left alone
    main(arguments)
    assert (pages / "sub" / "cut-in.html").is_file()
    assert summary(capsys)["written"] == 1
    main(arguments)
    assert summary(capsys)["written"] == 0
