"""The scenarios that a file of a batch stands for: itself, those of its distribution, the variants of a set of ours."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from xosc_lateral.errors import FormatError, XoscLateralError
from xosc_lateral.formats.openscenario.distribution import read_distribution
from xosc_lateral.formats.openscenario.references import Boundary, allowed_roots
from xosc_lateral.formats.openscenario.write import source_of_set, variant_index
from xosc_lateral.limits import PARAMETER_SETS
from xosc_lateral.pipeline.document_kind import DISTRIBUTIONS, DocumentKind
from xosc_lateral.pipeline.request import Request
from xosc_lateral.pipeline.settings import ConvertSettings
from xosc_lateral.scenario.deterministic import ParameterSet
from xosc_lateral.scenario.place import Place


@dataclass(frozen=True, slots=True)
class Concrete:
    """One scenario to convert.

    Parameters
    ----------
    source : Path
    suffix : str
        Of the output's name.
    settings : ConvertSettings
    error : str
        Why it can't be; empty normally.
    variant : int or None
        Which one it is, if the file says so.
    """

    source: Path
    suffix: str
    settings: ConvertSettings
    error: str = ""
    variant: int | None = None


def concrete(request: Request, kind: DocumentKind) -> Iterator[Concrete]:
    """The scenarios that a file stands for."""
    if kind not in DISTRIBUTIONS:
        yield Concrete(request.scenario, "", request.settings)
        return
    try:
        scenario_file, sets = _sets(request)
        found = [_one(request, scenario_file, index, values) for index, values in enumerate(sets)]
    except (XoscLateralError, OSError) as error:
        found = [_refused(request, str(error))]
    except Exception as error:  # a bug of ours in one file must not cost the others; the row says that it is one
        found = [_refused(request, f"{request.scenario}: internal error: {type(error).__name__}: {error}")]
    yield from found


def _refused(request: Request, why: str) -> Concrete:
    return Concrete(request.scenario, "", request.settings, " ".join(why.split()))


def _sets(request: Request) -> tuple[Path, list[ParameterSet]]:
    """The logical scenario's file, and every set of its parameters."""
    logical = read_distribution(request.scenario, allowed=request.settings.allow)
    sets = list(islice(logical.parameter_sets(request.settings.seed), int(PARAMETER_SETS.value) + 1))
    if len(sets) > PARAMETER_SETS.value:
        raise FormatError(f"{PARAMETER_SETS.refusal(logical.count)}", path=request.scenario)
    if not sets:
        raise FormatError("no set of parameters satisfies the scenario's constraints", path=request.scenario)
    return logical.scenario_file, sets


def _one(request: Request, scenario: Path, index: int, values: ParameterSet) -> Concrete:
    """A set of parameters; of a set of ours, the variant of the scenario that it was made from."""
    suffix = f"_p{index:05d}"
    found = source_of_set(scenario)
    if found is None:
        parameters = {**values, **request.settings.parameters}
        return Concrete(scenario, suffix, replace(request.settings, parameters=parameters))
    source, parameter = found
    name = values.get(parameter, "")
    variant = variant_index(name)
    if variant is None:
        raise FormatError(f"{parameter} '{name[:20]}' names no variant ('variant_1' would)", path=request.scenario)
    boundary = Boundary(scenario.parent, allowed_roots(scenario, request.settings.allow))
    path = boundary.inside(source, Place(str(scenario), None, "provenance"))
    if not path.is_file():
        raise FormatError(f"its scenario '{source}' is not there", path=scenario)
    return Concrete(path, suffix, request.settings, variant=variant)
