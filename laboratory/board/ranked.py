"""What models of lateral movement are ranked by, and therefore fitted to: one place for both."""

from __future__ import annotations

from collections.abc import Collection

from xosc_lateral.drivers.evaluation.snippets import UNITS, SnippetCondition

SHORT, LONG = 10.0, 30.0
"""Windows that count: the paper's, and long enough to see drivers come back. [s]"""


def ranked_numbers(lengths: Collection[float]) -> list[tuple[SnippetCondition, str]]:
    """Ten metrics from the same start, and everything of free runs in longer windows where there are any.

    `lengths` of the windows that there are. [s]
    """
    seconds = LONG if LONG in lengths else SHORT
    return [
        (SnippetCondition(SHORT, True), "metrics"),
        *((SnippetCondition(seconds, False), family) for family in UNITS),
    ]
