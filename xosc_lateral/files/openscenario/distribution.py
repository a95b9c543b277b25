"""Read ParameterValueDistribution files: the concrete scenarios that a logical one stands for."""

from __future__ import annotations

import math
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import numpy as np
from msgspec import Struct

from xosc_lateral.base.limits import COMBINATIONS, DECIMAL_EXPONENT, DISTRIBUTION_TIME, PARAMETER_SETS
from xosc_lateral.files.held import is_file
from xosc_lateral.files.openscenario import references
from xosc_lateral.files.openscenario.context import Context, read_struct
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.openscenario.read import open_scenario, read_header
from xosc_lateral.files.xml import read_xml
from xosc_lateral.world.scenario import distribution as spread
from xosc_lateral.world.scenario.distribution import Deterministic, ParameterSet, SteppedRange, Stochastic, ValueSets
from xosc_lateral.world.scenario.parameters import Scope
from xosc_lateral.world.scenario.place import Place

MAX_REDRAWS = 1000
"""Stochastic sets in a row that violate the scenario's constraints until reading gives up."""


@dataclass(slots=True)
class LogicalScenario:
    """A scenario file and the values that its parameters take."""

    path: Path  # the distribution file
    scenario_file: Path  # the scenario that it varies
    distribution: Deterministic | Stochastic
    place: Place  # of the distribution
    _declared: Mapping[str, str] = field(repr=False)  # what the scenario declares
    _constrained: list[XmlElement] = field(repr=False)  # those declarations that have a constraint group
    _begin: float = field(init=False, repr=False, default=0.0)

    def parameter_sets(self, seed: int = 0) -> Iterator[ParameterSet]:
        """Parameter sets that satisfy the scenario's constraint groups, in order, made when asked for.

        Combinations of a deterministic distribution that violate them are left out; stochastic ones are drawn again.
        `seed`: for a stochastic distribution without a ``randomSeed`` of its own.

        Raises `FormatError`: A parameter that the scenario does not declare, or constraints that nothing satisfies.
        """
        self._begin = time.monotonic()
        limit = PARAMETER_SETS if isinstance(self.distribution, Stochastic) else COMBINATIONS
        if self.count > limit.value:
            raise self.place.error(limit.refusal(self.count))
        if isinstance(self.distribution, Deterministic):
            yield from filter(self._accepts, self.distribution)
            return
        rng = np.random.default_rng(seed if self.distribution.seed is None else self.distribution.seed)
        yield from (self._draw(self.distribution, rng) for _ in range(self.distribution.number_of_test_runs))

    @property
    def count(self) -> int:
        """Parameter sets before the scenario's constraints; for a stochastic distribution the runs."""
        if isinstance(self.distribution, Deterministic):
            return math.prod(map(len, self.distribution.parts))
        return self.distribution.number_of_test_runs

    def _draw(self, distribution: Stochastic, rng: np.random.Generator) -> ParameterSet:
        for _ in range(MAX_REDRAWS):
            try:
                values = distribution.sample(rng)
            except spread.DistributionError as error:
                raise self.place.error(str(error)) from error
            if self._accepts(values):
                return values
        raise self.place.error(f"{MAX_REDRAWS} draws in a row violate the constraints of {self.scenario_file}")

    def _accepts(self, values: ParameterSet) -> bool:
        took = time.monotonic() - self._begin
        if took > DISTRIBUTION_TIME.value:
            raise self.place.error(f"{DISTRIBUTION_TIME.refusal(took)}; constraints or limits leave out nearly all")
        for name in values:
            if name not in self._declared:
                raise self.place.error(f"parameter '{name}' is not declared in {self.scenario_file}")
        scope = Scope({**self._declared, **values})
        items = (declaration.within(scope) for declaration in self._constrained)
        return not any(references.broken_constraint(item, references.value_of(item)) for item in items)


def read_distribution(path: Path | str, *, allowed: Iterable[Path] = ()) -> LogicalScenario:
    """Read a ParameterValueDistribution file (1.1 and later); its scenario may lie in the `allowed` folders, too."""
    path = Path(path)
    document, _ = read_xml(path)
    root = open_scenario(document, path)
    header = read_header(root)
    owner = root.required("ParameterValueDistribution")
    reference = owner.required("ScenarioFile")
    boundary = references.Boundary(path.parent, references.allowed_roots(path, allowed))
    scenario = boundary.inside(reference.text("filepath"), reference.place())
    if not is_file(scenario):
        reference.fail(f"scenario file '{reference.text('filepath')}' does not exist (looked for {scenario})")
    content = owner.required("Deterministic", "Stochastic")
    context = Context(header.version, references.Catalogs({}, boundary, []), [], {})
    distribution = _deterministic(content) if content.tag == "Deterministic" else _stochastic(content, context)
    inner = open_scenario(read_xml(scenario)[0], scenario)
    declared = inner.listed("ParameterDeclarations", "ParameterDeclaration")
    constrained = [item for item in declared if item.child("ConstraintGroup") is not None]
    values = references.declared_values(inner)
    return LogicalScenario(path, scenario, distribution, content.place(), values, constrained)


