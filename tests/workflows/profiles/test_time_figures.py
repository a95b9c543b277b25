"""Figures over time draw the numbers of the result: read back from their axes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.enriched import made_enriched
from xosc_lateral.files.pages.chart import Panel, color_of
from xosc_lateral.workflows.conversion.result import Enriched
from xosc_lateral.workflows.playing.figures import (
    USUAL_ACCELERATION,
    accelerations_over_time,
    broken,
    offsets_over_time,
    shown_rows,
    speeds_over_time,
)


@pytest.fixture(scope="module")
def enriched(tmp_path_factory: pytest.TempPathFactory) -> Enriched:
    return made_enriched(tmp_path_factory.mktemp("made"))


def lines(panel: Panel) -> dict[str, np.ndarray]:
    return {mark.label: np.column_stack([mark.x, mark.y]) for mark in panel.curves()}


def test_offsets_are_what_was_added_and_all_on_one_scale(enriched: Enriched) -> None:
    some = enriched.entities[:2]
    figure = offsets_over_time(enriched, some)
    figure.settle()
    for panel, one in zip(figure.panels, some, strict=True):
        rows = shown_rows(one.motion)
        drawn = lines(panel)[one.name]
        np.testing.assert_allclose(drawn[:, 0], one.motion.time[rows])
        np.testing.assert_allclose(drawn[:, 1], one.deviation[rows])
        low, high = panel.y.ends
        assert high == -low >= np.abs(one.deviation).max()
    assert len({(panel.x.ends, panel.y.ends) for panel in figure.panels}) == 1


def test_grey_covers_what_is_not_road_following(enriched: Enriched) -> None:
    (panel,) = offsets_over_time(enriched, enriched.entities[1:2]).panels
    spans = [span for span in enriched.entities[1].spans if not span.is_road_following]
    shaded = sorted((mark.x.min(), mark.x.max()) for mark in panel.marks if mark.kind == "area")
    np.testing.assert_allclose(shaded, [(span.start, span.end) for span in spans])


def test_speeds_are_drawn_nominal_and_enriched_in_the_entity_s_colour(enriched: Enriched) -> None:
    figure = speeds_over_time(enriched.motion, enriched.entities)
    figure.settle()
    (panel,) = figure.panels
    for number, one in enumerate(enriched.entities):
        rows = shown_rows(one.motion)
        made, nominal = panel.curves()[2 * number : 2 * number + 2]
        np.testing.assert_allclose(made.y, one.trajectory.speed[rows])
        np.testing.assert_allclose(nominal.y, one.motion.speed[rows])
        assert (made.label, made.color, nominal.label) == (one.name, color_of(number), "nominal")
    assert panel.y.ends[0] <= 0.0


def test_accelerations_are_what_was_added_between_the_bounds_of_real_drivers(enriched: Enriched) -> None:
    panels = accelerations_over_time(enriched, enriched.entities).panels
    for number, (panel, one) in enumerate(zip(panels, enriched.entities, strict=True)):
        np.testing.assert_allclose(lines(panel)["added"][:, 1], one.lateral_acceleration())
        levels = {float(mark.y[0]) for mark in panel.marks if mark.dashes}
        assert levels == {-USUAL_ACCELERATION, USUAL_ACCELERATION}
        assert [mark.color for mark in panel.marks if mark.label == "added"] == [color_of(number)]


def test_a_line_breaks_where_it_is_told_to_and_nowhere_else() -> None:
    drawn = broken(np.arange(4.0), np.array([False, True, False, False]))
    np.testing.assert_array_equal(np.isnan(drawn), [False, True, False, False])
    assert drawn[3] == 3.0
