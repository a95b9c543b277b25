"""The page and the JSON of a closed loop: what a test engineer has to find there."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from examples.driver_simulator.plants import ShiftBy, SimulatedResponse
from examples.driver_simulator.simulator import simulate_drive
from xosc_lateral.drivers.model.effects import (
    Acts,
    Angular,
    ColumnEffect,
    Cycle,
    Effect,
    Factor,
    Form,
    Levels,
    Linear,
    Magnitude,
    Nearness,
    Piecewise,
    Product,
    Regimes,
    Saturating,
    Step,
    Threshold,
    TimeSmooth,
)
from xosc_lateral.drivers.model.effects.ends import ends_of
from xosc_lateral.extras.loop.close import Finding, LoopResult, close_loop
from xosc_lateral.extras.loop.loop_curves import curve_of, moving_spread
from xosc_lateral.extras.loop.loop_figures import (
    DRAWINGS,
    DRIVES_COLOR,
    draw_spectra,
    effect_figure,
    residual_figure,
)
from xosc_lateral.extras.loop.loop_report import column_record, finding_record, finite, loop_page, loop_record
from xosc_lateral.extras.loop.loop_words import (
    finding_sentence,
    loop_text,
    meaning,
    others_words,
    outcome,
    p_value_words,
    size_words,
    verdict,
)
from xosc_lateral.extras.loop.omnibus import Omnibus
from xosc_lateral.extras.loop.selection import Rejected
from xosc_lateral.files.drives import read_drives
from xosc_lateral.files.pages.chart import Panel

pytestmark = pytest.mark.pages

SHIFT = 0.4  # [m]

HIDDEN: tuple[Effect, ...] = (
    Cycle(amplitude=0.1, period_s=12.0),
    TimeSmooth(spread=(0.3, 0.1), spread_errors=(0.05, 0.05), to_s=1500.0),
    Regimes(factor=2.0, on_s=20.0, off_s=50.0),
    Step(size=0.3, at_s=700.0),
    TimeSmooth(location=(0.2,), location_errors=(0.05,), to_s=1500.0),
)

ONE = {"coefficients": (0.1,), "errors": (0.02,), "reference": (0.3,), "acts": Acts.LOCATION}
TWO = {"coefficients": (0.1, 0.05), "errors": (0.02, 0.02), "reference": (0.3, 0.3), "acts": Acts.LOCATION}
SHAPES: tuple[ColumnEffect, ...] = (
    Linear(column="truck_right", **ONE),
    Linear(column="speed", **ONE | {"acts": Acts.FINE}),
    Linear(column="speed", **ONE | {"acts": Acts.RATE}),
    Magnitude(column="curvature", **ONE),
    Threshold(column="grade", at=1.0, **ONE),
    Saturating(column="grade", middle=0.0, scale=1.0, **ONE),
    Piecewise(column="rain", knots=(1.0,), **TWO),
    Levels(column="lane_index", levels=(1.0, 2.0), **TWO),
    Nearness(column="lead_distance", scale=20.0, **ONE),
    Angular(column="wind_direction", **TWO),
    Product(factors=(Factor(column="wind_speed"), Factor(column="wind_direction", form=Form.SINE, at=360.0)), **ONE),
)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("loop") / "hills.parquet"
    simulate_drive(2400.0, 5, effects=[ShiftBy(("grade",), SHIFT, SimulatedResponse(lag=1.0))]).table.to_parquet(path)
    return path


@pytest.fixture(scope="module")
def result(table: Path) -> LoopResult:
    """Of five columns that may act; which one does among all is asked in `tests/extras/loop` and of README's walk."""
    idle = ("wind_speed", "wind_direction", "rain", "illuminance", "air_temperature", "car_left", "lead_distance")
    return close_loop(read_drives([table]), seed=1, excluded=(*idle, "truck_right"))


@pytest.fixture(scope="module")
def page(result: LoopResult, table: Path) -> str:
    return loop_page(result, [table])


def hidden(result: LoopResult, effect: Effect | None, kind: str, statistic: str = "movement by band") -> Finding:
    """A finding without columns, as the loop would give it."""
    return replace(
        result.findings[0], effect="something hidden", kind=kind, columns=(), alike=(), lag_s=None, response_s=None,
        effects=() if effect is None else (effect,), statistic=statistic, measure=statistic,
    )  # fmt: skip


