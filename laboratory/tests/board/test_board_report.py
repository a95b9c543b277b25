"""The board in words, tables and pictures: every number that is shown is the board's."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from laboratory.board.record import board_record
from laboratory.board.result import Board, ModelScore, Row
from laboratory.board.text import board_markdown, board_text, headline, shown_columns
from xosc_lateral.drivers.evaluation.realism import VarianceParts

PARTS = VarianceParts(0.04, 0.02, 0.01)


def row(key: str, rank: int, score: float, **more: object) -> Row:
    numbers = (
        ModelScore("metrics, 10 s, same start", "sd", 0.31 * score, 0.31, ranked=True),
        ModelScore("energy score, 10 s", "m", 12.3456, 0.2),
        ModelScore("sdlp, 10 s, same start", "sd", 0.7, 0.1),
    )
    values = {
        "key": key, "title": f"{key} & <co>", "source": f"{key} et al.", "departures": "",
        "settings": {"a_m": 0.123456},
        "numbers": numbers, "variance": PARTS, "score": score, "low": 0.9 * score, "high": 1.1 * score, "rank": rank,
        "best_rank": rank, "worst_rank": rank, "group": rank, "scores_by_half": (0.95 * score, 1.05 * score),
        "example": np.full((2, 51), 0.1 * rank), "spectrum": np.full(3, 0.01 * rank),
        "autocorrelation": np.full(2, 0.9),
    }  # fmt: skip
    return Row(**{**values, **more})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def board() -> Board:
    rows = (row("first", 1, 1.5), row("second", 2, 2.25, worst_rank=3), row("third", 3, 12.0, best_rank=2))
    return Board(
        rows=rows, absent={"sumo": "SUMO is not installed"}, vehicles=40, runs=55, hours=1.25, windows={"10 s": 400},
        unit="vehicle", tau=1.0 / 3.0, pairs_apart=2, pairs_agreeing=1, resamples=200,
        real_example=np.zeros((2, 51)), real_spectrum=np.full(3, 0.02),
        frequency=np.array([0.05, 0.2, 0.8]), real_autocorrelation=np.array([0.95, 0.8]), lags=np.array([1.0, 2.0]),
        real_variance=PARTS, seed=7,
    )  # fmt: skip


def test_the_terminal_has_a_line_for_each_model_and_one_for_each_that_is_absent(board):
    lines = board_text(board).splitlines()
    assert lines[0] == headline(board)
    assert "first & <co> first with 1.50 times the floor" in lines[0] and "1.25 h of 40 drives" in lines[0]
    assert re.split(r"\s{2,}", lines[3].strip()) == ["2", "second & <co>", "2.25", "2.02 - 2.48", "2-3", "2"]
    assert lines[-1] == "not on the board: sumo (SUMO is not installed)"
    assert len(lines) == 2 + 3 + 1


def test_the_record_is_json_without_nan_and_holds_what_the_board_does(board):
    lonely = replace(board, rows=board.rows[:1], tau=float("nan"))
    assert json.loads(json.dumps(board_record(lonely, {}), allow_nan=False))["kendall_tau_between_halves"] is None
    record = json.loads(json.dumps(board_record(board, {"d.csv": "ab"}), allow_nan=False))
    assert record["seed"] == 7 and record["inputs"] == {"d.csv": "ab"}
    assert record["kendall_tau_between_halves"] == 0.33333
    second = record["models"][1]
    assert (second["name"], second["rank"], second["rank_interval"]) == ("second", 2, [2, 3])
    assert second["group"] == 2 and (record["pairs_told_apart"], record["pairs_that_both_halves_agree_on"]) == (2, 1)
    assert second["score_by_half"] == pytest.approx([0.95 * 2.25, 1.05 * 2.25], rel=1e-4)
    assert second["numbers"]["metrics, 10 s, same start"] == {
        "value": 0.6975, "floor": 0.31, "unit": "sd", "ranked": True}  # fmt: skip
    assert second["fitted"] == {"a_m": 0.12346}


def test_tables_show_what_is_ranked_and_proper_scores_and_no_single_metric(board):
    assert shown_columns(board) == {
        "metrics, 10 s, same start": "ten metrics, 10 s, same start [sd]",
        "energy score, 10 s": "energy score, 10 s [m]",
    }
    page = board_markdown(board)
    assert "0.465" in page and "12.3" in page and "0.700" not in page  # 1.5 floors of 0.31; a score; a single metric
    assert "sumo" in page


def test_a_model_that_lacks_a_number_has_an_empty_place_for_it(board):
    """A classifier needs windows enough: one model may go without."""
    area = ModelScore("auc, 10 s, same start", "-", 0.71, 0.5)
    rows = (replace(board.rows[0], numbers=(*board.rows[0].numbers, area)), *board.rows[1:])
    partial = replace(board, rows=rows)
    assert "classifier, 10 s, same start" in board_markdown(partial)
    assert "0.710" in board_markdown(partial)
