"""The scenarios that a file of a batch stands for: itself, or those of its distribution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from xosc_lateral.errors import FormatError, XoscLateralError
from xosc_lateral.formats.openscenario.distribution import read_distribution
from xosc_lateral.limits import PARAMETER_SETS
from xosc_lateral.pipeline.request import DISTRIBUTIONS, DocumentKind, Request
from xosc_lateral.pipeline.settings import ConvertSettings
from xosc_lateral.scenario.distribution import ParameterSet


@dataclass(frozen=True, slots=True)
class Concrete:
    """One scenario to convert.

    `suffix`: of the output's name; `error`: why it can't be; empty normally.
    """

    source: Path
    suffix: str
    settings: ConvertSettings
    error: str = ""


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
    """A set of parameters; those that the request has itself go before."""
    parameters = {**values, **request.settings.parameters}
    return Concrete(scenario, f"_p{index:05d}", replace(request.settings, parameters=parameters))