def test_the_page_says_in_words_what_was_found_how_sure_and_when(page: str, result: LoopResult) -> None:
    finding = result.findings[0]
    assert finding.columns == ("grade",)
    assert f"mean offset by grade ({size_words(finding).partition(' as ')[0]}" in page
    assert "further left" in page
    assert "Chance gives one as strong practically never (p = " in page
    assert re.search(r"begins (at once|[\d.]+ s (ahead|later)), response time [\d.]+ s", page)


def test_what_would_explain_as_much_is_said_by_its_columns(result: LoopResult) -> None:
    found = replace(result.findings[0], columns=("grade", "speed"), alike=(("grade",), ("crossfall", "speed")))
    assert others_words(found) == "`grade` alone, or `crossfall` with `speed`"
    assert "`grade` alone, or `crossfall` with `speed` would explain it about as well" in finding_sentence(found)
    record = finding_record(found)
    assert record["alike"] == ["crossfall"]
    assert record["instead"] == [["grade"], ["crossfall", "speed"]]


def test_the_page_has_every_part_that_a_reader_needs(page: str) -> None:
    sections = re.findall(r"<h2[^>]*>([^<]+)", page)
    assert sections == [
        "What the profile lacked", "What is left, by every column", "How the profile moves beside the driver",
        "What these drives can show", "Columns, and what they are taken for", "What was looked for and not added",
        "How to read this page",
    ]  # fmt: skip
    assert page.count("<details><summary>") == page.count("</details>") == 6  # what was found comes first
    assert "the mean of 24 simulated runs" in page  # counted, not typed
    assert page.count("<figure") == 5  # effect, residual of mean and of spread, spectra, violins
    assert "**" not in page.split("<script>")[0]


def test_same_result_same_page(page: str, result: LoopResult, table: Path) -> None:
    assert loop_page(result, [table]) == page


def test_the_effect_curve_goes_through_the_points_measured_without_other_effects(result: LoopResult) -> None:
    effect = result.findings[0].effects[0]
    assert isinstance(effect, ColumnEffect)
    curve = curve_of(result, effect)
    assert len(curve.seen) >= 5
    fitted = np.interp(curve.seen, curve.over, curve.strength)
    assert np.mean(np.abs(curve.measured - fitted) < 3.0 * curve.measured_error) > 0.7
    slope = np.polyfit(fitted, curve.measured, 1)[0]
    assert slope == pytest.approx(1.0, abs=0.5)  # 25 minutes hold few hills; an effect drawn amiss gives 0 or -1


def test_a_spread_effect_is_drawn_as_factors_over_measured_ones(result: LoopResult) -> None:
    effect = Linear(acts=Acts.SPREAD, column="speed", coefficients=(0.0,), errors=(0.01,), reference=(30.0,))
    curve = curve_of(result, effect)
    assert np.all(np.abs(curve.measured) < np.log(3.0))  # this driver moves about as widely at every speed
    assert np.all(curve.measured_error > 0.0)


def test_the_residual_stands_out_of_the_band_before_and_not_after(result: LoopResult) -> None:
    group = next(group for group in result.lack_of_fit.groups if group.name == "mean by grade")
    assert group.before > 1.2 * group.floor  # the floor is of two halves of forty minutes: a tenth to and fro
    assert group.after < 0.6 * group.before
    figure = residual_figure(result, "mean")
    assert figure.panels[0].title == "grade [%]"  # columns of the effects come first


@pytest.mark.parametrize("p_value", [0.4, 1e-6])
def test_there_is_one_verdict_and_it_is_that_of_what_is_left(result: LoopResult, table: Path, p_value: float) -> None:
    told = replace(result, remainder=Omnibus(p_value, ("rain",), 0.02))
    sentence = verdict(told)
    assert ("no more than chance" in sentence) == (p_value > 0.05)
    assert ("More is left than chance: `rain`" in sentence) == (p_value <= 0.05)
    assert "What is not recorded cannot be named: a cause that comes and goes with `grade` looks the same." in sentence
    assert "Four of five changes of the mean by" in sentence
    assert loop_record(told, [table])["unexplained"]["sentence"] == sentence
    assert loop_text(told).endswith(sentence)
    assert "explainable" not in loop_text(told)


def test_nobody_is_told_of_looks_that_could_never_be_taken(result: LoopResult) -> None:
    """Consequences and clocks are no looks; sizes are those of drivers."""
    looks = {one.what for one in result.shown}
    assert looks.isdisjoint({one.column for one in result.identified.usable.feedback})
    sizes = [size for one in result.shown for size in (one.smallest, one.bound) if size is not None]
    assert max(sizes) <= 5.0 + 1e-9
    assert "22026" not in loop_text(result)


