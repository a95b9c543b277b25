"""What a model does in one half of the board: free runs and windows, under the context of the scored vehicles."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laboratory.board.half import DRAWS, ENSEMBLE, Half
from laboratory.board.models.base import LateralModel
from xosc_lateral.drivers.drives.drive import STEP
from xosc_lateral.drivers.evaluation.realism import VarianceParts, variance_parts
from xosc_lateral.drivers.evaluation.snippets import Features, SnippetCondition, Snippets, features_of
from xosc_lateral.drivers.model.sampled_offsets import segment_of

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SampledHalf:
    """What a model did in one half.

    Parameters
    ----------
    settings : mapping
    paths : list of array
        A free run for each of the half's runs, first draw. [m]
    ensemble : array, shape (n, 8, 51), or None
        Snippets of 10 s with the real starts. [m]
    windows : mapping of SnippetCondition to array, shape (n, m)
        First draw. [m]
    features : mapping of SnippetCondition to tuple of Features
        Of each draw.
    variance : VarianceParts
    """

    settings: Mapping[str, float]
    paths: list[FloatArray]
    ensemble: FloatArray
    windows: Mapping[SnippetCondition, FloatArray]
    features: Mapping[SnippetCondition, tuple[Features, ...]]
    variance: VarianceParts


def sample_half(model: LateralModel, half: Half, rng: np.random.Generator) -> SampledHalf:
    """Free runs over the half's runs, and windows with the real starts."""
    segments = [segment_of(run) for run in half.test]
    drawn = [model.sample(segments, None, rng) for _ in range(DRAWS)]
    shortest = min(half.windows)
    ensemble = sample_same_start(model, half.windows[shortest], rng, ENSEMBLE)
    cut = _cut(model, half, drawn, ensemble, rng)
    features = {
        condition: tuple(features_of(rows, half.windows[condition.seconds].lane_width, STEP) for rows in several)
        for condition, several in cut.items()
    }
    first = {condition: several[0] for condition, several in cut.items()}
    free = half.windows[shortest].cut_from(drawn[0])
    return SampledHalf(model.settings, drawn[0], ensemble, first, features, variance_parts(free, run_names(half)))


def _cut(
    model: LateralModel,
    half: Half,
    drawn: Sequence[Sequence[FloatArray]],
    ensemble: FloatArray,
    rng: np.random.Generator,
) -> dict[SnippetCondition, list[FloatArray]]:
    """Windows of every condition: out of free runs, or from the real starts."""
    shortest = min(half.windows)
    cut: dict[SnippetCondition, list[FloatArray]] = {}
    for condition in half.conditions:
        own = half.windows[condition.seconds]
        if not condition.same_start:
            cut[condition] = [own.cut_from(paths) for paths in drawn]
        elif condition.seconds == shortest:
            cut[condition] = [ensemble[:, member] for member in range(DRAWS)]
        else:
            cut[condition] = [sample_same_start(model, own, rng, 1)[:, 0]]
    return cut


def run_names(half: Half) -> NDArray[np.str_]:
    """Run of each of the shortest windows: a free run is one driver. Shape (n,). [-]"""
    return np.array([str(number) for number, _ in half.windows[min(half.windows)].place])


def sample_same_start(model: LateralModel, windows: Snippets, rng: np.random.Generator, members: int) -> FloatArray:
    """Shape (n, members, m). [m]"""
    segments = [segment for segment in windows.segments for _ in range(members)]
    starts = np.repeat(windows.offset[:, 0], members)
    rows = np.array(model.sample(segments, starts, rng))
    return rows.reshape(len(windows), members, -1)
