"""Files around a set of variants: catalogs of trajectories, and distributions of the parameter that chooses one."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from xosc_lateral.formats.openscenario.provenance import HEADER_MARK
from xosc_lateral.formats.openscenario.write import build

_NAME = re.compile(r"variant_(\d+)")


@dataclass(frozen=True, slots=True)
class VariantFiles:
    """Names of the files of a set.

    Parameters
    ----------
    logical, distribution, stochastic : Path
    folder : Path
        Of the catalogs, one per variant.
    """

    logical: Path
    distribution: Path
    stochastic: Path
    folder: Path

    @classmethod
    def beside(cls, output: Path) -> VariantFiles:
        """For variants that are called like an output, with numbers."""
        parts = ("set.xosc", "distribution.xosc", "stochastic.xosc", "trajectories")
        return cls(*(output.with_name(f"{output.stem}_{part}") for part in parts))

    def catalog(self, name: str) -> Path:
        """Of the trajectories of one variant: players look for a catalog in a file of its name."""
        return self.folder / f"{name}.xosc"

    def all(self, variants: int) -> Iterator[Path]:
        """One after another."""
        yield from (self.logical, self.distribution, self.stochastic)
        yield from (self.catalog(variant_name(k, variants)) for k in range(variants))


def variant_name(index: int, variants: int) -> str:
    """What the parameter says of a variant, counted from 0: the name of its catalog."""
    return f"variant_{index + 1:0{max(2, len(str(variants)))}d}"


def variant_index(name: str) -> int | None:
    """Which variant a value of the parameter means, counted from 0; None if it means none."""
    found = _NAME.fullmatch(name)
    return int(found[1]) - 1 if found and int(found[1]) > 0 else None


def catalog(name: str, entries: Sequence[etree._Element], version: build.Version, summary: str) -> bytes:
    """A catalog of trajectories."""
    root = _file(version, "trajectories", summary)
    build.sub(root, "Catalog", name=name).extend(entries)
    etree.indent(root)
    return build.document(root)


@dataclass(frozen=True, slots=True)
class Drawn:
    """A parameter and the names that it takes in a logical scenario."""

    parameter: str
    names: Sequence[str]
    logical: str
    version: build.Version
    summary: str

    def one_after_another(self) -> bytes:
        """A deterministic distribution: every variant once."""
        root, owner = self._root()
        single = build.sub(
            build.sub(owner, "Deterministic"), "DeterministicSingleParameterDistribution", parameterName=self.parameter
        )
        values = build.sub(single, "DistributionSet")
        for name in self.names:
            build.sub(values, "Element", value=name)
        etree.indent(root)
        return build.document(root)

    def at_random(self, weights: Sequence[float], seed: int) -> bytes:
        """A stochastic distribution: as many runs as there are variants, each drawn with its weight."""
        root, owner = self._root()
        runs = build.sub(owner, "Stochastic", numberOfTestRuns=str(len(self.names)), randomSeed=str(seed))
        one = build.sub(runs, "StochasticDistribution", parameterName=self.parameter)
        values = build.sub(one, "ProbabilityDistributionSet")
        for name, weight in zip(self.names, weights, strict=True):
            build.sub(values, "Element", value=name, weight=build.decimal(weight, 9))
        etree.indent(root)
        return build.document(root)

    def _root(self) -> tuple[etree._Element, etree._Element]:
        root = _file(self.version, "distribution", self.summary)
        owner = build.sub(root, "ParameterValueDistribution")
        build.sub(owner, "ScenarioFile", filepath=self.logical)
        return root, owner


def _file(version: build.Version, what: str, summary: str) -> etree._Element:
    root = etree.Element("OpenSCENARIO")
    facts = {"revMajor": str(version[0]), "revMinor": str(version[1]), "date": "1970-01-01T00:00:00"}
    description = f"{what} {HEADER_MARK}{summary}]"
    build.sub(root, "FileHeader", **facts, description=description, author="xosc-lateral")
    return root
