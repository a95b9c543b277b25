"""Adding one of each from outside the package: a column effect, a hidden effect, a core model.

The classes below are all that a plug-in holds; installed, they are found by their entry points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any, ClassVar

import msgspec
import numpy as np
import pytest
from msgspec.structs import replace

from tests.drivers.model.test_stream import drive, make_contexts, make_profile, rows, segment
from xosc_lateral.base.errors import DriverProfileError, FormatError
from xosc_lateral.drivers.model import effects
from xosc_lateral.drivers.model.core import registry
from xosc_lateral.drivers.model.core.base import CoreModel, Start
from xosc_lateral.drivers.model.core.registry import KnownModel, known_models, model_named
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, EffectTerms, HiddenEffect, known_effects
from xosc_lateral.drivers.model.profile import DriverProfile, file_type
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.drivers.model.stream import OffsetStream
from xosc_lateral.files.profiles import read_profile, write_profile


class Squared(ColumnEffect, frozen=True, kw_only=True):
    """A column effect: strength in proportion to a column's square."""

    column: str

    @property
    def columns(self) -> tuple[str, ...]:
        return (self.column,)

    @property
    def shape(self) -> str:
        return "squared"

    def quantity(self, context: Mapping[str, np.ndarray]) -> np.ndarray:
        return np.square(context[self.column])[:, None]


class WalkState(msgspec.Struct):
    rng: np.random.Generator
    value: float = 0.0


class RandomWalk(HiddenEffect, frozen=True, kw_only=True):
    """A hidden effect: a random walk of the mean offset; `size` after an hour. [m]"""

    positive: ClassVar[tuple[str, ...]] = ("size",)
    State: ClassVar[type[msgspec.Struct]] = WalkState
    size: float

    def begin(self, rng: np.random.Generator, step: float) -> WalkState:
        return WalkState(rng)

    def advance(self, state: WalkState, time: np.ndarray, step: float) -> EffectTerms:
        kicks = self.size * np.sqrt(step / 3600.0) * state.rng.standard_normal(len(time))
        path = np.cumsum(np.concatenate([[state.value], kicks]))[1:]
        state.value = float(path[-1])
        return EffectTerms(location=path)


class WhiteState(msgspec.Struct):
    rng: np.random.Generator
    drivers: int | None


class WhiteStream:
    def __init__(self, model: WhiteModel, state: WhiteState) -> None:
        self.mean, self.state, self._spread = model.mean, state, model.spread

    def take(self, n: int, rate: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        shape = n if self.state.drivers is None else (n, self.state.drivers)
        return np.full(shape, self.mean), self._spread * self.state.rng.standard_normal(shape)


class WhiteModel(CoreModel, frozen=True, eq=False):
    """A core model: no memory at all."""

    State: ClassVar[type] = WhiteState
    mean: float
    spread: float
    step: float = 0.2

    def stream(
        self, seed: np.random.SeedSequence, start: Start | None = None, *, drivers: int | None = None
    ) -> WhiteStream:
        return WhiteStream(self, WhiteState(np.random.default_rng(seed), drivers))

    def resume(self, state: WhiteState) -> WhiteStream:
        return WhiteStream(self, state)


def fit_white(rel_offsets: Sequence[np.ndarray], drives: Sequence[str]) -> WhiteModel:
    every = np.concatenate(rel_offsets)
    return WhiteModel(float(every.mean()), float(every.std()))


WHITE = KnownModel(WhiteModel, fit_white)
NO_EFFECT = dict


def forget() -> None:
    """What was found among the entry points, which a process looks at once."""
    for found in (known_effects, known_models, file_type):
        found.cache_clear()


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, list[EntryPoint]]]:
    """Entry points as an installed package would have them."""
    here = "tests.drivers.model.test_plugins"
    points = {
        effects.ENTRY_POINTS: [
            EntryPoint("squared", f"{here}:Squared", effects.ENTRY_POINTS),
            EntryPoint("random-walk", f"{here}:RandomWalk", effects.ENTRY_POINTS),
        ],
        registry.ENTRY_POINTS: [EntryPoint("white", f"{here}:WHITE", registry.ENTRY_POINTS)],
    }
    for module in (effects, registry):
        monkeypatch.setattr(module, "entry_points", lambda group: points[group])
    forget()
    yield points
    forget()


def plugged() -> DriverProfile:
    # The classes as the entry points load them: this module may be imported under another name too.
    squared, walk = known_effects()[-2:]
    slope: Any = squared(
        column="speed", acts=Acts.LOCATION, coefficients=(1e-3,), errors=(1e-4,), reference=(900.0,), lag_s=-0.6
    )
    model = model_named("white").fit([np.random.default_rng(0).normal(0.01, 0.05, 500)], ["a"])
    return DriverProfile("plugged", model, (slope, walk(size=0.5)))


@pytest.mark.usefixtures("installed")
def test_plug_ins_are_fitted_written_read_sampled_and_streamed(tmp_path: Path) -> None:
    profile = plugged()
    write_profile(profile, tmp_path / "p.json")
    again = read_profile(tmp_path / "p.json")
    assert [effect.kind for effect in again.effects] == ["squared", "random-walk"]
    assert again.model.kind == "white"
    columns = make_contexts(300)
    stream = OffsetStream(again, 4)
    contexts = rows(columns)
    first = drive(stream, contexts[:200])
    stream = OffsetStream.from_dict(again, stream.to_dict())
    rest = [stream.step(context) for context in contexts[200:]]
    expected = sample_offsets(profile, segment(columns), 4)[: len(first) + len(rest)]
    np.testing.assert_array_equal([*first, *rest], expected)


def test_without_the_plug_in_its_kinds_are_unknown(installed: dict[str, list[EntryPoint]], tmp_path: Path) -> None:
    write_profile(plugged(), tmp_path / "p.json")
    for points in installed.values():
        points.clear()
    forget()
    with pytest.raises(
        FormatError, match=r"p\.json: model: unknown kind 'white'; known are autoregressive, two-level$"
    ):
        read_profile(tmp_path / "p.json")
    write_profile(replace(make_profile(), name="x"), tmp_path / "x.json")
    assert read_profile(tmp_path / "x.json").name == "x"
    with pytest.raises(DriverProfileError, match="no core model 'white'; known are two-level, autoregressive"):
        model_named("white").fit([np.zeros(100)], ["a"])


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (
            "tests.drivers.model.test_plugins:NO_EFFECT",
            "plug-in odd: tests.drivers.model.test_plugins:NO_EFFECT is not an effect",
        ),
        ("xosc_lateral.drivers.model.effects:Drift", "plug-in odd: there is an effect of the kind 'drift' already"),
    ],
    ids=["no effect", "taken"],
)
def test_a_plug_in_that_is_none_is_named(installed: dict[str, list[EntryPoint]], value: str, message: str) -> None:
    installed[effects.ENTRY_POINTS] = [EntryPoint("odd", value, effects.ENTRY_POINTS)]
    with pytest.raises(DriverProfileError, match=message):
        known_effects()
