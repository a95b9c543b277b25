"""The board's table, from the board that was written.

python -m laboratory.board dlr.parquet -o board/
python -m laboratory.board_table board/board.json --write PAGE.md
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from laboratory.markers import show

SHOWN = {
    "metrics, 10 s, same start": "ten metrics, 10 s, same start [sd]",
    "metrics, 30 s, free": "ten metrics, 30 s, free [sd]",
    "lane_keeping, 30 s, free": "lane keeping, 30 s, free [sd]",
    "spectrum, 30 s, free": "spectrum, 30 s, free [dB]",
    "memory, 30 s, free": "autocorrelation, 30 s, free",
    "energy score, 10 s": "energy score, 10 s [m]",
    "variogram score, 10 s": "variogram score, 10 s [m]",
    "auc, 10 s, same start": "classifier, 10 s, same start",
    "auc, 10 s, free": "classifier, 10 s, free",
    "auc, 60 s, free": "classifier, 60 s, free",
}


def table(board: dict[str, Any]) -> str:
    names = [name for name in SHOWN if name in board["models"][0]["numbers"]]
    heads = ["", "model", "score", "95 %", "halves", "ranks", "group", *(SHOWN[name] for name in names)]
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for one in board["models"]:
        low, high = one["score_interval"]
        cells = [str(one["rank"]), one["title"], f"{one['score']:.2f}", f"{low:.2f} to {high:.2f}"]
        cells.append(" / ".join(f"{value:.2f}" for value in one["score_by_half"]))
        cells += ["-".join(map(str, sorted(set(one["rank_interval"])))), str(one["group"])]
        cells += [f"{one['numbers'][name]['value']:.3g}" for name in names]
        lines.append("| " + " | ".join(cells) + " |")
    floors = board["models"][0]["numbers"]
    bare = [
        "",
        "other real drivers (the floor)",
        "1",
        "",
        "",
        "",
        "",
        *(f"{floors[name]['floor']:.3g}" for name in names),
    ]
    data = board["data"]
    lines += [
        "| " + " | ".join(bare) + " |",
        "",
        f"{data['hours']:.2f} h of {data['drives']} vehicles, seed {board['seed']}, "
        f"{data['windows']['10 s, free']} windows of 10 s, {data['windows']['30 s, free']} of 30 s, "
        f"{board['resamples']} resamples of the vehicles.",
        "",
        f"Kendall's tau between the rankings of the two halves: {board['kendall_tau_between_halves']:.3f}. "
        f"Resampled vehicles tell {board['pairs_told_apart']} pairs of models apart, and both halves have "
        f"{board['pairs_that_both_halves_agree_on']} of them in that order; no model is told from its group's best.",
    ]
    lines += [f"\nNot on the board: {name} ({why})." for name, why in board["absent"].items()]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("board", type=Path)
    parser.add_argument("--write", type=Path, help="page with the markers")
    args = parser.parse_args()
    show(table(json.loads(args.board.read_text(encoding="utf-8"))), args.write, "board")


if __name__ == "__main__":
    main()
