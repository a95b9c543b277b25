"""The verdict of `evaluate` is of all blocks that its page shows: one far from real drivers is named in it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from xosc_lateral.drivers.evaluation.realism import WithFloor
from xosc_lateral.workflows.profiles.evaluation_page import judged, verdict_in_words
from xosc_lateral.workflows.profiles.realism_text import FAMILY_LABELS

LIKE_OTHERS = "like other real drivers up to 1.5 Hz, all that is compared"


def scores(**errors: float) -> Any:
    """Every block three times as far as real drivers are, the ratio's logarithm known to so much, or not at all."""
    families = {name: WithFloor(3.0, 1.0, "sd", errors.get(name, 2.0)) for name in FAMILY_LABELS}
    one = SimpleNamespace(
        condition=SimpleNamespace(name="free driving", slow=True), families=families, alone=None,
        jointly=SimpleNamespace(auc=0.5, low=0.4, high=0.6),
    )  # fmt: skip
    verdict = SimpleNamespace(in_words=lambda: LIKE_OTHERS, judged=lambda of: "alike")
    return SimpleNamespace(realism=SimpleNamespace(conditions=[one]), verdict=verdict)


def test_a_block_that_is_far_beyond_chance_is_named_and_contradicts() -> None:
    assert verdict_in_words(scores()) == LIKE_OTHERS
    near, *_, far = FAMILY_LABELS
    given = scores(**{far: 0.1, near: 0.5})
    said = verdict_in_words(given)
    assert said.startswith(f"{LIKE_OTHERS}; not like them: ")
    assert f"{FAMILY_LABELS[far]}, free driving 3.00 (2.47 to 3.65, driver)" in said
    assert FAMILY_LABELS[near] not in said
    assert (judged(given, "driver"), judged(given, "recording")) == ("unlike", "alike")
