"""`variant_set`: converted variants of one scenario as a logical scenario with its distribution."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from xosc_lateral.api.inputs import PathLike
from xosc_lateral.formats.openscenario.write import Player, VariantFiles, write_variant_set
from xosc_lateral.formats.targets import claim
from xosc_lateral.pipeline.settings import Mode


class VariantSet:
    """Files of a set: the logical scenario, its catalog of trajectories, and the distribution of its parameters."""

    __slots__ = ("catalog", "distribution", "logical")

    def __init__(self, files: VariantFiles) -> None:
        self.logical, self.catalog, self.distribution = files

    def __str__(self) -> str:
        return f"set: {self.distribution} of {self.logical.name}"


def variant_files(output: Path, variants: int, mode: str, player: str) -> VariantFiles | None:
    """Files of the set that goes with variants of an output; None where there is none.

    Lane offset actions differ in number from variant to variant, and ScenarioRunner reads no distributions.
    """
    if variants < 2 or mode == Mode.LANE_OFFSET.value or player == Player.CARLA.value:
        return None
    return VariantFiles.beside(output)


def variant_set(variants: Sequence[PathLike], output: PathLike, *, source: PathLike, force: bool = False) -> VariantSet:
    """Write variants of one scenario as one logical scenario, from which other tools can draw.

    Parameters
    ----------
    variants : sequence of paths
        Converted scenarios (mode "trajectory"), all in the folder of `output`.
    output : str or Path
        ``x.xosc``: the set is written to ``x_set.xosc``, ``x_trajectories.xosc`` and ``x_distribution.xosc``.
    source : str or Path
        The scenario that they were made from: `convert` of the distribution makes the same variants from it.
    force : bool
        Replace files that this package did not write.

    Raises
    ------
    FormatError
        The files are not variants of one scenario.
    """
    paths = [Path(path) for path in variants]
    files = VariantFiles.beside(Path(output))
    claim(files, paths, force=force)
    where = Path(os.path.relpath(Path(source).absolute(), files.logical.parent.absolute())).as_posix()
    write_variant_set(paths, files, where)
    return VariantSet(files)
