"""The verdict of `evaluate` is of all blocks that its page shows: one far from real drivers is named in it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from xosc_lateral.workflows.profiles.evaluation_page import BAD_RATIO, verdict_in_words
from xosc_lateral.workflows.profiles.realism_text import FAMILY_LABELS

LIKE_OTHERS = "like other real drivers up to 1.5 Hz, all that is compared"


def scores(**ratios: float) -> Any:
    families = dict(zip(FAMILY_LABELS, [SimpleNamespace(ratio=1.0)] * len(FAMILY_LABELS), strict=True))
    families |= {name: SimpleNamespace(ratio=ratio) for name, ratio in ratios.items()}
    condition = SimpleNamespace(name="free driving")
    one = SimpleNamespace(condition=condition, families=families, alone=None, jointly=SimpleNamespace(auc=0.5))
    verdict = SimpleNamespace(in_words=lambda: LIKE_OTHERS)
    return SimpleNamespace(realism=SimpleNamespace(conditions=[one]), verdict=verdict)


def test_a_far_block_is_named_and_none_is_where_there_is_none() -> None:
    assert verdict_in_words(scores()) == LIKE_OTHERS
    near, *_, far = FAMILY_LABELS
    said = verdict_in_words(scores(**{far: 24.54, near: 0.9 * BAD_RATIO}))
    assert said.startswith(f"{LIKE_OTHERS}; not like them: ")
    assert f"{FAMILY_LABELS[far]}, free driving (24.54)" in said
    assert FAMILY_LABELS[near] not in said
