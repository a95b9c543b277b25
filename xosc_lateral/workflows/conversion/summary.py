"""What a conversion did as Markdown with two pictures: for a pull request, a ticket, a chat."""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote

import numpy as np

from xosc_lateral.files.output_paths import MARKDOWN_MARK
from xosc_lateral.files.pages.page import format_value
from xosc_lateral.workflows.conversion.page import key_figures
from xosc_lateral.workflows.conversion.result import MODE_WORDS, ConvertedScenario
from xosc_lateral.workflows.playing.figures import paths_stretched
from xosc_lateral.workflows.playing.picture import PictureScene, marked
from xosc_lateral.workflows.playing.scene import scene_of

SUMMARY_SUFFIXES = (".md", ".markdown")


def pictures_beside(path: Path) -> tuple[Path, Path]:
    """Files of the two pictures of a summary: paths along the road, and a moment from above."""
    return path.with_name(f"{path.stem}_paths.svg"), path.with_name(f"{path.stem}_moment.svg")


def summary_of(conversion: ConvertedScenario, path: Path) -> dict[Path, str]:
    """Files of a summary and what is in them; the pictures are left out where nobody was enriched, or is on a road."""
    enriched = conversion.movement
    done = [entity for entity in enriched.entities if entity.is_enriched]
    made = conversion.provenance
    lines = [
        MARKDOWN_MARK,
        f"### {_cell(conversion.source.name)}: lateral movement added",
        "",
        f"{len(done)} of {len(enriched.entities)} entities, {enriched.motion.end_time:.1f} s, nominal run, seed "
        f"{made.options['seed']}, variant {made.variant}; {_cell(conversion.under_test)}.",
        "",
    ]
    tiles = key_figures(enriched, done)
    if tiles:
        lines += ["| figure | | |", "|---|---|---|"]
        lines += [f"| {_cell(one.label)} | **{format_value(one.value)}** | {_cell(one.note)} |" for one in tiles]
    lines += [
        *([""] if tiles else []),
        "| entity | written as | profile | offsets, std. deviation |",
        "|---|---|---|---|",
    ]
    for entity in enriched.entities:
        if entity.is_enriched and entity.profile is not None:
            mode = made.modes.get(entity.name, "")
            cells = (entity.name, MODE_WORDS.get(mode, mode), entity.profile.name, f"{entity.offset_spread:.2f} m")
        else:
            cells = (entity.name, f"as it was: {entity.why}", "", "")
        lines.append(f"| {' | '.join(map(_cell, cells))} |")
    if conversion.warnings:
        lines += ["", *(f"- :warning: {_cell(warning)}" for warning in conversion.warnings)]
    pictures = dict[Path, str]()
    paths, moment = pictures_beside(path)
    figure = paths_stretched(enriched) if done else None
    if figure is not None:
        pictures[paths] = marked(figure.svg())
        farthest = max(done, key=lambda entity: float(np.abs(entity.deviation).max()))
        time = float(farthest.motion.time[np.argmax(np.abs(farthest.deviation))])
        scene = PictureScene(scene_of(enriched.motion, enriched.network, enriched.entities))
        pictures[moment] = marked(scene.picture(time, farthest.name).svg())
        what = f"{_cell(farthest.name)} at {time:.1f} s, farthest from where it was written (dashed)"
        lines += ["", f"![Paths, dashed as written]({quote(paths.name)})", "", f"{what}:", ""]
        lines.append(f"![From above]({quote(moment.name)})")
    return {path: "\n".join([*lines, ""]), **pictures}


def _cell(text: str) -> str:
    """Text that is no markup: names of a scenario are anybody's."""
    kept = "".join(f"\\{sign}" if sign in "\\`*_[]|#!" else sign for sign in " ".join(text.split()))
    return kept.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
