"""The board of in-lane realism as a page with pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from xosc_lateral.report.render import KeyFigure, render_page

if TYPE_CHECKING:
    from xosc_lateral.board.result import Board
from xosc_lateral.report.board import headline, known_number, method_text, shown_columns


def board_page(board: Board, inputs: Mapping[str, str]) -> str:
    """HTML page: ranking, pictures, all numbers, sources; same board, same bytes."""
    from xosc_lateral.report import board_figures as figures

    first = board.rows[0]
    return render_page(
        "board.html",
        title="Board of in-lane realism",
        provenance={"seed": board.seed, "inputs": dict(inputs), "resamples": board.resamples},
        board=board,
        figures=figures,
        headline=f"{headline(board)}.",
        method=method_text(board),
        seconds=figures.STEP * (len(board.real_example[0]) - 1),
        numbers=[
            KeyFigure(
                f"{first.score:.2f}", first.title, f"95 %: {first.low:.2f} to {first.high:.2f}; 1: as other drivers"
            ),
            KeyFigure(
                f"{board.tau:.2f}",
                "Kendall's tau",
                f"between the halves, which agree on {board.pairs_agreeing} of {board.pairs_apart} clear pairs",
            ),
            KeyFigure(f"{board.hours:.1f} h", f"{board.vehicles} drives", f"{sum(board.windows.values())} windows"),
        ],
        number_rows=_number_rows(board),
        variance_rows=[
            {"": name, "between": parts.between, "within": parts.within, "inside": parts.inside}
            for name, parts in (("measured", board.real_variance), *((row.title, row.variance) for row in board.rows))
        ],
        source_rows=[{"model": row.title, "source": row.source, "departures": row.departures} for row in board.rows],
    )


def _number_rows(board: Board) -> list[dict[str, object]]:
    """A row per model, and the floors below them."""
    columns = shown_columns(board)
    rows: list[dict[str, object]] = [
        {"": row.rank, "group": row.group, "model": row.title, "score": round(row.score, 3)}
        | {head: number.value if (number := known_number(row, name)) else None for name, head in columns.items()}
        for row in board.rows
    ]
    floor: dict[str, object] = {"": None, "model": "floor: other real drivers", "score": 1.0}
    return [*rows, floor | {head: board.rows[0].number(name).floor for name, head in columns.items()}]
