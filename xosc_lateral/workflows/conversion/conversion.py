"""A converted scenario: what `convert` gives back."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import structs

from xosc_lateral.base.grouping import grouped
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.plugins import service
from xosc_lateral.base.texts import counted
from xosc_lateral.drivers.model.profile import SIDES, UNMEASURED_RESPONSES, Basis
from xosc_lateral.files.atomic import together
from xosc_lateral.files.output_paths import claim, label_files, output_file
from xosc_lateral.workflows.conversion.result import MODE_WORDS, ConvertedScenario
from xosc_lateral.workflows.result import PathLike, Result, write_page
from xosc_lateral.world.motion.nominal import Activity

if TYPE_CHECKING:
    from xosc_lateral.files.pages.figure import Figure


_PLACE = ("what", "path", "line", "element")


class Conversion(ConvertedScenario, Result):
    """A converted scenario, with what there is to see of it: words, table, figure, traces, page."""

    __slots__ = ()

    def headline(self) -> str:
        """One line."""
        where = self.source.name if self.output is None else f"{self.source.name} -> {self.output}"
        warned = f", {len(self.warnings)} warnings" if self.warnings else ""
        return f"{where}: {len(self.enriched)} of {len(self.entities)} entities enriched{warned}"

    def __str__(self) -> str:
        lines = [f"{self.output or self.source}"]
        lines.append(f"  {self.under_test}")
        for entity in self.movement.entities:
            if entity.is_enriched and entity.profile is not None:
                mode = self.provenance.modes.get(entity.name, "")
                lines.append(
                    f"  {entity.name}: {counted(len(entity.segments), 'segment')}, {entity.segment_seconds:.1f} s, "
                    f"offsets {entity.offset_spread:.2f} m (standard deviation), profile {entity.profile.name}, "
                    f"as {MODE_WORDS.get(mode, mode)}"
                )
            elif entity.name not in self.egos:  # those are told
                lines.append(f"  {entity.name}: as in the scenario ({entity.why})")
        neighbours = self.provenance.options["neighbours"]
        alike = grouped((one.beside(neighbours), one.name) for one in self.movement.entities if one.is_enriched)
        lines += [
            f"  {', '.join(names)}, {words}"
            for words, names in alike.items()
            if UNMEASURED_RESPONSES[Basis.POPULATION] not in words  # what is usual
        ]
        if self.provenance.options["with_sensor"]:
            lines.append("  offsets include the sensor error of the drives that the profiles were fitted to")
        lines += self.message_lines()
        if self.report is not None:
            lines.append(f"report: {self.report}")
        return "\n".join(lines)

    def to_frame(self) -> pd.DataFrame:
        """One row per entity and step (of those that exist then): where it is, and how far from where it nominally was.

        Columns: `time` [s], `name`, `x`, `y`, `z` [m], `h` [rad], `speed` [m/s], `road`, `lane` (nominal), `offset`
        (from the middle of that lane, positive left) [m], `deviation` (what enriching added) [m], `x_nominal`,
        `y_nominal` [m].
        """
        ids = np.array([*self.movement.network.road_ids, ""], dtype=object)
        frames = []
        for number, entity in enumerate(self.movement.entities):
            motion, path = entity.motion, entity.trajectory
            frame = pd.DataFrame(
                {
                    "time": motion.time,
                    "name": motion.name,
                    "x": path.x,
                    "y": path.y,
                    "z": path.z,
                    "h": path.heading,
                    "speed": path.speed,
                    "road": ids[motion.road],
                    "lane": motion.lane,
                    "offset": motion.offset + entity.deviation,
                    "deviation": entity.deviation,
                    "x_nominal": motion.x,
                    "y_nominal": motion.y,
                    "entity": number,
                }
            )
            frames.append(frame[(motion.activity & Activity.ACTIVE) != 0])
        rows = pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=["time", "entity"])
        return rows.sort_values(["time", "entity"], kind="stable", ignore_index=True).drop(columns="entity")

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them, rounded to what they are read for: a micrometre, a microsecond."""
        enriched = self.movement
        before, after = (None if gap is None else round(gap, 6) for gap in self.smallest_gap)
        made = self.provenance.profiles.items()
        profiles = {name: {"name": profile, "sha256": sha} for name, (profile, sha) in made}
        return {
            "source": str(self.source),
            "output": None if self.output is None else str(self.output),
            "report": None if self.report is None else str(self.report),
            "sha256": self.sha256,
            "end_time": round(enriched.motion.end_time, 6),
            "ended_by": enriched.motion.ended_by,
            "ego": list(self.provenance.ego),
            "controllers": {
                name: {"controllers": list(control.controllers), "drives": control.domains.words()}
                for name, control in self.controllers.items()
            },
            "entities": [
                {
                    "name": entity.name,
                    "profile": entity.profile.name if entity.is_enriched and entity.profile is not None else None,
                    "why_not": entity.why,
                    "neighbours": None
                    if entity.profile is None
                    else {side: entity.profile.basis_of(side).value for side in SIDES},
                    "mode": self.provenance.modes.get(entity.name),
                    "segments": [
                        [round(segment.span.start, 6), round(segment.span.end, 6)] for segment in entity.segments
                    ],
                    "offset_spread": round(entity.offset_spread, 6),
                    "neutral_context": list(entity.neutral),
                }
                for entity in enriched.entities
            ],
            "gap_before": before,
            "gap_after": after,
            "shifts": [
                {
                    name: round(value, 6) if isinstance(value, float) else value
                    for name, value in structs.asdict(one).items()
                }
                for one in self.shifts
            ],
            "notes": [{key: one.to_dict()[key] for key in _PLACE} for one in enriched.motion.notes],
            "warnings": list(self.warnings),
            "messages": self.message_records(),
            "provenance": asdict(self.provenance) | {"profiles": profiles},
        }

    def plot(self) -> Figure | None:
        """Nominal beside enriched paths, across the road over along it; None when no entity is on a road."""
        from xosc_lateral.workflows.playing.figures import paths_stretched

        return paths_stretched(self.movement)

    def write_osi(self, path: PathLike, *, force: bool = False) -> tuple[Path, Path]:
        """Write two ASAM OSI traces (extra `osi`), enriched and, as ``NAME_nominal``, what the maneuvers alone give.

        Returns
        -------
        tuple of Path
            The two files: ``.mcap`` or ``.osi``, one `GroundTruth` per step.
        """

        enriched, nominal = outputs = osi_files(path, self.source)
        claim(outputs, [self.source], force=force)
        made = self.movement
        host = next(iter(self.ego), None)
        words = f"{self.source.name}, enriched by xosc-lateral, seed {made.seed}, variant {made.variant + 1}"
        paths = [entity.trajectory for entity in made.entities]
        nominal_words = f"{self.source.name}, as its maneuvers say"
        with together():
            service("write_osi")(enriched, made.motion, made.network, paths, host=host, description=words)
            service("write_osi")(nominal, made.motion, made.network, host=host, description=nominal_words)
        return outputs

    def write_image(self, path: PathLike, at: float | None = None, *, force: bool = False) -> Path:
        """Write a moment from above, dashed as written, as ``.svg`` or ``.png`` (extra `pictures`); `at`: half. [s]"""
        from xosc_lateral.workflows.playing.picture import write_image
        from xosc_lateral.workflows.playing.scene import scene_of

        scene = scene_of(self.movement.motion, self.movement.network, self.movement.entities)
        return write_image(scene, path, at, usual_name=self.source.stem, inputs=[self.source], force=force)

    def write_summary(self, path: PathLike, *, force: bool = False) -> Path:
        """Write Markdown with the numbers, and beside it the two pictures that it shows."""
        from xosc_lateral.files.atomic import write_atomically
        from xosc_lateral.workflows.conversion.summary import SUMMARY_SUFFIXES, pictures_beside, summary_of

        output = output_file(path, f"{(self.output or self.source).stem}.md", SUMMARY_SUFFIXES)
        claim([output, *pictures_beside(output)], [self.source], force=force)
        with together():
            for file, text in summary_of(self, output).items():
                write_atomically(file, text)
        return output

    def write_labels(self, beside: PathLike, *, force: bool = False) -> tuple[Path, Path]:
        """Write OpenLABEL tags and an ASAM quality result beside an output: ``NAME.openlabel.json``, ``NAME.xqar``."""
        from xosc_lateral.files.atomic import write_atomically

        tags, quality = label_files(Path(beside))
        claim([tags, quality], [self.source], force=force)
        with together():
            return (
                write_atomically(tags, service("openlabel")(self)),
                write_atomically(quality, service("quality_result")(self)),
            )

    def write_report(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the HTML page about what was changed."""
        from xosc_lateral.workflows.conversion.page import conversion_page

        name = f"{(self.output or self.source).stem}.html"
        self.report = write_page(path, name, lambda: conversion_page(self), inputs=[self.source], force=force)
        return self.report


def osi_files(output: PathLike, source: Path) -> tuple[Path, Path]:
    """Files of the enriched and of the nominal trace; an output that is a folder gets a usual name."""
    from xosc_lateral.files.osi import SUFFIXES

    enriched = output_file(output, f"{source.stem}_gt.mcap", SUFFIXES)
    return enriched, enriched.with_name(f"{enriched.stem}_nominal{enriched.suffix}")
