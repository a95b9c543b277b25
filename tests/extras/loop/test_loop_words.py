"""What is said of one finding and of the whole loop, word by word."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from xosc_lateral.extras.loop.close import Finding
from xosc_lateral.extras.loop.columns import Feedback
from xosc_lateral.extras.loop.loop_words import (
    errors_of,
    finding_sentence,
    loop_text,
    meaning,
    p_value_words,
    shown_words,
    verdict,
)
from xosc_lateral.extras.loop.selection import Rejected
from xosc_lateral.extras.loop.shown import Shown
from xosc_lateral.extras.loop.terms.time import CHANGE_WITH_TIME
from xosc_lateral.workflows.profiles.effect_words import GAP


def found(kind: str = "location", **about: Any) -> Finding:
    """20 cm to the left, found without chance's help: 100 mm off before, 30 mm after."""
    known: dict[str, Any] = {
        "effect": "rain", "shape": "straight line", "size_m": 0.2, "size_error": 0.01, "statistic": "mean by rain",
        "measure": "mean by rain", "kind": kind, "p_value": 2e-3, "error_before": 0.1, "error_after": 0.03,
    }  # fmt: skip
    return Finding(**known | about)


def loop(*findings: Finding, **about: Any) -> Any:
    """What words are made of, of a loop without anything left."""
    left = SimpleNamespace(columns=("rain",), silent=True, p_value=0.4, share=0.001)
    known = {
        "findings": findings, "own_errors": (0.1, 0.03), "error_before": 0.05, "error_after": 0.04, "floor": 0.01,
        "remainder": left, "shown": (),
    }  # fmt: skip
    rejected, feedback = about.pop("rejected", ()), about.pop("feedback", ())
    chosen = SimpleNamespace(selection=SimpleNamespace(rejected=rejected), usable=SimpleNamespace(feedback=feedback))
    return SimpleNamespace(identified=chosen, **known | about)


def test_a_finding_says_its_size_with_two_errors_and_when_it_acts_only_where_that_is_known() -> None:
    size = f"rain: 0.20{GAP}±{GAP}0.02{GAP}m further left"
    assert finding_sentence(found()) == f"{size}; straight line"
    timed = found(lag_s=-1.0, response_s=2.5)
    assert finding_sentence(timed) == f"{size}; begins 1.0 s ahead, response time 2.5 s; straight line"
    alike = found(columns=("rain",), alike=(("wiper",), ("x", "y")))
    assert finding_sentence(alike).endswith("; `wiper`, or `x` with `y` would explain it about as well")


@pytest.mark.parametrize(("kind", "effect", "words"), [
    ("periodic", "cycle", "The car oscillates at a steady frequency"),
    ("regime", "regimes", "The movement switches between two levels of spread"),
    ("step", "step", "From one moment on the car keeps to another position"),
    ("step", CHANGE_WITH_TIME, "the drives do not tell in which form"),
])  # fmt: skip
def test_what_no_column_explains_is_explained_first(kind: str, effect: str, words: str) -> None:
    said = meaning(found(kind, effect=effect))
    assert words in said.split(effect.capitalize())[0]
    assert "Chance gives one as strong in 1 of 500 tables (p = 2.0e-03). On stretches that nothing was fitted" in said
    assert said.endswith(f"was 100{GAP}mm off before, and is 30{GAP}mm off now (mean by rain).")


def test_a_column_without_a_time_goes_by_whole_drives() -> None:
    between = "It goes by the mean of each drive, not by changes within one."
    assert between in meaning(found(columns=("rain",)))
    assert between not in meaning(found(columns=("rain",), lag_s=0.0)) + meaning(found("drift"))


@pytest.mark.parametrize(
    ("p_value", "words"),
    [(0.05, "in 1 of 20 tables"), (1e-4, f"in 1 of 10{GAP}000 tables"), (9e-5, "practically never")],
)
def test_chances_are_said_as_tables(p_value: float, words: str) -> None:
    assert p_value_words(p_value) == words


def test_the_whole_says_what_follows_from_the_movement_what_was_taken_back_and_errors_in_millimetres() -> None:
    marks = {"coherence": 0.5, "predicted_share": 0.1, "function": 0.2, "of": "offset"}
    feedback = (Feedback("wheel", doubtful=False, **marks), Feedback("gaze", doubtful=True, **marks))  # type: ignore[arg-type]
    rejected = (
        Rejected("mean", ("rain",), 3e-5, "it harms", was_found=True), Rejected("spread", ("fog",), 0.2, "chance")
    )  # fmt: skip
    lines = loop_text(loop(feedback=feedback, rejected=rejected)).splitlines()
    assert lines[:2] == ["no effect added", "a column that changes the mean offset (rain), p = 3.0e-05: it harms"]
    cause = "from the car's own movement, so it is not taken for a cause"
    assert lines[2:4] == [f"wheel: follows {cause}", f"gaze: may follow {cause}"]
    assert lines[4] == "where the effects act: held-out error 100.0 mm before, 30.0 mm after"
    assert lines[5].startswith("over everything: held-out error 50.0 mm before, 40.0 mm after (10.0 mm between random")
    assert not any("fog" in line for line in lines)
    assert errors_of(loop(own_errors=None)) == [("over everything", pytest.approx(50.0), pytest.approx(40.0))]


def test_what_is_left_is_chance_a_column_s_or_not_known() -> None:
    silent = verdict(loop(found(columns=("rain",))))
    assert silent.startswith("What is left is no more than chance: no column predicts it") and "(p = 0.40)" in silent
    assert "a cause that comes and goes with `rain` looks the same" in silent
    loud = SimpleNamespace(columns=("fog", "night"), silent=False, p_value=1e-6, share=0.123)
    said = verdict(loop(remainder=loud))
    assert said.startswith("More is left than chance: `fog and night`") and f"12.3{GAP}% of what is left" in said
    assert "looks the same" not in said
    none = SimpleNamespace(columns=(), silent=True, p_value=np.nan, share=0.0)
    assert verdict(loop(remainder=none)).startswith("The table has no other column that could explain what is left.")
    assert verdict(loop(remainder=None)).startswith("Whether a column predicts what is left is not known")


@pytest.mark.parametrize("tested", [True, False])
def test_who_was_not_asked_about_time_is_told_so(tested: bool) -> None:
    why = "fewer than 3 drives of two minutes, and none of ten"
    said = shown_words([Shown("rain", "mean", True, "", smallest=0.4), Shown("time", "mean", tested, why)])
    assert "by 0.40" in said
    assert (f"not looked for: {why}" in said) is not tested
