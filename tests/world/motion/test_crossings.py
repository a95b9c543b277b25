"""The way across as written and as drivers take it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import beta

import xosc_lateral as xl
from tests.kit.scenario_files import entity, private, scenario_text, speed_action, teleport, write_scenario
from tests.workflows.conversion.test_vehicle_under_test import CHANGE, EXTERNAL
from tests.world.scenario.test_under_test import at, event, stories
from xosc_lateral.extras.recordings.recorded import Rough, fit_transition
from xosc_lateral.workflows.conversion.page import conversion_page
from xosc_lateral.workflows.conversion.result import EntityResult, LaneChanges
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.workflows.playing.figures import lane_changes_over_time
from xosc_lateral.world.motion.segments import ALPHA, BETA, NINE_TENTHS, PEAK_SHARE, TENTH, bell_share

WIDTH = 3.5


def test_the_bell_is_a_beta_distribution_with_its_peak_where_drivers_are_fastest() -> None:
    bell = beta(ALPHA, BETA)
    np.testing.assert_allclose(bell.ppf([0.1, 0.9]), [TENTH, NINE_TENTHS], atol=1e-6)
    time = np.linspace(0.0, 1.0, 10_001)
    assert time[np.argmax(bell.pdf(time))] == pytest.approx(PEAK_SHARE, abs=1e-4)


def change(shape: str, duration: str) -> str:
    return CHANGE.replace('"sinusoidal"', f'"{shape}"').replace('value="3"', f'value="{duration}"')


def scenario(folder: Path, shape: str = "sinusoidal", duration: str = "5", trigger: str = "") -> Path:
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL if trigger else "") + entity("A"),
        init=private("Ego", teleport("20"), speed_action("30")) + private("A", teleport("60"), speed_action("28")),
        stories=stories(("A", event("change", trigger or at(6.0), change(shape, duration)))),
        stop=at_end(),
    )
    return write_scenario(folder, text)


def at_end() -> str:
    return f'<ConditionGroup><Condition name="e" delay="0" conditionEdge="none">{at(20.0)}</Condition></ConditionGroup>'


def converted(path: Path, **options: str) -> tuple[EntityResult, EntityResult]:
    """Of A, with the way as written and lifelike."""
    pair = [xl.convert(path, seed=2, lane_changes=name, **options) for name in ("written", "lifelike")]
    written, lifelike = (made.movement.entity("A") for made in pair)
    return written, lifelike


@pytest.mark.parametrize("shape", ["sinusoidal", "cubic"])
def test_the_bell_has_the_files_times_and_hardly_more_speed_and_ends_in_the_same_place(
    tmp_path: Path, shape: str
) -> None:
    written, lifelike = converted(scenario(tmp_path, shape))
    (crossing,) = lifelike.crossings
    time, first, last = written.motion.time, crossing.first, crossing.last
    assert (time[first], time[last] - time[first]) == pytest.approx((6.0, 5.0), abs=0.05)
    assert crossing.way[-1] == pytest.approx(-WIDTH, abs=2e-3) and crossing.stays == ""
    nominal = np.concatenate((np.zeros(first), crossing.way, np.full(len(time) - last - 1, crossing.way[-1])))
    bell = nominal + lifelike.deviation - written.deviation
    share = bell / crossing.way[-1]
    assert 0.0 < share[first] < 0.012 and 0.0 < 1.0 - share[last] < 0.012
    assert share[0] == 0.0 and share[-1] == pytest.approx(1.0, abs=1e-9)
    begin, duration = (np.interp(value, share[first:last], time[first:last]) for value in (0.1, 0.9))
    expected = beta(ALPHA, BETA).cdf(TENTH + (time - begin) / (duration - begin) * (NINE_TENTHS - TENTH))
    np.testing.assert_allclose(share, expected, atol=2e-4)
    peaks = [np.max(np.abs(np.gradient(values, time))) for values in (nominal, bell)]
    assert peaks[1] < 1.1 * peaks[0]
    assert written.motion.lane[-1] == lifelike.motion.lane[-1] == -2


@pytest.mark.parametrize(
    ("shape", "duration", "why"),
    [("sinusoidal", "1.8", "it takes 1.80 s"), ("step", "0", "it takes 0.00 s")],
)
def test_what_the_bell_is_not_for_stays_as_written_and_is_named(
    tmp_path: Path, shape: str, duration: str, why: str
) -> None:
    path = scenario(tmp_path, shape, duration)
    written, lifelike = converted(path)
    np.testing.assert_array_equal(written.deviation, lifelike.deviation)
    made = xl.convert(path, seed=2, lane_changes="lifelike")
    assert [line for line in made.notes if "lane change of 'A' at 6.0 s stays as written" in line and why in line]
    written = xl.convert(path, seed=2, lane_changes="written")
    assert not any("stays as written" in line for line in written.notes)


def test_it_may_be_configured_and_said_in_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "xosc-lateral").mkdir()
    (tmp_path / "xosc-lateral" / "config.toml").write_text('lane_changes = "lifelike"\n')
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    assert ConvertSettings.of().lane_changes is LaneChanges.LIFELIKE
    assert ConvertSettings.of(lane_changes="written").lane_changes is LaneChanges.WRITTEN
    row = ConvertSettings().of_row({"lane_changes": "lifelike"}, tmp_path)
    assert row.lane_changes is LaneChanges.LIFELIKE


def test_the_choice_is_recorded_and_made_again(tmp_path: Path) -> None:
    made = xl.convert(scenario(tmp_path), tmp_path / "out.xosc", seed=2, lane_changes="lifelike")
    assert made.to_dict()["provenance"]["options"]["lane_changes"] == "lifelike"
    again = tmp_path / "again.xosc"
    xl.reproduce(tmp_path / "out.xosc", again)
    assert again.read_bytes() == (tmp_path / "out.xosc").read_bytes()


def test_the_report_draws_lane_changes_before_and_after(tmp_path: Path) -> None:
    made = xl.convert(scenario(tmp_path), seed=2, lane_changes="lifelike")
    page = conversion_page(made)
    assert "Speed towards the new lane" in page
    entity_result = made.movement.entity("A")
    figure = lane_changes_over_time(made.movement, [(entity_result, entity_result.crossings[0])])
    written, enriched = (np.asarray(mark.y) for mark in figure.panels[0].curves())
    assert written.max() == pytest.approx(0.5 * np.pi * WIDTH / 5.0, abs=0.02) and written.min() > -0.01
    assert 0.7 * written.max() < enriched.max() < 1.5 * written.max()


@pytest.mark.parametrize("is_bell", [True, False])
def test_a_recorded_lane_change_is_told_from_a_sinusoid(is_bell: bool) -> None:
    time = np.arange(0.0, 20.0, 0.1)
    u = np.clip((time - 6.0) / 8.0, 0.0, 1.0)
    y = WIDTH * (bell_share(u) if is_bell else 0.5 - 0.5 * np.cos(np.pi * u))
    y += np.random.default_rng(1).normal(0.0, 0.003, len(time))
    found = fit_transition(time, y, Rough(62, 138, 0.0, WIDTH, 1), 0.0)
    assert found.is_bell == is_bell
    assert min(found.bell_residual, found.residual) < 0.015 < max(found.bell_residual, found.residual)
