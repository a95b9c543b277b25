"""What a call can be told is declared in its signature: the command line, and its docstring, are made from it."""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import Annotated

import pytest

import xosc_lateral as xl
from xosc_lateral.cli import main, verb
from xosc_lateral.workflows.options import SHARED, declare_options, flag, options_of

CALLS = {
    "fit": xl.fit, "sample": xl.sample, "evaluate": xl.evaluate, "close-loop": xl.close_loop, "detect": xl.detect,
    "states": xl.play, "segments": xl.segments, "verify": xl.verify, "reproduce": xl.reproduce,
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_a_verb_has_the_options_and_defaults_of_its_call(name: str) -> None:
    call, on_the_line = CALLS[name], {option.name: option for option in verb(name).params}
    for keyword, declared in options_of(call).items():
        if declared.said_by:
            assert keyword not in on_the_line
            continue
        stated, option = inspect.signature(call).parameters[keyword].default, on_the_line[keyword]
        if stated is inspect.Parameter.empty:
            assert option.required
        elif declared.gives is None:
            assert option.default == (None if isinstance(stated, tuple) or keyword == "with_sensor" else stated)


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_a_docstring_says_each_option(call: object) -> None:
    text, written = str(call.__doc__), "\n".join(map(str, inspect.signature(call).parameters.values()))
    assert all(f"{keyword}" in text for keyword in options_of(call))  # type: ignore[arg-type]
    assert "Annotated" not in written and "flag(" not in text


@declare_options
def drive(
    road: str, *, width: Annotated[float, flag(help="Of a lane, see --side; may be repeated. [m]")] = 3.5,
    side: int = 0, seed: int = 0, allow: Annotated[list[str] | None, flag("--folder", help="Here.")] = None,
) -> None:  # fmt: skip
    """Drive.

    Parameters
    ----------
    road : str
    allow : list
        In these folders.

    Raises
    ------
    ValueError
    """


def test_what_is_declared_becomes_an_option_and_an_entry_of_the_docstring() -> None:
    options = options_of(drive)
    assert list(options) == ["width", "seed", "allow"], "`road` is no keyword, `side` is not declared"
    assert (options["width"].kind, options["seed"], options["allow"].flags) == (float, SHARED["seed"], ("--folder",))
    assert inspect.getdoc(drive) == inspect.cleandoc(
        """Drive.

        Parameters
        ----------
        road : str
        allow : list
            In these folders.
        width : float
            Of a lane, see `side`. [m]
        seed : int
            Random seed; the same inputs and seed give the same bytes.

        Raises
        ------
        ValueError
        """
    )


@pytest.mark.parametrize(
    ("words", "beginning"),
    [
        (["sample", "-p", "nobody", "--duration", "5", "-o", "-"], "--profile: no profile 'nobody'"),
        (["convert", "SCENARIO", "--profile", "nobody"], "--profile: no profile 'nobody'"),
        (["convert", "SCENARIO", "-p", "Truck=nobody"], "--profile: no profile 'nobody'"),
        (["sample", "--seed", "0", "-p", "0", "--duration", "5", "-o", "-"], "--profile: no profile '0'"),
        (["convert", "SCENARIO", "--road", "away.xodr"], "--road: away.xodr: no such file or folder"),
        (["states", "SCENARIO", "-o", "-", "--road", "away.xodr"], "--road: away.xodr: no such file or folder"),
        (["states", "SCENARIO", "-o", "-", "--road", "away"], "--road: away: no such file or folder"),
        (["live", "stdio", "-p", "nobody"], "--profile: no profile 'nobody'"),
        (["evaluate", "away.csv", "-p", "motorway", "--library", "gone"], "--library: gone: no such folder"),
        (["sample", "-p", "motorway", "--like", "away.csv", "-o", "-"], "--like: away.csv: no such file"),
        (["profiles", "show", "nobody"], "no profile 'nobody'"),
        (["segments", "away.xosc"], "away.xosc: no such file"),
    ],
    ids=" ".join,
)
def test_what_is_not_there_is_named_with_the_option_that_asked_for_it(
    words: list[str],
    beginning: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    (scenario, _) = xl.write_template("cut-in", "templates")
    words = [str(scenario) if word == "SCENARIO" else word for word in words]
    assert main(words) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"xosc-lateral: {beginning}") and said.count("\n") == 1
    if words[0] != "live":
        assert main([*words, "--json"]) == 1
        assert json.loads(capsys.readouterr().out)["error"]["message"].startswith(beginning)


def test_a_road_that_is_there_and_broken_is_named_by_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (scenario, _) = xl.write_template("cut-in", tmp_path)
    broken = tmp_path / "broken.xodr"
    broken.write_text("<OpenDRIVE", encoding="utf-8")
    assert main(["states", str(scenario), "-o", "-", "--road", str(broken)]) == 1
    assert capsys.readouterr().err.startswith(f"xosc-lateral: {broken}:1")
