"""The board of in-lane realism as strict JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from xosc_lateral.base.arrays import significant
from xosc_lateral.base.version import __version__

if TYPE_CHECKING:
    from laboratory.board.result import Board, ModelScore, Row
    from xosc_lateral.drivers.evaluation.realism import VarianceParts
from laboratory.board.text import method_text


def board_record(board: Board, inputs: Mapping[str, str]) -> dict[str, Any]:
    """Plain JSON values: all numbers, floors, intervals, sources."""
    return {
        "made_by": f"xosc-lateral {__version__}",
        "seed": board.seed,
        "inputs": dict(inputs),
        "method": method_text(board),
        "data": _data_record(board),
        "kendall_tau_between_halves": _short(board.tau),
        "pairs_told_apart": board.pairs_apart,
        "pairs_that_both_halves_agree_on": board.pairs_agreeing,
        "resamples": board.resamples,
        "models": [_row_record(row) for row in board.rows],
        "absent": dict(board.absent),
    }


def _data_record(board: Board) -> dict[str, Any]:
    return {
        "drives": board.vehicles,
        "runs": board.runs,
        "hours": round(board.hours, 4),
        "windows": dict(board.windows),
        "unit": board.unit,
        "variance_m2": _variance(board.real_variance),
    }


def _row_record(row: Row) -> dict[str, Any]:
    return {
        "name": row.key,
        "title": row.title,
        "source": row.source,
        "departures": row.departures,
        "fitted": {name: _short(value) for name, value in row.settings.items()},
        "rank": row.rank,
        "rank_interval": [row.best_rank, row.worst_rank],
        "group": row.group,
        "score": _short(row.score),
        "score_interval": [_short(row.low), _short(row.high)],
        "score_by_half": [_short(value) for value in row.scores_by_half],
        "variance_m2": _variance(row.variance),
        "numbers": {number.name: _number_record(number) for number in row.numbers},
    }


def _number_record(number: ModelScore) -> dict[str, Any]:
    return {
        "value": _short(number.value),
        "floor": _short(number.floor),
        "unit": number.unit,
        "ranked": number.ranked,
    }


def _variance(parts: VarianceParts) -> dict[str, float | None]:
    return {"between": _short(parts.between), "within": _short(parts.within), "inside": _short(parts.inside)}


def _short(value: float) -> float | None:
    return None if value != value else significant(value, 5)
