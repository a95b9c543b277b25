"""Under what measured and sampled snippets are compared: length, start, and how much of the spectrum."""

from __future__ import annotations

from dataclasses import dataclass

LENGTHS = (10.0, 30.0, 60.0)
"""The paper's; long enough to see drivers come back; a minute. [s]"""


@dataclass(frozen=True)
class SnippetCondition:
    """What snippets that are compared have in common.

    Parameters
    ----------
    seconds : float
        Their length. [s]
    same_start : bool
        A sampled snippet starts where its real one starts, and stands beside other drivers' snippets that start
        there too. Else neither knows the start: sampled ones are cut from free runs.
    slow : bool
        Movement below 0.5 Hz alone, see `filters`; else everything that was recorded.
    """

    seconds: float
    same_start: bool
    slow: bool = False

    @property
    def name(self) -> str:
        """In words."""
        start = "same start" if self.same_start else "free"
        return f"{self.seconds:g} s, {start}" + (", below 0.5 Hz" if self.slow else "")
