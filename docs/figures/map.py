"""Draw the map of CONTRIBUTING from the imports: a part per box, all imports point down (`make map`)."""

from __future__ import annotations

import sys
import tomllib
from collections import defaultdict
from html import escape
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[2]
RULES = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
LAYERS = [layer.split(" | ") for layer in RULES[0]["layers"]]
RANKS = {name: k for k, layer in enumerate(LAYERS) for name in layer}

TEXT = {
    "extras": "recordings, loop, live, detect, dossier",
    "base": "errors, limits, arrays, rows",
    "world": "plays a scenario",
    "drivers": "know how people drive",
    "files": "read and write",
    "workflows": "a room for every verb",
    "cli": "names the verbs",
}
WIDTH, HEIGHT, GAP_X, GAP_Y, MARGIN = 270, 44, 24, 40, 16  # [px]
FONT = "font-family='sans-serif'"


def parts() -> dict[str, set[str]]:
    """Every folder of the package, and the folders that it imports."""
    graph = grimp.build_graph("xosc_lateral", exclude_type_checking_imports=True, cache_dir=None)
    found = {name: set[str]() for name in TEXT}
    for name, wanted in found.items():
        inside = {f"xosc_lateral.{name}", *graph.find_descendants(f"xosc_lateral.{name}")}
        met = {one for module in inside for one in graph.find_modules_directly_imported_by(module)}
        wanted |= {one.split(".")[1] for one in met if "." in one} & TEXT.keys() - {name}
    return found


def shown_edges(graph: dict[str, set[str]]) -> list[tuple[str, str]]:
    """Imports that no longer way of imports gives as well: fewer lines, the same order."""

    def reached(name: str) -> set[str]:
        return {far for near in graph[name] for far in {near, *reached(near)}}

    return [
        (name, near)
        for name, wanted in sorted(graph.items())
        for near in sorted(wanted)
        if not any(near in reached(other) for other in wanted - {near})
    ]


def drawing(graph: dict[str, set[str]]) -> str:
    """The map as SVG."""
    rows: dict[int, list[str]] = defaultdict(list)
    for name in sorted(graph):
        rows[RANKS[name]].append(name)
    ranks = sorted(rows)
    across = max(len(row) for row in rows.values())
    total = 2 * MARGIN + across * WIDTH + (across - 1) * GAP_X, 2 * MARGIN + len(ranks) * (HEIGHT + GAP_Y) - GAP_Y
    corner = {}
    for k, rank in enumerate(ranks):
        left = (total[0] - len(rows[rank]) * WIDTH - (len(rows[rank]) - 1) * GAP_X) / 2
        for i, name in enumerate(rows[rank]):
            corner[name] = left + i * (WIDTH + GAP_X), MARGIN + k * (HEIGHT + GAP_Y)
    lines = [
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {total[0]:g} {total[1]:g}' width='{total[0]:g}'>",
        "<defs><marker id='tip' viewBox='0 0 8 8' refX='7' refY='4' markerWidth='7' markerHeight='7' orient='auto'>"
        "<path d='M0,0 L8,4 L0,8 z' fill='#68708a'/></marker></defs>",
        f"<rect width='{total[0]:g}' height='{total[1]:g}' fill='white'/>",
    ]
    for name, near in shown_edges(graph):
        (x1, y1), (x2, y2) = corner[name], corner[near]
        lines.append(
            f"<line x1='{x1 + WIDTH / 2:g}' y1='{y1 + HEIGHT:g}' x2='{x2 + WIDTH / 2:g}' y2='{y2:g}' "
            "stroke='#68708a' stroke-width='1.2' marker-end='url(#tip)'/>"
        )
    for name, (x, y) in sorted(corner.items()):
        lines += [
            f"<rect x='{x:g}' y='{y:g}' width='{WIDTH}' height='{HEIGHT}' rx='6' fill='#eef3fa' stroke='#0072b2'/>",
            f"<text x='{x + WIDTH / 2:g}' y='{y + 18:g}' {FONT} font-size='14' font-weight='bold' text-anchor='middle'>"
            f"{escape(name)}</text>",
            f"<text x='{x + WIDTH / 2:g}' y='{y + 35:g}' {FONT} font-size='12' text-anchor='middle'>"
            f"{escape(TEXT[name])}</text>",
        ]
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).with_suffix(".svg")
    target.write_text(drawing(parts()), encoding="utf-8")
