"""The board of in-lane realism as text, JSON, Markdown and a page with pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from xosc_lateral.report.render import KeyFigure, render_page, render_text
from xosc_lateral.version import __version__

if TYPE_CHECKING:
    from xosc_lateral.board.result import Board, ModelScore, Row
    from xosc_lateral.evaluation.variance import VarianceParts

FAMILIES = {
    "metrics": "ten metrics",
    "lane_keeping": "lane keeping",
    "spectrum": "spectrum",
    "memory": "autocorrelation",
    "auc": "classifier",
}


def board_text(board: Board) -> str:
    """A table for the terminal."""
    width = max(len(row.title) for row in board.rows)
    lines = [headline(board), f"{'':4}{'model':<{width}}  score  95 % interval  rank"]
    for row in board.rows:
        places = f"{row.best_rank}-{row.worst_rank}" if row.best_rank < row.worst_rank else f"{row.best_rank}"
        span = f"{row.low:6.2f} - {row.high:<6.2f}"
        lines.append(f"{row.rank:>2}  {row.title:<{width}}  {row.score:5.2f}  {span}  {places}")
    lines += [f"not on the board: {key} ({why})" for key, why in board.absent.items()]
    return "\n".join(lines)


def headline(board: Board) -> str:
    """One line."""
    first = board.rows[0]
    return (
        f"{len(board.rows)} models on {board.hours:.2f} h of {board.vehicles} drives: {first.title} first with "
        f"{first.score:.2f} times the floor; rank correlation between the two halves {board.tau:.2f}"
    )


def board_record(board: Board, inputs: Mapping[str, str]) -> dict[str, Any]:
    """Plain JSON values: all numbers, floors, intervals, sources."""
    return {
        "made_by": f"xosc-lateral {__version__}",
        "seed": board.seed,
        "inputs": dict(inputs),
        "method": _method(board),
        "data": {
            "drives": board.vehicles,
            "runs": board.runs,
            "hours": round(board.hours, 4),
            "windows": dict(board.windows),
            "unit": board.unit,
            "variance_m2": _variance(board.real_variance),
        },
        "kendall_tau_between_halves": _short(board.tau),
        "resamples": board.resamples,
        "models": [_row_record(row) for row in board.rows],
        "absent": dict(board.absent),
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
        "score": _short(row.score),
        "score_interval": [_short(row.low), _short(row.high)],
        "score_by_half": [_short(value) for value in row.scores_by_half],
        "variance_m2": _variance(row.variance),
        "numbers": {
            number.name: {
                "value": _short(number.value),
                "floor": _short(number.floor),
                "unit": number.unit,
                "ranked": number.ranked,
            }
            for number in row.numbers
        },
    }


def _variance(parts: VarianceParts) -> dict[str, float | None]:
    return {"between": _short(parts.between), "within": _short(parts.within), "inside": _short(parts.inside)}


def _short(value: float) -> float | None:
    return None if value != value else float(f"{value:.5g}")


def board_markdown(board: Board) -> str:
    """The ranking and the sources, for a document."""
    columns = shown_columns(board)
    return render_text(
        "board.md",
        board=board,
        method=_method(board),
        columns=list(columns.values()),
        ranking=[(row, [_cell(row, name) for name in columns]) for row in board.rows],
        floors=[f"{head} {board.rows[0].number(name).floor:.3f}" for name, head in columns.items()],
        fitted=lambda row: ", ".join(f"{name} {value:.3g}" for name, value in row.settings.items()),
    )


def _method(board: Board) -> str:
    n_ranked = sum(number.ranked for number in board.rows[0].numbers)
    return render_text("board_method.md", n_ranked=n_ranked).strip()


def shown_columns(board: Board) -> dict[str, str]:
    """Numbers that the table shows: what is ranked, proper scores and classifiers; name -> heading."""
    found = {}
    for number in board.rows[0].numbers:
        head, _, condition = number.name.partition(", ")
        if number.ranked or head == "auc" or "score" in head:
            unit = "" if number.unit == "-" else f" [{number.unit}]"
            found[number.name] = f"{FAMILIES.get(head, head)}, {condition}{unit}"
    return found


def _cell(row: Row, name: str) -> str:
    number = next((one for one in row.numbers if one.name == name), None)
    return "" if number is None else _value(number)


def _value(number: ModelScore) -> str:
    return f"{number.value:.3f}" if number.value < 10 else f"{number.value:.1f}"


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
        method=_method(board),
        seconds=figures.STEP * (len(board.real_example[0]) - 1),
        numbers=[
            KeyFigure(
                f"{first.score:.2f}", first.title, f"95 %: {first.low:.2f} to {first.high:.2f}; 1: as other drivers"
            ),
            KeyFigure(f"{board.tau:.2f}", "Kendall's tau", "between the rankings of the two halves"),
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
        {"": row.rank, "model": row.title, "score": round(row.score, 3)}
        | {head: row.number(name).value for name, head in columns.items()}
        for row in board.rows
    ]
    floor: dict[str, object] = {"": None, "model": "floor: other real drivers", "score": 1.0}
    return [*rows, floor | {head: board.rows[0].number(name).floor for name, head in columns.items()}]