def _deterministic(owner: XmlElement) -> Deterministic:
    parts: list[ValueSets | SteppedRange] = []
    for item in owner.children():
        if item.tag == "DeterministicMultiParameterDistribution":
            holder = item.required("ValueSetDistribution")
            sets = [
                {_name_of(a, "parameterRef"): a.text("value") for a in value_set.children("ParameterAssignment")}
                for value_set in holder.children("ParameterValueSet")
            ]
            parts.append(ValueSets(tuple(sets), holder.place()))
        elif item.tag == "DeterministicSingleParameterDistribution":
            parts.append(_single(item))
        else:
            item.fail("is not a deterministic distribution")
    return Deterministic(tuple(parts))


def _name_of(element: XmlElement, attribute: str) -> str:
    """Name of a parameter: never a reference, even where a file writes it with a ``$``."""
    return references.parameter_name(element.raw(attribute) or element.text(attribute))


def _single(item: XmlElement) -> ValueSets | SteppedRange:
    name = _name_of(item, "parameterName")
    content = item.required("DistributionSet", "DistributionRange", "UserDefinedDistribution")
    if content.tag == "DistributionSet":
        return ValueSets(tuple({name: value.text("value")} for value in content.children("Element")), item.place())
    if content.tag == "UserDefinedDistribution":
        content.fail("user-defined distributions can't be drawn from")
    limits = content.required("Range")
    step, lower, upper = _decimal(content, "stepWidth"), _decimal(limits, "lowerLimit"), _decimal(limits, "upperLimit")
    if step <= 0:
        content.fail(f"stepWidth of {step} is not positive")
    if upper < lower:
        limits.fail(f"upperLimit {upper} is below lowerLimit {lower}")
    if (values := (upper - lower) / step + 1) > COMBINATIONS.value:
        content.fail(COMBINATIONS.refusal(float(values)))
    return SteppedRange(name, lower, upper, step, item.place())


def _decimal(element: XmlElement, name: str) -> Decimal:
    element.number(name)  # refuses what is no finite number, with its place
    text = element.text(name).strip()
    try:
        value = Decimal(text)
    except InvalidOperation:
        element.fail(f"{name}='{text[:60]}' is not a number")
    exponent = value.as_tuple().exponent
    if not isinstance(exponent, int) or max(abs(exponent), len(text)) > DECIMAL_EXPONENT.value:
        element.fail(f"{name}='{text[:60]}': {DECIMAL_EXPONENT.what}, and digits, at most {DECIMAL_EXPONENT}")
    return value


def _stochastic(owner: XmlElement, context: Context) -> Stochastic:
    runs = owner.value("numberOfTestRuns", int)
    if runs < 0:
        owner.fail(f"numberOfTestRuns of {runs} is negative")
    draws = []
    for item in owner.children("StochasticDistribution"):
        content = item.required(*_DRAWS, "UserDefinedDistribution")
        if content.tag == "UserDefinedDistribution":
            content.fail("user-defined distributions can't be drawn from")
        draw: Any = read_struct(_DRAWS[content.tag], content, context)
        draws.append((_name_of(item, "parameterName"), draw))
    return Stochastic(tuple(draws), runs, _seed(owner))


def _seed(owner: XmlElement) -> int | None:
    """The file's seed is a double: whole ones as they are, others by their text."""
    value = owner.optional_number("randomSeed")
    if value is None:
        return None
    return int(value) if value == int(value) and value >= 0 else zlib.crc32(repr(value).encode())


_DRAWS: Mapping[str, type[Struct]] = {
    "ProbabilityDistributionSet": spread.Weighted,
    "Histogram": spread.Histogram,
    "UniformDistribution": spread.Uniform,
    "NormalDistribution": spread.Normal,
    "LogNormalDistribution": spread.LogNormal,
    "PoissonDistribution": spread.Poisson,
}
