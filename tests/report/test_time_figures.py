"""Figures over time draw the numbers of the result: read back from their axes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.report.made_enriched import made_enriched
from xosc_lateral.enrich.result import Enriched
from xosc_lateral.motion.gaps import Gap
from xosc_lateral.report.scenario_figures import broken, color_of, shown_rows
from xosc_lateral.report.scenario_time_figures import (
    dynamics_over_time,
    gaps_before_and_after,
    offsets_over_time,
    speeds_over_time,
    timeline,
)


@pytest.fixture(scope="module")
def enriched(tmp_path_factory: pytest.TempPathFactory) -> Enriched:
    return made_enriched(tmp_path_factory.mktemp("made"))


def lines(axis: Any) -> dict[str, np.ndarray]:
    return {line.get_label(): np.array(line.get_xydata()) for line in axis.lines}


def test_offsets_are_what_was_added_and_all_on_one_scale(enriched: Enriched) -> None:
    some = enriched.entities[:2]
    figure = offsets_over_time(enriched, some)
    for axis, one in zip(figure.axes, some, strict=True):
        rows = shown_rows(one.motion)
        drawn = lines(axis)[one.name]
        np.testing.assert_allclose(drawn[:, 0], one.motion.time[rows])
        np.testing.assert_allclose(drawn[:, 1], one.deviation[rows])
        low, high = axis.get_ylim()
        assert high == -low >= np.abs(one.deviation).max()
    assert len({axis.get_ylim() for axis in figure.axes}) == 1


def test_shades_cover_the_segments_that_got_offsets(enriched: Enriched) -> None:
    (axis,) = offsets_over_time(enriched, enriched.entities[1:2]).axes
    spans = [span for span in enriched.entities[1].spans if span.is_road_following]
    shaded = sorted((patch.get_x(), patch.get_x() + patch.get_width()) for patch in axis.patches)
    np.testing.assert_allclose(shaded, [(span.start, span.end) for span in spans])


def test_speeds_are_drawn_nominal_and_enriched_in_the_entity_s_colour(enriched: Enriched) -> None:
    (axis,) = speeds_over_time(enriched).axes
    for number, one in enumerate(enriched.entities):
        rows = shown_rows(one.motion)
        drawn = lines(axis)
        np.testing.assert_allclose(drawn[one.name][:, 1], one.trajectory.speed[rows])
        np.testing.assert_allclose(drawn[f"{one.name}, nominal"][:, 1], one.motion.speed[rows])
        (own,) = [line for line in axis.lines if line.get_label() == one.name]
        assert own.get_color() == color_of(number)
    assert axis.get_ylim()[0] <= 0.0


def test_dynamics_have_a_row_for_each_and_a_column_for_acceleration_and_jerk(enriched: Enriched) -> None:
    figure = dynamics_over_time(enriched.entities)
    assert len(figure.axes) == 2 * len(enriched.entities)
    untouched = figure.axes[-2]
    np.testing.assert_allclose(
        lines(untouched)["enriched"][:, 1], lines(untouched)["nominal"][:, 1], equal_nan=True
    )  # the third vehicle is not enriched
    swerving = figure.axes[0]
    assert np.nanmax(np.abs(lines(swerving)["enriched"][:, 1] - lines(swerving)["nominal"][:, 1])) > 0.05


def test_the_timeline_has_a_bar_for_every_span_and_names_the_long_reasons(enriched: Enriched) -> None:
    (axis,) = timeline(enriched).axes
    bars = [(tuple(line.get_xdata()), int(line.get_ydata()[0]), line.get_label()) for line in axis.lines]
    expected = [
        ((span.start, span.end), number, span.kind.value)
        for number, one in enumerate(enriched.entities)
        for span in one.spans
    ]
    assert bars == expected
    long = [
        span.kind.value
        for one in enriched.entities
        for span in one.spans
        if not span.is_road_following and span.end - span.start > 0.08 * enriched.motion.end_time
    ]
    assert [text.get_text() for text in axis.texts] == long
    assert axis.get_ylim()[0] > axis.get_ylim()[1]  # the first entity on top


@pytest.mark.parametrize("count", [1, 5])
def test_gaps_are_markers_with_a_line_between_those_that_both_have(count: int) -> None:
    both = (Gap(("a", "b"), 3.0, 1.5), Gap(("a", "b"), 2.0, 1.7))
    pairs = [both, *[(None, Gap(("c", f"d{k}"), 0.0, 4.0)) for k in range(count - 1)]]
    figure = gaps_before_and_after(pairs)
    (axis,) = figure.axes
    markers = [line for line in axis.lines if line.get_marker() == "o"]
    assert [float(line.get_xdata()[0]) for line in markers] == [3.0, 2.0, *[0.0] * (count - 1)]
    joined = [line for line in axis.lines if line.get_marker() != "o"]
    assert [list(line.get_xdata()) for line in joined] == [[3.0, 2.0]]
    assert axis.get_yticklabels()[0].get_text() == "a and b"
    assert axis.get_xlim()[0] <= 0.0
    assert len(figure.legends[0].get_texts()) == 2


def test_a_line_breaks_where_it_is_told_to_and_nowhere_else() -> None:
    drawn = broken(np.arange(4.0), np.array([False, True, False, False]))
    np.testing.assert_array_equal(np.isnan(drawn), [False, True, False, False])
    assert drawn[3] == 3.0
