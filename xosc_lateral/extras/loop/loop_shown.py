"""What drives can show, in words: the smallest effects that would be found, and bounds of those that were not."""

from __future__ import annotations

from collections.abc import Sequence

from xosc_lateral.extras.loop.shown import Shown

GAP = "\N{NO-BREAK SPACE}"  # Between a number and its unit: they stay on one line.
SHOWN_NOTE = (
    "Smallest: an effect of this size is found with 80 % probability. At most: what was not found is smaller, with "
    "95 %. Sizes are changes of the mean between the 5 % and 95 % quantile of what drives it, or factors of the "
    "spread, of time over the longest drive. More minutes: of such driving, until 0.1 m or a factor of 1.5 is found as "
    "often."
)


def shown_rows(shown: Sequence[Shown]) -> list[dict[str, str | None]]:
    """What drives can show, as a table in words."""

    def size(entry: Shown, value: float | None) -> str | None:
        return None if value is None else f"{value:.2f}{GAP}m" if entry.acts == "mean" else f"factor{GAP}{value:.2f}"

    return [
        {
            "look": entry.what,
            "on": entry.acts,
            "tested": "yes" if entry.tested else "no",
            "outcome": entry.why,
        }
        | {"smallest": size(entry, entry.smallest), "at most": size(entry, entry.bound)}
        | {"more minutes": None if entry.more_minutes is None else f"{entry.more_minutes:.0f}"}
        for entry in shown
    ]


def shown_text(shown: Sequence[Shown]) -> str:
    """The same for a terminal."""
    rows = shown_rows(shown)
    names = list(rows[0]) if rows else []
    cells = [names, *([row[name] or "-" for name in names] for row in rows)]
    widths = [max(len(cell[column]) for cell in cells) for column in range(len(names))]
    lines = ("  ".join(text.ljust(width) for text, width in zip(cell, widths, strict=True)) for cell in cells)
    return "\n".join([shown_words(shown), "", *(line.rstrip() for line in lines), "", SHOWN_NOTE])


def shown_words(shown: Sequence[Shown]) -> str:
    """What silence means here, in a sentence."""
    forms = {"mean": f"{{0:.2f}}{GAP}m of the mean", "spread": "a factor of {0:.1f} of the spread"}
    words = []
    for acts, form in forms.items():
        sizes = sorted(one.smallest for one in shown if one.acts == acts and one.smallest is not None)
        words += [form.format(sizes[len(sizes) // 2])] if sizes else []
    untested = sum(not one.tested and one.acts != "mean and spread" for one in shown)
    effects = f"effects from {' and '.join(words)} on of every other column, in four of five cases"
    seen = effects if words else "no effect"
    return f"These drives show {seen}; {untested} of {len(shown)} looks could not be taken."
