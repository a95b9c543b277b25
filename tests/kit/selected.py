"""Terms that are selected on some drives, without held-out scores: what most tests ask about."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.identify import usable_columns
from xosc_lateral.extras.loop.selection import ERROR_BUDGET, Selection, select
from xosc_lateral.extras.loop.timeline import Coarse, join_drives


def selected(drives: Sequence[Drive], excluded: Sequence[str] = ()) -> Selection:
    coarse = Coarse.of(join_drives(drives))
    columns = usable_columns(coarse.timeline, excluded).columns
    return select(Search.over(coarse, columns, np.random.SeedSequence(1), ERROR_BUDGET))


def named(selection: Selection) -> set[tuple[str, tuple[str, ...]]]:
    return {(one.term.kind, tuple(sorted(one.term.columns))) for one in selection.accepted}
