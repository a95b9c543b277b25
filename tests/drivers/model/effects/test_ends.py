"""What is said of an effect is what its profile does: sampled with its columns held at the ends that are named."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from tests.kit.coarse import coarse_of
from tests.kit.effects import made
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model.effects import (
    Acts,
    Angular,
    ColumnEffect,
    Factor,
    Form,
    Levels,
    Linear,
    Magnitude,
    Nearness,
    Piecewise,
    Product,
    Proximity,
    Saturating,
    Threshold,
)
from xosc_lateral.drivers.model.effects.ends import Ends, ends_of
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets
from xosc_lateral.extras.loop.terms.column import driven_values
from xosc_lateral.files.profiles import read_profile
from xosc_lateral.workflows.profiles.effect_words import effect_line

N = 3000
RNG = np.random.default_rng(1)
GONE = np.arange(N) % 3 == 0
COLUMNS = {
    "x": RNG.normal(size=N),
    "y": RNG.normal(size=N),
    "angle": RNG.uniform(0.0, 360.0, N),
    "rare": (np.arange(N) % 100 == 0).astype(float),
    "lane": np.floor(np.arange(N) / 1000.0),
    "gap": np.where(GONE, np.nan, RNG.uniform(5.0, 80.0, N)),
}
X, GAP = {"column": "x"}, {"column": "gap"}
WIND = (Factor(column="y"), Factor(column="angle", form=Form.SINE, at=360.0))
BESIDE = (Factor(column="gap", form=Form.PROXIMITY, at=20.0), Factor(column="rare"))
EFFECTS: Mapping[str, ColumnEffect] = {
    "linear": made(Linear, 0.1, lag_s=-1.2, response_s=2.0, **X),
    "linear to the right": made(Linear, -0.1, **X),
    "switch": made(Linear, 0.15, column="rare"),
    "held": made(Linear, 0.1, episode=0.5, **X),
    "over time": made(Linear, 0.1, course=((-1.0, 0.5), (4.0, -0.2)), **X),
    "magnitude": made(Magnitude, 0.2, **X),
    "step": made(Threshold, -0.2, at=0.5, **X),
    "ramp below": made(Threshold, 0.1, at=0.5, above=False, jump=False, **X),
    "saturating": made(Saturating, 0.1, middle=0.2, scale=0.5, **X),
    "saturating gap": made(Saturating, -0.1, middle=20.0, scale=10.0, **GAP),
    "bends back": made(Piecewise, 0.2, -0.3, knots=(0.3,), **X),
    "levels": made(Levels, 0.1, -0.05, column="lane", levels=(1.0, 2.0)),
    "nearness": made(Nearness, 0.3, scale=20.0, **GAP),
    "presence": made(Nearness, 0.2, presence=True, **GAP),
    "proximity": made(Proximity, 0.3, scale=20.0, response_range=((0.0, 0.6),), **GAP),
    "angle": made(Angular, 0.15, 0.1, column="angle"),
    "product": made(Product, 0.1, factors=WIND),
    "product of a neighbour": made(Product, -0.3, factors=BESIDE),
    "spread": made(Linear, 0.2, acts=Acts.SPREAD, **X),
    "spread near": made(Proximity, -0.5, acts=Acts.SPREAD, scale=20.0, **GAP),
}
BARE = read_profile("motorway-vehicle-1")
ROWS = 600


def fitted(effect: ColumnEffect) -> ColumnEffect:
    """With the values of its columns that it was fitted on, as the loop has them."""
    coarse = coarse_of(np.zeros(N), COLUMNS)
    fields = {name: getattr(effect, name) for name in effect.__struct_fields__}
    return type(effect)(**fields | {"driven": driven_values(coarse, effect.columns)})


def sampled(effect: ColumnEffect, held: Mapping[str, float]) -> np.ndarray:
    """Offsets while the columns stay, after half a minute."""
    return _sampled(BARE.with_effects(effect), held)


def _sampled(profile: DriverProfile, held: Mapping[str, float]) -> np.ndarray:
    context = {name: np.full(ROWS, value) for name, value in held.items()}
    segment = Segment(0.2 * np.arange(ROWS), np.full(ROWS, 3.6), np.full(ROWS, 30.0), context)
    return np.asarray(sample_offsets(profile, segment, 1)[ROWS // 4 :])


def ends(effect: ColumnEffect) -> Ends:
    found = ends_of(effect)
    assert found is not None
    return found


@pytest.mark.parametrize("name", EFFECTS)
def test_a_profile_does_at_the_ends_what_is_said_of_them(name: str) -> None:
    effect = fitted(EFFECTS[name])
    told = ends(effect)
    low, high = sampled(effect, told.low), sampled(effect, told.high)
    words = effect_line(effect)
    if effect.acts is Acts.LOCATION:
        shift = float(np.mean(high - low))
        assert shift == pytest.approx(told.change, rel=0.1)
        assert abs(shift) > 0.05
        side = "left" if shift > 0 else "right"
        assert effect.course or f"{abs(shift):.2f}" in words.replace("\N{NO-BREAK SPACE}", " ")
        assert effect.course or f"m further {side} " in words
    else:
        factor = float(high.std() / low.std())
        assert np.log(factor) == pytest.approx(told.change, rel=0.1)
        assert f"{np.exp(told.change):.2f}" in words
    if told.other is not None:
        elsewhere = float(np.mean(sampled(effect, told.other) - sampled(effect, {**told.low, **_second(told)})))
        assert elsewhere == pytest.approx(told.elsewhere, abs=0.1 * abs(told.change))


def test_a_product_is_said_with_what_its_columns_do_alone_as_the_profile_does_both() -> None:
    """Of the product alone the sentence named the opposite side: the column's own effect is larger."""
    pair = (Factor(column="x", form=Form.VALUE), Factor(column="angle", form=Form.VALUE, at=180.0))
    product, alone = fitted(made(Product, 0.001, factors=pair)), fitted(made(Linear, -0.4, **X))
    by_itself, told = ends(product), ends_of(product, (alone, product))
    assert told is not None
    assert by_itself.change * told.change < 0.0
    both = BARE.with_effects(product, alone)
    low, high = (float(_sampled(both, held).mean()) for held in (told.low, told.high))
    assert high - low == pytest.approx(told.change, rel=0.1)
    own = ends_of(alone, (alone, product))
    assert own is not None
    assert set(own.low) == {"x", "angle"}  # where the other column stays meanwhile
    low, high = (float(_sampled(both, held).mean()) for held in (own.low, own.high))
    assert high - low == pytest.approx(own.change, rel=0.1)
    assert "where `angle` is " in effect_line(alone, both.effects)


