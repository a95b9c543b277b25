"""Entities may be called anything: every page and table shows their names as they are."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from lxml import etree

from xosc_lateral.cli import main


@pytest.mark.parametrize(
    "names", [("車両", "🚗 ego", r"a$\foo$"), ("<b>&amp;", "עברית", "x" * 300)], ids=["scripts", "markup"]
)
def test_names_go_through_conversion_report_tables_and_viewer(tmp_path: Path, names: tuple[str, ...], capsys) -> None:
    assert main(["template", "write", "cut-in", "-o", str(tmp_path), "-q"]) == 0
    scenario, called = tmp_path / "cut-in.xosc", dict(zip(("Ego", "CutIn", "Truck"), names, strict=True))
    tree = etree.parse(scenario)
    for element in tree.iter():
        for key, value in element.attrib.items():
            element.set(key, called.get(value, value))
    tree.write(scenario, encoding="utf-8", xml_declaration=True)
    words = ["-o", str(tmp_path / "out.xosc"), "--report", str(tmp_path / "page.html"), "--time-limit", "3", "--json"]
    capsys.readouterr()
    assert main(["convert", str(scenario), *words]) == 0
    assert [entity["name"] for entity in json.loads(capsys.readouterr().out)["entities"]] == [*names]
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    scene = page.split('id="scene">')[1].split("</script>")[0]
    assert [entity["name"] for entity in json.loads(scene)["entities"]] == [*names]
    assert "<b>" not in page.split("<script")[0]
    assert main(["states", str(tmp_path / "out.xosc"), "-o", str(tmp_path / "s.csv"), "--time-limit", "1", "-q"]) == 0
    table = (tmp_path / "s.csv").read_text(encoding="utf-8")
    assert all(name in table for name in names)
