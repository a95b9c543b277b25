"""What `convert` does with more than one scenario."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from xosc_lateral.pipeline.settings import ConvertSettings


def is_batch(inputs: Sequence[str]) -> bool:
    """Whether the inputs stand for more than one scenario: several, a folder, a glob, a table, a distribution."""
    from xosc_lateral.pipeline.request import is_single

    return len(inputs) != 1 or not is_single(inputs[0])


def convert_batch(
    inputs: Sequence[str],
    output: Path | None,
    settings: ConvertSettings,
    *,
    variants: int,
    jobs: int,
    cluster: str | None,
    display: str,
    as_json: bool,
) -> None:
    """Convert all of them; exit code 1 if any failed."""
    from xosc_lateral.pipeline.batch import convert_many
    from xosc_lateral.pipeline.jobs import plan_batch
    from xosc_lateral.pipeline.progress import Display, follow

    if output is None:
        raise typer.BadParameter("several scenarios need a folder for their outputs: -o FOLDER")
    batch = plan_batch(inputs, output, settings, variants=variants)
    summary = follow(convert_many(batch, workers=jobs, cluster=cluster), len(batch), Display(display))
    if as_json:
        typer.echo(json.dumps({"folder": str(batch.folder), "left_out": len(batch.left_out), **asdict(summary)}))
    else:
        kinds = Counter(kind.value for _, kind in batch.left_out)
        left_out = ", ".join(f"{count} {kind}{'s' if count > 1 else ''}" for kind, count in kinds.items())
        typer.echo(f"{output}: {summary.text()}{f'; left out: {left_out}' if left_out else ''}")
    if summary.failed:
        raise typer.Exit(1)
