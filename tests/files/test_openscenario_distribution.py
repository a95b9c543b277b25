from __future__ import annotations

from pathlib import Path

import pytest

from tests.kit.scenario_files import declarations, parameter, scenario_text, write_scenario
from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.distribution import LogicalScenario, read_distribution
from xosc_lateral.files.openscenario.read import read_scenario

BELOW_60 = '<ConstraintGroup><ValueConstraint rule="lessThan" value="60"/></ConstraintGroup>'
BELOW_SPEED = '<ConstraintGroup><ValueConstraint rule="lessThan" value="${$Speed / 2}"/></ConstraintGroup>'


def logical(tmp_path: Path, content: str, *, file: str = "made.xosc", constraints: str = "") -> Path:
    parameters = declarations(
        parameter("Speed", "30", constraints=constraints), parameter("Gap", "1", constraints=BELOW_SPEED)
    )
    write_scenario(tmp_path, scenario_text(parameters=parameters))
    path = tmp_path / "logical.xosc"
    path.write_text(
        '<?xml version="1.0"?>\n<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="" author="" description=""/>'
        f'<ParameterValueDistribution><ScenarioFile filepath="{file}"/>\n{content}</ParameterValueDistribution>'
        "</OpenSCENARIO>"
    )
    return path


def single(name: str, content: str) -> str:
    return (
        f'<DeterministicSingleParameterDistribution parameterName="{name}">{content}'
        "</DeterministicSingleParameterDistribution>"
    )


def stepped(lower: str, upper: str, step: str) -> str:
    limits = f'<Range lowerLimit="{lower}" upperLimit="{upper}"/>'
    return f'<DistributionRange stepWidth="{step}">{limits}</DistributionRange>'


def stochastic(content: str, attributes: str = 'numberOfTestRuns="5" randomSeed="3"', name: str = "Speed") -> str:
    draw = f'<StochasticDistribution parameterName="{name}">{content}</StochasticDistribution>'
    return f"<Stochastic {attributes}>{draw}</Stochastic>"


USER_DEFINED = '<UserDefinedDistribution type="x">y</UserDefinedDistribution>'
UNIFORM = '<UniformDistribution><Range lowerLimit="0" upperLimit="100"/></UniformDistribution>'


def read(path: Path) -> LogicalScenario:
    return read_distribution(path)


def test_sets_and_ranges_combine(tmp_path: Path) -> None:
    sets = (
        "<DeterministicMultiParameterDistribution><ValueSetDistribution>"
        '<ParameterValueSet><ParameterAssignment parameterRef="$Gap" value="2"/></ParameterValueSet>'
        '<ParameterValueSet><ParameterAssignment parameterRef="Gap" value="3"/></ParameterValueSet>'
        "</ValueSetDistribution></DeterministicMultiParameterDistribution>"
    )
    content = f"<Deterministic>{sets}{single('Speed', stepped('20', '40', '20'))}</Deterministic>"
    logical_scenario = read(logical(tmp_path, content))
    assert logical_scenario.scenario_file == tmp_path / "made.xosc"
    assert list(logical_scenario.parameter_sets()) == [
        {"Gap": "2", "Speed": "20"},
        {"Gap": "2", "Speed": "40"},
        {"Gap": "3", "Speed": "20"},
        {"Gap": "3", "Speed": "40"},
    ]


def test_sets_that_violate_a_constraint_are_left_out(tmp_path: Path) -> None:
    content = (
        f"<Deterministic>{single('Speed', stepped('20', '80', '20'))}{single('Gap', stepped('9', '19', '10'))}"
        "</Deterministic>"
    )
    logical_scenario = read(logical(tmp_path, content, constraints=BELOW_60))
    sets = list(logical_scenario.parameter_sets())
    # Speed below 60, and Gap below half of it: 20 -> 9; 40 -> 9, 19.
    assert sets == [{"Speed": "20", "Gap": "9"}, {"Speed": "40", "Gap": "9"}, {"Speed": "40", "Gap": "19"}]
    assert logical_scenario.count == 8
    for values in sets:
        read_scenario(logical_scenario.scenario_file, values)


def test_the_files_seed_fixes_the_draws_and_another_seed_is_not_looked_at(tmp_path: Path) -> None:
    logical_scenario = read(logical(tmp_path, stochastic(UNIFORM)))
    first = list(logical_scenario.parameter_sets(seed=1))
    assert len(first) == 5
    assert first == list(logical_scenario.parameter_sets(seed=2))


