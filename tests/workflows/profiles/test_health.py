"""What `check` says of tables: what is wrong, what is guessed, what can be fitted; its page and its mapping."""

from __future__ import annotations

import json
from html import unescape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral import check, fit, read_drives
from xosc_lateral.cli import main

TIME = np.arange(0.0, 240.0, 0.05)
NOISE = np.random.default_rng(7).normal(0.0, 0.012, len(TIME))
OFFSET = 0.25 * np.sin(TIME / 9.0) + 0.1 * np.sin(TIME / 2.3) - 0.2 + NOISE


def _logger(path: Path) -> Path:
    """As a logger's tool writes it: a preamble, German headers, units below, decimal commas."""
    rows = [f"{t:.2f};{100 * y:.2f};3,60;{108.0:.1f}".replace(".", ",") for t, y in zip(TIME, OFFSET, strict=True)]
    head = ["Messung;A4", "Fahrer;anna", "", "Zeit;Querablage;Spurbreite;Geschwindigkeit", "s;cm;m;km/h"]
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    return path


def test_a_loggers_table_is_read_as_guessed_and_by_the_mapping_that_is_written(tmp_path: Path) -> None:
    path = _logger(tmp_path / "day.csv")
    health = check(path)
    assert health.is_guessed and "no column 'time'" in health.wrong[0]
    assert [(row["column"], row["unit"]) for row in health.columns] == [
        ("time", "s"),
        ("offset", "cm"),
        ("lane_width", "m"),
        ("speed", "km/h"),
    ]
    assert health.figures["offset_mean_m"] == pytest.approx(OFFSET.mean(), abs=1e-3)
    health.write_mapping(tmp_path / "company.toml")
    (drive,) = read_drives(path, tmp_path / "company.toml")
    np.testing.assert_allclose(drive.offset, OFFSET, atol=1e-4)
    np.testing.assert_allclose(drive.speed, 30.0)
    text = (tmp_path / "company.toml").read_text()
    assert 'separator = ";"' in text and "header = 4" in text and "units = 5" in text


def test_the_mapping_says_where_headers_units_and_comments_are(tmp_path: Path) -> None:
    lines = ["1;2;3;4", "// made by hand", "zeit;quer;breite;v", "ms;mm;m;m/s"]
    lines += [f"{1000 * t:.0f};{1000 * y:.1f};3.6;30" for t, y in zip(TIME, OFFSET, strict=True)]
    lines.insert(4000, "// the logger paused")
    path, mapping = tmp_path / "day.csv", tmp_path / "company.toml"
    path.write_text("\n".join(lines) + "\n")
    mapping.write_text(
        'header = 3\nunits = 4\ncomment = "//"\n[columns]\ntime = "zeit [ms]:ms"\noffset = "quer [mm]:mm"\n'
        'lane_width = "breite [m]:m"\nspeed = "v [m/s]:m/s"\n'
    )
    (drive,) = read_drives(path, mapping)
    np.testing.assert_allclose(drive.offset, OFFSET, atol=1e-3)
    assert drive.time[-1] == pytest.approx(TIME[-1])


def test_markers_are_proposed_and_rows_left_out_are_counted(tmp_path: Path) -> None:
    table = pd.DataFrame({"time": TIME, "distance_left": 1.8 - OFFSET, "distance_right": 1.8 + OFFSET})
    table.loc[100:199, "distance_left"] = 999.0
    table.to_csv(tmp_path / "day.csv", index=False)
    health = check(tmp_path / "day.csv")
    assert health.is_guessed and "missing = [999]" in health.mapping
    assert health.figures["left_out"] == {"no place in a lane": 100}
    assert any("there is no column `speed`" in line for line in health.cannot())
    assert any("there is one drive" in line for line in health.cannot())


def test_what_cannot_be_read_is_said_and_ends_in_an_error(tmp_path: Path, capsys) -> None:
    path = tmp_path / "day.csv"
    both = pd.DataFrame({"time": TIME, "distance_left": 1.8 + OFFSET - NOISE, "distance_right": 1.8 + OFFSET})
    both.to_csv(path, index=False)
    assert main(["check", str(path), "--json", "--report", str(tmp_path / "page.html")]) == 1
    said = json.loads(capsys.readouterr().out)
    assert not said["can_be_read"] and "grow and shrink together" in said["wrong"][0]
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "grow and shrink together" in page and "distance_left" in page
    for verb in (["fit", str(path), "-o", str(tmp_path / "p.json")], ["close-loop", str(path), "--plan"]):
        assert main(verb) == 1
        assert "xosc-lateral check day.csv --report PAGE.html" in capsys.readouterr().err


@pytest.mark.pages
def test_page_and_text_say_what_the_fit_says(tmp_path: Path) -> None:
    path = tmp_path / "day.csv"
    pd.DataFrame({"time": TIME, "offset": OFFSET, "lane_width": 3.6, "speed": 30.0}).to_csv(path, index=False)
    health = check(path)
    assert not health.wrong and not health.is_guessed
    profile = fit(path)
    assert profile.sensor is not None and profile.sensor.in_words() == health.sensor
    page = unescape(health.write_report(tmp_path / "page.html").read_text(encoding="utf-8"))
    assert profile.sensor.in_words() in page and health.headline().split(";")[0] in page
