"""Pictures of a moment show vehicles where they are; summaries say what the page says; files of others stay."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import xosc_lateral as xl
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.files import source
from xosc_lateral.files.pages.chart import color_of
from xosc_lateral.workflows.conversion.page import key_figures
from xosc_lateral.workflows.playing.picture import GIF_STEP, REACH, PictureScene
from xosc_lateral.workflows.playing.scene import scene_of

TIME = 4.0


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> xl.Conversion:
    scenario, _ = xl.write_template("cut-in", tmp_path_factory.mktemp("scenario"))
    return xl.convert(scenario, ego="none", seed=1, time_limit=12.0)


def shown(made: xl.Conversion) -> PictureScene:
    return PictureScene(scene_of(made.movement.motion, made.movement.network, made.movement.entities))


def test_vehicles_are_as_far_apart_as_the_table_says(made):
    """The road is straight: ahead in the picture is along it, left of the middle is across it."""
    (panel,) = shown(made).picture(TIME, "CutIn").panels
    rows = made.to_frame()
    rows = rows[np.isclose(rows["time"], TIME)].set_index("name")
    areas = {mark.label: mark for mark in panel.marks if mark.kind == "area" and mark.label}
    assert set(areas) <= set(rows.index) and "Ego" in areas
    way = rows.loc["Ego", ["x", "y"]] - rows.loc["CutIn", ["x", "y"]]
    assert np.abs(np.sin(made.movement.entity("Ego").motion.heading)).max() < 0.01, "straight"
    course = made.movement.entity("Ego").motion.heading[0]
    ahead = way["x"] * np.cos(course) + way["y"] * np.sin(course)
    left = way["y"] * np.cos(course) - way["x"] * np.sin(course)
    middles = {name: np.array([area.x.mean(), np.mean([area.y.min(), area.y.max()])]) for name, area in areas.items()}
    assert middles["Ego"] - middles["CutIn"] == pytest.approx([ahead, left], abs=0.05)
    deviation = float(rows.loc["CutIn", "deviation"])
    assert abs(deviation) > 0.02
    assert middles["CutIn"][1] == pytest.approx(deviation, abs=0.02), "the camera is where it was written"
    (ghost,) = [mark for mark in panel.marks if mark.dashes and np.abs(mark.x).max() < 5.0]
    assert np.mean([ghost.y.min(), ghost.y.max()]) == pytest.approx(0.0, abs=0.01)


def test_pixels_are_where_the_vehicles_are(made, tmp_path):
    image_module = pytest.importorskip("PIL.Image")
    path = made.write_image(tmp_path / "moment.png", TIME)
    figure = shown(made).picture(TIME)
    (panel,) = figure.panels
    image = image_module.open(path).convert("RGB")
    scale = image.width / figure.width
    first = next(mark for mark in panel.marks if mark.label)
    x = 4.0 + (figure.width - 8.0) * (first.x.mean() + REACH) / (2.0 * REACH)
    low, high = panel.y.ends
    y = image.height / scale - 4.0 - figure.height * (np.mean([first.y.min(), first.y.max()]) - low) / (high - low)
    wanted = tuple(int(first.color[k : k + 2], 16) for k in (1, 3, 5))
    assert image.getpixel((round(x * scale), round(y * scale))) == wanted
    assert first.color == color_of([one.name for one in made.movement.entities].index(first.label))


@pytest.mark.pages
def test_a_run_becomes_a_gif_in_real_time(tmp_path):
    image_module = pytest.importorskip("PIL.Image")
    scenario, _ = xl.write_template("cut-in", tmp_path)
    played = xl.play(scenario, time_limit=2.0)
    with image_module.open(played.write_animation(tmp_path / "run.gif")) as image:
        seconds = image.n_frames * image.info["duration"] / 1000.0
    assert seconds == pytest.approx(2.0 + GIF_STEP, abs=0.01)
    played.write_animation(tmp_path / "run.gif")  # its own file


def test_a_time_beyond_the_run_and_a_file_of_others_are_refused(made, tmp_path):
    with pytest.raises(ValueError, match=r"at 99 s: the run is from 0 to 12\.0 s"):
        made.write_image(tmp_path / "a.svg", 99.0)
    (tmp_path / "a.svg").write_text("<svg>mine, of xosc-lateral</svg>")
    with pytest.raises(FormatError, match="was not written by xosc-lateral"):
        made.write_image(tmp_path / "a.svg")
    assert made.write_image(tmp_path / "a.svg", force=True) == made.write_image(tmp_path / "a.svg")


def test_a_summary_says_what_the_page_says(made, tmp_path):
    path = made.write_summary(tmp_path / "what came.md")
    text = path.read_text()
    for one in key_figures(made.movement, [entity for entity in made.movement.entities if entity.is_enriched]):
        assert f"| {one.label} | **{one.value}** |" in text
    pictures = re.findall(r"!\[[^]]+\]\(([^)]+)\)", text)
    assert pictures == ["what%20came_paths.svg", "what%20came_moment.svg"]
    assert all((tmp_path / name.replace("%20", " ")).read_text().startswith("<svg") for name in pictures)
    assert made.write_summary(tmp_path / "what came.md") == path
    (tmp_path / "theirs.md").write_text("# xosc-lateral\n")
    with pytest.raises(FormatError, match="was not written by xosc-lateral"):
        made.write_summary(tmp_path / "theirs.md")


def test_a_notebook_shows_the_text_and_the_figure(made):
    shown = made._repr_html_()
    assert shown.startswith("<pre>") and "CutIn: " in shown and shown.count("<svg xmlns") == 1


def test_view_writes_the_picture_alone_and_watches(tmp_path, monkeypatch, capsys):
    xl.write_template("cut-in", tmp_path)
    monkeypatch.chdir(tmp_path)
    assert main(["view", "cut-in.xosc", "--image", "m.svg", "--at", "1", "--time-limit", "2"]) == 0
    assert Path("m.svg").exists() and not list(tmp_path.glob("*.html"))
    assert main(["view", "cut-in.xosc", "--image", "m.svg", "--at", "9", "--time-limit", "2"]) == 2

    looks = iter(["<broken", Path("cut-in.xosc").read_text().replace("Truck", "Lorry")])

    def edited(_: float) -> None:
        text = next(looks, None)
        if text is None:
            raise KeyboardInterrupt
        Path("cut-in.xosc").write_text(text)

    monkeypatch.setattr(source.time, "sleep", edited)
    capsys.readouterr()
    main(["view", "cut-in.xosc", "--watch", "--no-open", "--time-limit", "2"])
    said = capsys.readouterr()
    assert said.out.count("cut-in_view.html") == 2 and "cut-in.xosc:1" in said.err
    assert "Lorry" in Path("cut-in_view.html").read_text()