def test_without_a_seed_in_the_file_the_callers_counts(tmp_path: Path) -> None:
    logical_scenario = read(logical(tmp_path, stochastic(UNIFORM, 'numberOfTestRuns="5"')))
    assert list(logical_scenario.parameter_sets(seed=1)) != list(logical_scenario.parameter_sets(seed=2))
    assert list(logical_scenario.parameter_sets(seed=1)) == list(logical_scenario.parameter_sets(seed=1))


def test_stochastic_draws_that_violate_constraints_are_drawn_again(tmp_path: Path) -> None:
    logical_scenario = read(logical(tmp_path, stochastic(UNIFORM, 'numberOfTestRuns="40"'), constraints=BELOW_60))
    sets = list(logical_scenario.parameter_sets())
    assert len(sets) == 40
    assert all(2.0 < float(values["Speed"]) < 60.0 for values in sets)
    free = list(read(logical(tmp_path, stochastic(UNIFORM, 'numberOfTestRuns="40"'))).parameter_sets())
    assert any(float(values["Speed"]) >= 60.0 for values in free)


@pytest.mark.parametrize(
    "content",
    [
        '<NormalDistribution expectedValue="30" variance="4"/>',
        '<LogNormalDistribution expectedValue="30" variance="4"/>',
        '<PoissonDistribution expectedValue="30"/>',
        '<Histogram><Bin weight="1"><Range lowerLimit="20" upperLimit="30"/></Bin></Histogram>',
        '<ProbabilityDistributionSet><Element value="30" weight="2"/></ProbabilityDistributionSet>',
    ],
)
def test_every_kind_of_draw_is_read(tmp_path: Path, content: str) -> None:
    assert all(10.0 < float(v["Speed"]) < 60.0 for v in read(logical(tmp_path, stochastic(content))).parameter_sets())


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (f"<Deterministic>{single('Speed', stepped('0', '1', '0'))}</Deterministic>", "stepWidth of 0 is not positive"),
        (f"<Deterministic>{single('Speed', stepped('2', '1', '1'))}</Deterministic>", "is below lowerLimit"),
        (
            f"<Deterministic>{single('Speed', stepped('0', '1', '1e-9'))}</Deterministic>",
            r"tried: 1000000001, at most 1000000",
        ),
        (f"<Deterministic>{single('Speed', stepped('0', 'NaN', '1'))}</Deterministic>", "not finite"),
        (
            f"<Deterministic>{single('Speed', USER_DEFINED)}</Deterministic>",
            "user-defined",
        ),
        (stochastic('<NormalDistribution expectedValue="1" variance="-1"/>'), "variance of -1.0 is negative"),
        (stochastic('<LogNormalDistribution expectedValue="0" variance="1"/>'), "is not positive"),
        (stochastic("<Histogram/>"), "weights"),
        (stochastic("<UniformDistribution/>"), "finite Range"),
        (stochastic(UNIFORM, ""), "'numberOfTestRuns' is missing"),
        (stochastic(UNIFORM, 'numberOfTestRuns="-1"'), "negative"),
    ],
)
def test_what_can_not_be_drawn_from_is_refused_with_its_line(tmp_path: Path, content: str, message: str) -> None:
    with pytest.raises(FormatError, match=message) as refused:
        read(logical(tmp_path, content))
    assert refused.value.line == 3


def test_an_undeclared_parameter_is_refused_when_it_is_asked_for(tmp_path: Path) -> None:
    logical_scenario = read(logical(tmp_path, stochastic(UNIFORM, name="Sped")))
    with pytest.raises(FormatError, match="parameter 'Sped' is not declared"):
        next(logical_scenario.parameter_sets())


def test_constraints_that_nothing_satisfies_end(tmp_path: Path) -> None:
    never = '<ConstraintGroup><ValueConstraint rule="lessThan" value="-1"/></ConstraintGroup>'
    logical_scenario = read(logical(tmp_path, stochastic(UNIFORM), constraints=never))
    with pytest.raises(FormatError, match="1000 draws in a row"):
        next(logical_scenario.parameter_sets())


def test_the_scenario_has_to_be_there_and_inside(tmp_path: Path) -> None:
    for name in ("other.xosc", 600 * "a"):  # longer than any file's name
        with pytest.raises(FormatError, match="does not exist"):
            read(logical(tmp_path, "<Deterministic/>", file=name))
    with pytest.raises(FormatError, match="lies outside"):
        read(logical(tmp_path, "<Deterministic/>", file="/etc/hostname"))