def test_the_json_keeps_to_the_schema_and_adds_the_meaning(result: LoopResult, table: Path) -> None:
    record = finite(loop_record(result, [table]))
    assert {"drives", "base_profile", "held_out", "findings", "consequences", "rejected", "error", "metrics"} <= set(
        record
    )
    finding = record["findings"][0]
    assert finding["kind"] == "location"
    assert "grade" in finding["meaning"]
    assert {row["group"] for row in record["residual"]} == set(result.scored.real)


@pytest.mark.parametrize("effect", HIDDEN, ids=lambda effect: effect.kind)
def test_every_hidden_effect_has_a_picture_with_the_measured_drive_in_it(result: LoopResult, effect: Effect) -> None:
    draw, caption = DRAWINGS[effect.kind]
    figure = draw(result, hidden(result, effect, "periodic"))
    lines = [mark for panel in figure.panels for mark in panel.curves()]
    assert caption.endswith(".")
    assert any(line.color == DRIVES_COLOR and len(line.x) > 50 for line in lines)


@pytest.mark.parametrize("kind", ["memory", "population"])
def test_what_a_core_model_lacks_has_a_picture(result: LoopResult, kind: str) -> None:
    draw, _ = DRAWINGS[kind]
    assert len(draw(result, hidden(result, None, kind)).panels[0].curves()) >= 3


@pytest.mark.parametrize("kind", ["periodic", "drift", "step", "scale", "regime", "memory", "population"])
def test_every_hidden_kind_is_told_in_plain_words(result: LoopResult, kind: str) -> None:
    words = meaning(hidden(result, None, kind))
    assert words[0].isupper()
    assert not words.startswith("(")


@pytest.mark.parametrize("effect", SHAPES, ids=lambda effect: f"{effect.kind}-{effect.acts.value}")
def test_every_shape_is_told_and_drawn(result: LoopResult, effect: ColumnEffect) -> None:
    sized = structs.replace(effect, driven=((0.0, 1.0),) * len(effect.columns))
    kind = "location" if effect.acts is Acts.LOCATION else "scale"
    told = {"ends": ends_of(sized), "kind": kind, "size_m": 1.2, "effects": (effect,), "columns": effect.columns}
    finding = replace(result.findings[0], **told)
    words = meaning(finding)
    assert all(column in words for column in effect.columns)
    curve = curve_of(result, effect)
    assert np.isfinite(curve.strength).all() and np.isfinite(curve.error).all()
    assert np.isfinite(curve.measured).all() and (len(curve.seen) > 0) == (effect.acts is not Acts.RATE)
    assert all(panel.curves() for panel in effect_figure(result, finding).panels)


def test_a_p_value_is_told_as_one_in_so_many_tables() -> None:
    assert p_value_words(0.004) == "in 1 of 250 tables"
    assert p_value_words(1e-9) == "practically never"


def test_courses_leave_out_what_is_cut(result: LoopResult) -> None:
    course = moving_spread(result, 240.0)
    assert len(course.time) == result.coarse.valid.sum()
    assert np.all(course.measured > 0.0)


def test_a_table_whose_runs_are_all_shorter_than_a_spectrum_s_segment_has_a_spectrum_still(result: LoopResult) -> None:
    panel = Panel()
    draw_spectra(panel, result, 10**6)
    for line in panel.curves():
        assert len(line.y) and np.all(line.y > 0.0)


def test_what_became_of_everything_is_said_whatever_it_was(result: LoopResult) -> None:
    """Found and kept; found and taken back; both; nothing."""
    found = result.findings
    back = Rejected("spread", ("wind_speed",), 1e-5, "it does not help", was_found=True)

    def told(kept: bool, taken: bool) -> str:
        selection = replace(result.identified.selection, rejected=(back,) if taken else ())
        identified = replace(result.identified, selection=selection)
        return outcome(replace(result, findings=found if kept else (), identified=identified))

    assert "No significant effect" in told(False, False)
    only_back = told(False, True)
    assert "1 effect was found and taken back" in only_back
    assert "the base profile is returned" in only_back
    assert "No significant effect" not in only_back
    both = told(True, True)
    assert both.startswith(f"{len(found)} effect")
    assert "1 more effect was found and taken back" in both
    assert "base profile" not in both


def test_every_column_stands_in_the_first_table_with_its_role(page: str, result: LoopResult) -> None:
    records = {name: column_record(name, result) for name in result.identified.usable.roles}
    assert records["grade"]["role"] == "road"
    assert records["steering_wheel_angle"]["use"] == "consequence"
    assert "Columns, and what they are taken for" in page
