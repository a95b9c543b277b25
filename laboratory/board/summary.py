"""The parts of a board put together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from laboratory.board.contestants import Contestant
from laboratory.board.half import Half
from laboratory.board.ranked import SHORT, ranked_numbers
from laboratory.board.ranking import QUANTILES, agreeing, differing_pairs, kendall_tau, rank_groups, ranks
from laboratory.board.result import Board, ModelScore, Row
from laboratory.board.sampled_half import SampledHalf
from xosc_lateral.drivers.drives.drive import STEP, Run
from xosc_lateral.drivers.evaluation.realism import variance_parts
from xosc_lateral.drivers.evaluation.snippets import BLOCK_SECONDS, FEW_DRIVES, LAGS, autocorrelation_of, resolved_bands

FloatArray = NDArray[np.float64]
Parts = Sequence[tuple[Half, Mapping[str, SampledHalf]]]

EXAMPLES = 8
"""Windows shown of each model."""


def make_board(
    runs: Sequence[Run],
    entries: Sequence[Contestant],
    parts: Parts,
    numbers: Mapping[str, tuple[ModelScore, ...]],
    by_half: Mapping[str, FloatArray],
    drawn: Mapping[str, FloatArray],
    absent: Mapping[str, str],
    seconds: Mapping[str, float],
    seed: int,
) -> Board:
    """Rows in order of their scores, and what was measured."""
    half, models = parts[0][0], {entry.key: entry for entry in entries}
    score = {key: float(np.exp(np.mean(np.log(values)))) for key, values in by_half.items()}
    order = sorted(score, key=lambda key: score[key])
    places, differ = ranks(drawn), differing_pairs(score, drawn)
    groups, agreement = rank_groups(score, differ), agreeing(differ, by_half)
    free = ranked_numbers(half.windows)[-1][0]
    shown = np.unique(np.linspace(0, len(half.windows[SHORT]) - 1, EXAMPLES).astype(np.int64))
    rows = []
    for rank, key in enumerate(order, start=1):
        low, high = _interval(score[key], drawn[key])
        best, worst = np.quantile(places[key], QUANTILES)
        sampled, model = parts[0][1][key], models[key]
        curves = sampled.features[free][0]
        rows.append(
            Row(
                key=key,
                title=model.title,
                source=model.source,
                departures=model.departures,
                settings=sampled.settings,
                numbers=numbers[key],
                variance=sampled.variance,
                score=score[key],
                low=low,
                high=high,
                rank=rank,
                best_rank=int(np.floor(best)),
                worst_rank=int(np.ceil(worst)),
                group=groups[key],
                scores_by_half=tuple(by_half[key].tolist()),
                example=sampled.ensemble[shown, 0],
                spectrum=curves.power.mean(axis=0),
                autocorrelation=autocorrelation_of(curves, np.arange(len(curves))),
            )
        )
    real, windows = half.features[free.seconds], half.windows[SHORT]
    count = real.products.shape[1]
    bands = resolved_bands(half.windows[free.seconds].offset.shape[1] * STEP)
    return Board(
        rows=tuple(rows),
        absent=dict(absent),
        vehicles=len({run.drive for run in runs}),
        runs=len(runs),
        hours=sum(map(len, runs)) * STEP / 3600.0,
        windows={one.name: sum(len(h.windows[one.seconds]) for h, _ in parts) for one in half.conditions},
        unit="vehicle" if len({run.drive for run in runs}) >= FEW_DRIVES else f"block of {BLOCK_SECONDS:g} s",
        tau=kendall_tau(*np.array([by_half[key] for key in order]).T.tolist()) if len(order) > 1 else float("nan"),
        pairs_apart=agreement[0],
        pairs_agreeing=agreement[1],
        resamples=len(next(iter(drawn.values()))),
        real_example=windows.offset[shown],
        real_spectrum=real.power.mean(axis=0),
        frequency=np.sqrt([low * high for low, high in bands]),
        real_autocorrelation=autocorrelation_of(real, np.arange(len(real))),
        lags=np.array(LAGS[:count]),
        real_variance=variance_parts(windows.offset, np.array([str(number) for number, _ in windows.place])),
        seed=seed,
        seconds=dict(seconds),
    )


def _interval(score: float, drawn: FloatArray) -> tuple[float, float]:
    """Of a score, 95 %, from its resamples, shape (n,). [-]"""
    # Distances of a resample are larger than those of the sample itself, the more so the nearer a model is to real
    # driving: the spread of the resamples is laid about the score instead of about their own, too large mean.
    spread = np.log(drawn)
    low, high = score * np.exp(np.quantile(spread, QUANTILES) - spread.mean())

    return float(low), float(high)