def _second(told: Ends) -> dict[str, float]:
    assert told.other is not None
    name, value = list(told.other.items())[1]
    return {name: value}


def test_ends_are_numpys_quantiles_all_of_few_values_and_none_where_there_often_is_none() -> None:
    inside = slice(75, -75)
    (x,), (lane,), (gap,), (rare,) = (
        driven_values(coarse_of(np.zeros(N), COLUMNS), (name,)) for name in ("x", "lane", "gap", "rare")
    )
    np.testing.assert_array_equal([x[0], x[-1]], np.quantile(COLUMNS["x"][inside], [0.05, 0.95], method="nearest"))
    assert (lane, rare) == ((0.0, 1.0, 2.0), (0.0, 1.0))
    assert gap[0] is None


@pytest.mark.parametrize("factor", [-1.0, 3.0])
def test_changes_are_proportional_to_the_coefficient(factor: float) -> None:
    one, other = (ends(fitted(made(Linear, size, **X))).change for size in (0.1, 0.1 * factor))
    assert other == pytest.approx(factor * one)


def test_an_effect_that_does_not_know_its_ends_has_no_size() -> None:
    assert ends_of(EFFECTS["linear"]) is None
    assert effect_line(EFFECTS["linear"]) == "mean offset by x: begins 1.2 s ahead, response time 2.0 s; linear"


@pytest.mark.parametrize("driven", [((),), ((1.0,), (2.0,)), ((float("nan"),),), (tuple(map(float, range(33))),)])
def test_values_that_no_column_has_are_refused(driven: tuple[tuple[float, ...], ...]) -> None:
    with pytest.raises(DriverProfileError, match="driven"):
        made(Linear, 0.1, driven=driven, **X)
