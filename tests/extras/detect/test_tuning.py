"""Thresholds from home: against loops over thresholds, with vehicles that have no part in their own."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator

import xosc_lateral as xl
from tests.kit.lane_tracks import lane_change, scene, track, weave
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.cli import main
from xosc_lateral.extras.detect.detectors import LateralSpeed, TimeToLine, WanderingZone
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, views_of
from xosc_lateral.extras.detect.scoring import Tally, cut_ins_of
from xosc_lateral.extras.detect.tuning import carried, carried_within, out_of_fold, read_goal, scored

TIME = 0.1 * np.arange(1800)
SCHEMA = Path(__file__).parents[3] / "docs" / "schemas" / "detect.json"


def traffic(count: int = 8, seed: int = 0, amplitude: float = 0.3) -> list:
    """Scenes of one vehicle each, that sways more or less and changes lanes sooner or later."""
    rng, views = np.random.default_rng(seed), []
    for k in range(count):
        sway = weave(180.0, amplitude * rng.uniform(0.3, 1.0), rng.uniform(6, 12))
        sway = sway + weave(180.0, 0.5 * amplitude * rng.uniform(), rng.uniform(3, 6))
        one = scene(track(sway + lane_change(TIME, rng.uniform(60, 120), rng.uniform(4, 9)), name=f"{seed}v{k}"))
        views.append((one, views_of(one, PERFECT_SENSOR, 0)))
    return views


def at(detector, views) -> tuple[float, float]:
    """False alarms an hour and share seen before the marking, at the threshold that is set."""
    tally = Tally(detector, "made")
    for each in views:
        tally.add(*each)
    curve = tally.curve()
    return float(curve.rate[detector.chosen]), float(curve.seen(0.0)[detector.chosen])


@pytest.mark.parametrize(("rule", "finer"), [(LateralSpeed, -1.0), (WanderingZone, -1.0), (TimeToLine, 1.0)])
@pytest.mark.parametrize("rate", [20.0, 60.0])
def test_the_threshold_is_the_most_sensitive_one_that_gives_the_rate(rule, finer, rate):
    views = traffic()
    found = carried(read_goal(f"{rate:g}/h"), rule(), scored(rule(), views), "made")
    assert found.home.met and at(rule(threshold=found.threshold), views)[0] <= rate
    tried = found.threshold + finer * np.linspace(0.0, 0.1, 21)[1:] * found.threshold
    assert max(at(rule(threshold=value), views)[0] for value in tried.tolist()) > rate


@pytest.mark.parametrize(("rule", "coarser"), [(LateralSpeed, 1.0), (TimeToLine, -1.0)])
def test_the_threshold_is_the_least_sensitive_one_that_sees_the_share(rule, coarser):
    views = traffic(20)
    found = carried(read_goal("90%"), rule(), scored(rule(), views), "made")
    assert at(rule(threshold=found.threshold), views)[1] == found.home.seen >= 0.9
    assert at(rule(threshold=found.threshold * (1.0 + 0.01 * coarser)), views)[1] < 0.9


def test_a_goal_may_ask_for_time_before_the_marking():
    views = traffic(20)
    for rule in (LateralSpeed(), TimeToLine()):
        found = carried(read_goal("80% 0.5s"), rule, scored(rule, views), "made")
        tally = Tally(type(rule)(threshold=found.threshold), "made")
        for each in views:
            tally.add(*each)
        early = [lead[tally.detector.chosen] > 0.5 for lead in tally.leads]
        assert found.home.met and len(early) == 20 and np.mean(early) >= 0.8 > np.mean(early) - 0.1
    never = carried(read_goal("95% 30s"), LateralSpeed(), scored(LateralSpeed(), views), "made").home
    assert not never.met and never.why_not.endswith("seen at most")


class Memory(LateralSpeed):
    """Knows vehicles again whose lane changes it has been shown."""

    def __init__(self, views) -> None:
        super().__init__()
        object.__setattr__(self, "shown", {view.track.name for view in views if cut_ins_of(view)})

    def score(self, view):
        return np.full(len(view.track), 1.0 if view.track.name in self.shown else 0.0)


def test_no_vehicle_is_scored_by_what_was_trained_on_it():
    views = traffic()
    whole, found = out_of_fold(lambda shown, _: Memory(shown), views, "made")
    assert len(found) == 2 * len(views) and not any(each.score.any() for each in found)
    assert len(whole.shown) == len(views)


def test_at_home_itself_a_vehicle_has_no_part_in_its_own_threshold():
    calm = traffic(9, amplitude=0.1)
    wild = traffic(1, seed=1, amplitude=0.9)
    goal, rule = read_goal("20/h"), LateralSpeed()
    tally = carried_within(goal, rule, scored(rule, [*calm, *wild]), "made")
    curve = tally.curve()
    assert curve.counts.shape == (10, 1) and len(curve.leads) == 10
    others = carried(goal, rule, scored(rule, calm), "made")
    expected = at(LateralSpeed(threshold=others.threshold), wild)[0]
    names = sorted(tally.seconds)
    own = curve.counts[names.index("1v0"), 0] / curve.hours[names.index("1v0")]
    assert own > 100.0 and own == pytest.approx(expected, rel=0.3)  # its fold holds a calm vehicle too


def test_one_vehicle_that_changes_lanes_trains_nothing_out_of_fold():
    with pytest.raises(NotEnoughDataError, match=r"made: 1 vehicle\(s\) of 1 change lanes"):
        out_of_fold(lambda shown, _: Memory(shown), traffic(1), "made")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    xl.write_template("cut-in", tmp_path)
    xl.write_template("overtake-truck", tmp_path / "home")
    return tmp_path


OWN = """
import json, sys
for line in sys.stdin:
    seen = json.loads(line)
    answers = {name: {"score": 100 * abs(one["offset"])} for name, one in seen["vehicles"].items()}
    print(json.dumps({"vehicles": answers}), flush=True)
