"""Drivers over a pipe: lines as the schema has them, and nothing that ends the bench."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from tests.kit.motion import two_roads
from xosc_lateral.extras.live.stdio import Pipe
from xosc_lateral.extras.live.traffic import Traffic
from xosc_lateral.workflows.profiles.profiles import read_profile

SCHEMA = json.loads((Path(__file__).resolve().parents[3] / "docs" / "schemas" / "live.json").read_text("utf-8"))


def lines(n: int, **more: object) -> list[str]:
    one = {"speed": 30.0, "lane_width": 3.5, "left_distance": None, **more}
    return [json.dumps({"time": 0.05 * k, "vehicles": {"a": one}}) for k in range(n)]


def says(values: object, side: str) -> None:
    jsonschema.validate(values, {**SCHEMA, "$ref": f"#/$defs/{side}"})


def test_lines_are_as_the_schema_has_them_and_give_the_driver_of_the_seed() -> None:
    pipe = Pipe(read_profile("motorway-vehicle-1"), seed=4)
    found = []
    for line in lines(40):
        says(json.loads(line), "in")
        (answer,) = pipe.answers([line])
        says(json.loads(answer), "out")
        found.append(json.loads(answer)["vehicles"]["a"]["offset"])
    from xosc_lateral.drivers.model.stream import OffsetStream

    stream = OffsetStream(
        read_profile("motorway-vehicle-1"), Traffic(pipe.traffic._profiles[""], seed=4).seed_of("a"), rate=20.0
    )
    np.testing.assert_allclose(found, [stream.step({"speed": 30.0, "lane_width": 3.5}) for _ in found], atol=1e-9)


def test_the_state_goes_to_another_process_and_on() -> None:
    one, other = (Pipe(read_profile("motorway"), seed=seed) for seed in (4, 0))
    list(one.answers(lines(30)))
    (saved,) = one.answers(['{"save": true}'])
    (restored,) = other.answers([json.dumps({"restore": json.loads(saved)["state"]})])
    assert json.loads(restored) == {"restored": 1}
    assert list(one.answers(lines(60)[30:])) == list(other.answers(lines(60)[30:]))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("nonsense", "no JSON"),
        ("[1]", "has to be a JSON object"),
        ('{"time": 0}', "`vehicles` has to be an object"),
        ('{"vehicles": {}}', "time is null, expected a number"),
        ('{"time": 0, "vehicles": {"a": {"speed": "x", "lane_width": 3}}}', "vehicle 'a': speed is \"x\""),
        ('{"time": 0, "vehicles": {"a": {"speed": NaN, "lane_width": 3}}}', "vehicle 'a' at 0 s: speed is nan"),
        ('{"time": 0, "vehicles": {"a": {"speed": 3}}}', "vehicle 'a': lane_width is null"),
        ('{"time": 0, "vehicles": {"a": {"speed": 30, "lane_width": 3, "curvature": 9}}}', "curvature 9 is not within"),
        ('{"restore": {}}', "not a state of live traffic"),
        ('{"time": 0, "vehicles": {"a": {"speed": 1%s, "lane_width": 3}}}' % ("0" * 400), "a number of 401 digits"),
        ('{"time": 1%s, "vehicles": {}}' % ("0" * 5000), "no JSON: Exceeds the limit"),
        ("[" * 1000, "levels of nesting: 1000, at most 64"),
        ('{"time": 0, "vehicles": {"\\ud800": {"speed": 30, "lane_width": 3}}}', "surrogates not allowed"),
        ('{"time": 0, "vehicles": {"a": {"speed": 30, "lane_width": 3, "following": "no"}}}', "expected true or false"),
        ('{"time": 0, "vehicles": {"a": {"speed": 30, "lane_width": 3, "curvatur": 0}}}', "unknown column 'curvatur'"),
        ('{"time": 1e11, "vehicles": {}}', "time is 1e+11 s"),
        (b'{"time": 0, "vehicles": {"\xff": {}}}', "can't decode byte 0xff"),
    ],
)
def test_a_line_that_is_no_good_is_answered_and_the_next_one_goes_on(line: str | bytes, words: str) -> None:
    pipe = Pipe(read_profile("motorway"), seed=1)
    wrong, good = pipe.answers([line, *lines(1)])
    assert words in json.loads(wrong)["error"]
    says(json.loads(wrong), "out")
    assert "vehicles" in json.loads(good)


def test_on_a_road_vehicles_see_each_other(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    pipe = Pipe(read_profile("motorway"), seed=1, road=network.path)
    place = {"road": "a", "speed": 30.0}
    near = {
        "me": {**place, "lane": -2, "s": 100.0},
        "other": {**place, "lane": -1, "s": 100.0, "driven": False, "offset": -0.9},
    }
    far = {**near, "other": {**near["other"], "s": 400.0}}
    ends = []
    for vehicles in (near, far):
        pipe = Pipe(read_profile("motorway"), seed=1, road=network.path)
        for k in range(30):
            answer = pipe.answer(json.dumps({"time": 0.2 * k, "vehicles": vehicles}))
        ends.append(answer["vehicles"]["me"]["offset"])
        assert not answer["vehicles"]["other"]["steered"]
    assert ends[0] < ends[1] - 0.05  # away from who leans over from the left
    (lost,) = pipe.answers([json.dumps({"time": 9.0, "vehicles": {"me": {"speed": 30.0}}})])
    assert "every vehicle says road, lane, s" in lost


def test_a_pipe_that_breaks_ends_it_cleanly() -> None:
    words = [sys.executable, "-m", "xosc_lateral", "live", "stdio", "-p", "motorway-vehicle-1", "--verbose"]
    with subprocess.Popen(
        words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as run:
        assert run.stdin and run.stdout and run.stderr
        first, *rest = lines(50)
        print(first, file=run.stdin, flush=True)
        assert "vehicles" in run.stdout.readline()
        run.stdout.close()
        run.stdin.write("\n".join(rest) + "\n")
        run.stdin.close()
        assert run.wait(timeout=60) == 0
        log = run.stderr.read().splitlines()
        assert log and all("read" in line for line in log)
