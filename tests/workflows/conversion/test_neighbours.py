"""`neighbours` of a conversion: by argument, configuration and table."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

import xosc_lateral as xl
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.workflows.batch.request import read_request_table
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.workflows.conversion.settings import ConvertSettings


@pytest.fixture
def configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's file, not written yet."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    path = tmp_path / "home" / "xosc-lateral" / "config.toml"
    path.parent.mkdir(parents=True)
    return path


def test_an_argument_comes_before_the_configuration_and_both_are_said(tmp_path: Path, configuration: Path) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path)

    def neighbours(**given: str) -> tuple[str, str]:
        made = xl.convert(scenario, seed=1, time_limit=6.0, profile="motorway-vehicle-1", ego="none", **given)
        return made.to_dict()["provenance"]["options"]["neighbours"], str(made)

    used, said = neighbours()
    assert used == "borrow" and "not known, moves as the population does" in said
    configuration.write_text('neighbours = "profile"\n')
    used, said = neighbours()
    assert used == "profile" and "not known, does not move" in said and "population" not in said
    used, said = neighbours(neighbours="none")
    assert used == "none" and "does not move (--neighbours none)" in said
    configuration.write_text('neighbours = "some"\n')
    with pytest.raises(FormatError, match="expected one of profile, borrow, none"):
        neighbours()


def test_rows_of_a_table_choose_and_a_wrong_word_is_named_with_its_line(tmp_path: Path) -> None:
    frame = pd.DataFrame({"scenario": ["a.xosc", "b.xosc"], "neighbours": ["none", ""]})
    chosen = [request.settings.neighbours for request in read_request_table(frame, ConvertSettings())]
    assert chosen == [Neighbours.NONE, Neighbours.BORROW]
    frame.loc[1, "neighbours"] = "all"
    with pytest.raises(FormatError, match=r"3.*neighbours 'all', expected one of profile, borrow, none"):
        list(read_request_table(frame, ConvertSettings()))


@pytest.mark.pages
def test_the_command_line_takes_it_and_profiles_show_says_what_is_known(
    tmp_path: Path, configuration: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario, _ = xl.write_template("cut-in", tmp_path)
    output = tmp_path / "made.xosc"
    assert main(["convert", str(scenario), "-o", str(output), "--neighbours", "profile"]) == 0
    assert b'"neighbours": "profile"' in output.read_bytes().replace(b'"neighbours":"', b'"neighbours": "')
    capsys.readouterr()
    assert main(["profiles", "show", "motorway-vehicle-1"]) == 0
    assert "neighbours beside vehicles on either side: not known, does not move" in capsys.readouterr().out
    assert main(["profiles", "show", "motorway"]) == 0
    usual = "beside vehicles on either side: responds as the drivers in the profile's recording did"
    assert usual in capsys.readouterr().out
    said = str(xl.convert(scenario, seed=1, time_limit=6.0))
    assert "beside vehicles" not in said, "of what is usual there is nothing to say"
    assert said.count("Ego") == 1, "it is under test, and told to be"