"""


@pytest.mark.pages
def test_a_program_of_ones_own_gets_its_row_in_one_line_whatever_its_scores_are(folder, capsys):
    (folder / "mine.py").write_text(OWN)
    words = ["detect", "cut-in.xosc", "--home", "home", "--variants", "1", "--ego", "none", "--tune", "20/h"]
    assert main([*words, "--detector", f"{sys.executable} mine.py", "--detector", "lateral-speed", "--json"]) == 1
    answer = json.loads(capsys.readouterr().out)
    Draft202012Validator(json.loads(SCHEMA.read_text())).validate(answer)
    rows = [(row["source"], row["home"], row["detector"].split()[-1]) for row in answer["rows"]]
    sources, homes = ("cut-in", "cut-in, motorway"), ("home", "home, motorway")
    assert rows == [(one, home, last) for one in sources for last in ("mine.py", "0.4)") for home in homes]
    nominal, lifelike = answer["rows"][:2]
    assert nominal["threshold"] is None and 1.0 < lifelike["threshold"] < 100.0
    assert [row["home_met"] for row in answer["rows"]] == [row["home"] == homes[1] for row in answer["rows"]]
    assert all(row["home_false_alarms_per_hour"] <= 20.0 for row in answer["rows"])


def test_a_goal_that_no_threshold_meets_is_said_on_page_and_text_and_by_the_exit_status(folder, capsys):
    """Nobody moves inside a lane as written: any number of false alarms an hour is met, and sets nothing."""
    words = ["detect", "cut-in.xosc", "--home", "home", "--ego", "none", "--detector", "lateral-speed"]
    assert main([*words, "--tune", "20/h", "--report", "page.html"]) == 1
    said = "lateral-speed (hold 0.4) on home: cannot be set here, no alarm at any threshold"
    text = capsys.readouterr().out
    for shown in (text, (folder / "page.html").read_text()):
        assert said in shown and "Less than an hour of lane keeping" in shown
    assert main([*words, "--tune", "90%"]) == 0  # which lane changes set
    assert "cannot be set" not in capsys.readouterr().out


def test_a_rate_that_no_threshold_exceeds_sets_nothing():
    at_home = scored(LateralSpeed(), traffic(6))
    assert carried(read_goal("20/h"), LateralSpeed(), at_home, "made").home.met
    calm = carried(read_goal("100000/h"), LateralSpeed(), at_home, "made").home
    assert not calm.met and calm.why_not.endswith("an hour at any threshold")


def test_the_same_source_as_home_and_tried_is_set_on_other_vehicles(folder):
    text = str(xl.detect("home", home="home", tune="20/h", detectors="lateral-speed", ego="none", variants=1, seed=2))
    assert "the threshold of other vehicles" in text


@pytest.mark.parametrize(
    ("words", "what"),
    [
        ("--tune 20/h", "--tune and --home belong together"),
        ("--tune 20/h --home home --home home", "two homes are called 'home'"),
        ("--home home", "--tune and --home belong together"),
        ("--tune 20 --home home", "'20': expected false alarms an hour as in 20/h"),
        ("--tune 0/h --home home", "'0/h'"),
        ("--tune 101% --home home", "'101%'"),
        ("--tune 20/h1s --home home", "'20/h1s'"),
        ("--threshold 0.3", "--threshold is gone: a program's score above 0.5 is an alarm"),
        ("--answer-time 3", "--answer-time is gone: a program has 10 s"),
    ],
)
def test_what_can_t_be_meant_is_one_line(words, what, folder, capsys):
    assert main(["detect", "cut-in.xosc", *words.split()]) == 2
    assert what in " ".join(capsys.readouterr().err.split())
