"""`variant_set`: converted variants of one scenario as a logical scenario with its distribution."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

from xosc_lateral.api.inputs import PathLike
from xosc_lateral.formats.openscenario.write import Player, VariantFiles, write_variant_set
from xosc_lateral.formats.output_paths import claim
from xosc_lateral.pipeline.settings import OutputMode


class VariantSet:
    """Files of a set: the logical scenario, the folder of its trajectories, and two distributions of its parameter.

    `distribution` has every variant once, `stochastic` draws among them.
    """

    __slots__ = ("distribution", "folder", "logical", "stochastic")

    def __init__(self, files: VariantFiles) -> None:
        self.logical, self.folder = files.logical, files.folder
        self.distribution, self.stochastic = files.distribution, files.stochastic

    def __str__(self) -> str:
        return f"set: {self.distribution} of {self.logical.name}, {self.stochastic.name} to draw from it"


def variant_files(output: Path, variants: int, mode: str, player: str) -> VariantFiles | None:
    """Files of the set that goes with variants of an output; None where there is none.

    Lane offset actions differ in number from variant to variant, and ScenarioRunner reads no distributions.
    """
    if variants < 2 or mode == OutputMode.LANE_OFFSET.value or player == Player.CARLA.value:
        return None
    return VariantFiles.beside(output)


def variant_set(
    variants: Sequence[PathLike],
    output: PathLike,
    *,
    source: PathLike,
    weights: Sequence[float] | None = None,
    force: bool = False,
) -> VariantSet:
    """Write variants of one scenario as one logical scenario, from which other tools can draw.

    Parameters
    ----------
    variants : sequence of paths
        Converted scenarios (mode "trajectory"), all in the folder of `output`.
    output : str or Path
        ``x.xosc``: the set is written to ``x_set.xosc``, ``x_trajectories/``, ``x_distribution.xosc`` (every variant
        once) and ``x_stochastic.xosc`` (as many draws as there are variants).
    source : str or Path
        The scenario that they were made from: `convert` of the distribution makes the same variants from it.
    weights : sequence of float, optional
        How probable each variant is in the stochastic distribution, in any unit, such as the share of its driver; alike
        by default, since a variant is sampled as probable as it is.
    force : bool
        Replace files that this package did not write.

    Raises
    ------
    FormatError
        The files are not variants of one scenario.
    ValueError
        Weights that are negative, all zero, or not one per variant.
    """
    paths = [Path(path) for path in variants]
    files = VariantFiles.beside(Path(output))
    if weights is not None and (len(weights) != len(paths) or min(weights) < 0 or not 0 < sum(weights) < math.inf):
        raise ValueError(f"weights: one per variant ({len(paths)}), not negative and not all zero, got {list(weights)}")
    claim(files.all(len(paths)), paths, force=force)
    where = Path(os.path.relpath(Path(source).absolute(), files.logical.parent.absolute())).as_posix()
    write_variant_set(paths, files, where, weights=weights)
    return VariantSet(files)
