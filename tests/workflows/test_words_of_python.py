"""What a call of Python says of an error names keywords; the command line, options."""

from __future__ import annotations

import inspect
import pickle
from pathlib import Path

import pytest

import xosc_lateral as xl
from xosc_lateral.cli import main


def _refused(tmp_path: Path, *, there: Path) -> str:
    with pytest.raises(xl.XoscLateralError) as caught:
        xl.convert(there, tmp_path / "foreign.xosc", seed=1)
    return str(caught.value)


def test_the_same_mistake_is_said_in_the_words_of_its_door(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path)
    (tmp_path / "foreign.xosc").write_text("by somebody else")
    assert "`force` replaces it" in _refused(tmp_path, there=scenario)
    assert main(["convert", str(scenario), "-o", str(tmp_path / "foreign.xosc")]) == 1
    assert "--force replaces it" in capsys.readouterr().err


def test_options_that_are_called_otherwise_have_their_keywords(tmp_path: Path) -> None:
    table = tmp_path / "drive.csv"
    table.write_text("t,left,right\n" + "".join(f"{k / 10},1,1\n" for k in range(600)))
    with pytest.raises(
        xl.FormatError,
        match=r"translate with `columns` time=COLUMN\); all columns: xosc-lateral check drive.csv --report",
    ):
        xl.fit(table)


def test_what_other_programs_call_their_options_stays() -> None:
    def call() -> None:
        raise xl.SimulationError("start SUMO with --fcd-output.attributes all, esmini with --align_routepositions")

    with pytest.raises(xl.SimulationError, match=r"--fcd-output\.attributes all, esmini with --align_routepositions"):
        xl.in_python(call)()


@pytest.mark.parametrize("name", xl.__all__)
def test_calls_are_found_again_by_another_process_and_explain_themselves(name: str) -> None:
    value = getattr(xl, name)
    assert pickle.loads(pickle.dumps(value)) == value
    if inspect.isfunction(value):
        assert value.__doc__ and "kwargs" not in str(inspect.signature(value))
