"""The shortcut test: does a `logistic` see a cut-in coming before it begins? Part of `laboratory.detectors`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

import xosc_lateral as xl
from xosc_lateral.extras.detect.observation import View
from xosc_lateral.extras.detect.other_detectors import FEATURES, features, fit_regression
from xosc_lateral.extras.detect.sources import played_scene
from xosc_lateral.extras.detect.tracks import EDGE_ROWS, MARGIN_ROWS, STEP, Scene
from xosc_lateral.workflows.conversion.load import play_scenario

FloatArray = NDArray[np.float64]
Views = list[tuple[Scene, list[View]]]

BEFORE = round(5.0 / STEP)
"""Rows before a lane change in which nothing may give it away. [rows]"""
EVERY = round(0.5 / STEP)
FOLDS, DRAWS = 5, 300


def played_variants(scenarios: Sequence[Path], ego: str, variants: int) -> Iterator[Scene]:
    """Converted scenarios as they play, every lane watched; with an ego, vehicles alone that react to it."""
    for path in scenarios:
        for variant in range(1, variants + 1):
            with TemporaryDirectory() as folder:
                output = Path(folder) / path.name
                made = xl.convert(path, output, variant=variant, profile="motorway", seed=55, ego=[ego])
                around = {path.parent, *path.parent.rglob("catalogs/*"), *path.parent.glob("road_networks")}
                played = play_scenario(output, step=STEP, allowed=around)
                found = played_scene(played, f"{path.stem} #{variant}", "none", cluster=path.stem)
            reacts = {name for name, mode in made.modes.items() if mode == "lane-offset"}
            tracks = found.tracks if ego == "none" else tuple(one for one in found.tracks if one.name in reacts)
            if tracks:
                yield replace(found, tracks=tracks)


@dataclass(frozen=True, eq=False)
class Moments:
    """Features of moments, whether a lane change begins within `BEFORE`, and whose they are."""

    columns: FloatArray
    positive: NDArray[np.bool_]
    cluster: NDArray[np.int64]
    changes: int


def begins_of(views: Views) -> dict[tuple[str, int], list[int]]:
    """Where lane changes begin as written: (cluster, side) -> instants."""
    found: dict[tuple[str, int], list[int]] = {}
    for _, several in views:
        for view in several:
            own = [view.track.first + change.begin for change in view.truth.changes if change.side == view.side]
            found.setdefault((view.track.cluster, view.side), []).extend(own)
    return found


def moments_of(views: Views, written: Mapping[tuple[str, int], Sequence[int]] | None = None) -> Moments:
    """`written`: lane changes begin there, whatever the movement; without, where the movement begins."""
    parts, positives, clusters, changes = [], [], [], 0
    names: dict[str, int] = {}
    for scene, several in views:
        for view in several:
            if view.track.name == "Ego":
                continue
            track, n = view.track, len(view.track)
            if written is None:
                begins = [change.begin for change in view.truth.changes if change.side == view.side]
            else:
                begins = [instant - track.first for instant in written.get((track.cluster, view.side), ())]
            rows = np.zeros(n, dtype=np.int8)
            rows[view.truth.keeping & view.watched] = 1
            for begin in begins:
                if EDGE_ROWS <= begin < n:
                    rows[max(begin - BEFORE - MARGIN_ROWS, 0) : begin + BEFORE] = 0
                    rows[max(begin - BEFORE, EDGE_ROWS) : begin + 1] = 2
                    changes += 1
            chosen = np.flatnonzero(rows)
            chosen = chosen[chosen % EVERY == 0]
            parts.append(features(view)[chosen])
            positives.append(rows[chosen] == 2)
            number = names.setdefault(f"{scene.name}/{track.cluster}", len(names))
            clusters.append(np.full(len(chosen), number))
    return Moments(np.concatenate(parts), np.concatenate(positives), np.concatenate(clusters), changes)


def area(score: FloatArray, positive: NDArray[np.bool_], weight: FloatArray | None = None) -> float:
    """Area under the ROC curve."""
    if weight is not None:
        rows = np.repeat(np.arange(len(score)), weight.astype(np.int64))
        score, positive = score[rows], positive[rows]
    ranks, count = rankdata(score), int(positive.sum())
    if not 0 < count < len(score):
        return np.nan
    return float((ranks[positive].sum() - 0.5 * count * (count + 1)) / (count * (len(score) - count)))


def told_before(moments: Moments, seed: int = 0) -> tuple[float, float, float]:
    """AUC of vehicles that the detector was not trained on, with a 95 % interval by vehicle."""
    rng = np.random.default_rng(seed)
    clusters = np.unique(moments.cluster)
    fold = dict(zip(rng.permutation(clusters).tolist(), (np.arange(len(clusters)) % FOLDS).tolist(), strict=True))
    folds = np.array([fold[one] for one in moments.cluster.tolist()])
    score = np.zeros(len(folds))
    for k in range(FOLDS):
        held = folds == k
        found = fit_regression(moments.columns[~held], moments.positive[~held])
        score[held] = found.log_odds(moments.columns[held])
    index = np.searchsorted(clusters, moments.cluster)
    drawn = []
    for _ in range(DRAWS):
        weight = rng.multinomial(len(clusters), np.full(len(clusters), 1.0 / len(clusters)))[index]
        drawn.append(area(score, moments.positive, weight))
    low, high = np.nanquantile(drawn, [0.025, 0.975])
    return area(score, moments.positive), float(low), float(high)


def strongest(moments: Moments) -> str:
    """Feature with the largest standardised coefficient, and its sign."""
    found = fit_regression(moments.columns, moments.positive).coefficients[1:]
    k = int(np.argmax(np.abs(found)))
    return f"{'more' if found[k] > 0 else 'less'} {FEATURES[k]}"


def shortcut_lines(replays: Views, reactive: Views, nominal: Views, real: Views) -> str:
    """A row for each kind of output, beside real drives."""
    written = begins_of(nominal)
    rows = [
        ("replays", moments_of(replays, written), "as written"),
        ("replays", moments_of(replays), "by movement"),
        ("reactive outputs", moments_of(reactive, written), "as written"),
        ("reactive outputs", moments_of(reactive), "by movement"),
        ("real: motorway recording", moments_of(real), "by movement"),
    ]
    heads = "traffic", "beginning of the lane change", "lane changes", "AUC, 5 to 0 s before", "strongest feature"
    lines = [f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
    for name, moments, kind in rows:
        auc, low, high = told_before(moments)
        lines.append(
            f"| {name} | {kind} | {moments.changes} | {auc:.2f} ({low:.2f} to {high:.2f}) | {strongest(moments)} |"
        )
    return "\n".join(lines)
