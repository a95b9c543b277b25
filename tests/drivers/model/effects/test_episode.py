"""What happened last is held: the last bend's peak, and which side it was to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.coarse import wander
from tests.kit.effects import STEP, made
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects import Linear, Proximity
from xosc_lateral.drivers.model.group import ResponseStream
from xosc_lateral.files.profiles import read_profile, write_profile

HELD = made(Linear, 0.5, column="x", episode=0.8)


def told(values: np.ndarray, beyond: float) -> np.ndarray:
    """Row by row, as one would say it."""
    held, inside, result = float(values[0]), abs(values[0]) > beyond, []
    for value in values:
        if abs(value) > beyond and (not inside or value * held < 0):
            held = value  # another begins
        elif abs(value) > beyond:
            held = max(held, value, key=abs)
        inside = abs(value) > beyond
        result.append(held)
    return np.array(result)


def test_the_last_bend_is_held_until_the_next() -> None:
    x = np.array([0.0, 0.5, 1.0, 2.0, 1.5, 0.3, 0.0, -0.7, -0.9, 0.0, 0.0, 1.1, 0.0])
    held = [0.0, 0.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0, -0.9, -0.9, -0.9, 1.1, 1.1]
    assert HELD.response(STEP, {"x": x})[:, 0].tolist() == held


@pytest.mark.parametrize("seed", range(3))
def test_whatever_the_blocks_it_is_as_one_would_say_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = wander(rng, 2000, 1.0)
    expected = told(x, 0.8)
    assert HELD.response(STEP, {"x": x})[:, 0] == pytest.approx(expected, abs=0)
    for late in (0.0, 1.3):
        effect = made(Linear, 0.5, column="x", episode=0.8, response_s=late, lag_s=0.4)
        whole, stream = effect.response(STEP, {"x": x}), effect.response_in_blocks(STEP)
        edges = np.sort(rng.integers(1, 2000, 300))
        parts = [stream.take(part) for part in np.split(x[:, None], np.unique(edges))]
        assert np.concatenate([*parts, stream.finish(x[:0, None])]) == pytest.approx(whole, abs=1e-12)


def test_drivers_side_by_side_each_remember_their_own() -> None:
    rng = np.random.default_rng(4)
    x = np.stack([wander(rng, 400, 1.0) for _ in range(3)])
    stream = ResponseStream(HELD, STEP)
    stream.join([(0.5,), (0.5,)])
    seen = []
    for row in range(400):
        if row == 200:
            stream.join([(0.5,)])
        if row == 300:
            stream.keep_present(np.array([False, True, True]))
        there = [0, 1] if row < 200 else [0, 1, 2] if row < 300 else [1, 2]
        stream.see({"x": x[there, row]})
        location = stream.next().location
        assert location is not None
        seen.append(dict(zip(there, location.tolist(), strict=True)))
    assert [row[1] for row in seen] == pytest.approx(0.5 * told(x[1], 0.8))
    assert [row[2] for row in seen[200:]] == pytest.approx(0.5 * told(x[2, 200:], 0.8))


def test_a_profile_keeps_it_and_files_without_it_are_as_they_were(tmp_path: Path) -> None:
    near = made(Proximity, 0.1, column="gap", scale=20.0, episode=0.4)
    profile = replace(read_profile("rural"), effects=(HELD, near))
    write_profile(profile, tmp_path / "profile.json")
    assert read_profile(tmp_path / "profile.json").effects == profile.effects
    assert "episode" not in made(Linear, 0.5, column="x").to_dict()


@pytest.mark.parametrize("episode", [-0.1, np.inf, np.nan])
def test_a_size_that_is_none_is_refused(episode: float) -> None:
    with pytest.raises(DriverProfileError, match="episode"):
        made(Linear, 0.5, column="x", episode=episode)
