"""All logged runs of the reference player, beside the same scenarios played here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.nominal import Activity, NominalMotion

DIFFERENT = {
    "esmini/lane-change_clothoid_spline_based_trajectory": "exact clothoids here, samples of 1 m there",
}
"""References that are known not to agree; docs/playing.md says more."""

PLACE, SPEED, ENDING = 0.10, 0.05, 0.1
"""How far the runs may differ. [m], [m/s], [s]"""


def rows(motion: NominalMotion) -> pd.DataFrame:
    return pd.concat(
        pd.DataFrame({"name": e.name, "k": np.rint(e.time * 50).astype(int), "x": e.x, "y": e.y, "speed": e.speed})[
            e.activity & Activity.ACTIVE > 0
        ]
        for e in motion.entities
    )


def difference(reference: Path, corpus: Path) -> str:
    """In what a run differs from the logged one; empty: it agrees."""
    name = reference.name.removesuffix(".csv.gz")
    scenario = min((corpus / reference.parent.name.split("_")[0]).rglob(f"{name}.xosc"))
    want = pd.read_csv(reference)
    want["k"] = (want.time * 50).round().astype(int)
    mine = rows(play_scenario(scenario).motion)
    if set(mine.name) != set(want.name):
        return f"entities {set(mine.name) ^ set(want.name)}"
    ends = mine.k.max() / 50, want.k.max() / 50
    if ends[1] < 59.9 and abs(ends[0] - ends[1]) > ENDING:
        return f"ends at {ends[0]} s, not {ends[1]} s"
    want = want.drop_duplicates(["name", "k"], keep="last")
    both = want.merge(mine, on=["name", "k"], suffixes=("_ref", ""))
    if len(both) < 0.98 * len(want):
        return f"{len(both)} of {len(want)} rows"
    far = float(np.hypot(both.x - both.x_ref, both.y - both.y_ref).max())
    fast = float((both.speed - both.speed_ref).abs().max())
    return f"{far:.3f} m, {fast:.3f} m/s" if far > PLACE or fast > SPEED else ""


def test_references_agree_but_for_those_that_are_known(shared: Path) -> None:
    corpus = shared / "corpus"
    found = {}
    references = sorted((corpus / "reference").glob("*/*.csv.gz"))
    for reference in references:
        key = f"{reference.parent.name}/{reference.name.removesuffix('.csv.gz')}"
        if why := difference(reference, corpus):
            found[key] = why
    unexpected = {key: why for key, why in found.items() if key not in DIFFERENT}
    assert not unexpected
    assert len(found) <= 0.05 * len(references)


@pytest.mark.parametrize("suite", ["esmini", "alks"])
def test_nothing_in_the_corpus_fails_but_by_name(shared: Path, suite: str) -> None:
    """Scenarios that can't be played say why; none ends in a traceback."""
    from xosc_lateral.base.errors import XoscLateralError

    played = 0
    for scenario in sorted((shared / "corpus" / suite).rglob("*.xosc")):
        if "atalog" in scenario.name:
            continue
        try:
            play_scenario(scenario, time_limit=3.0)
            played += 1
        except XoscLateralError as error:
            assert scenario.suffix in str(error)
    assert played > 10
