"""When and how slowly a driver responds: the profile's response at 1 Hz, and what not knowing it adds to an error."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec import structs

from tests.kit.coarse import coarse_of, movement, wander
from xosc_lateral.drivers.model.effects import Acts, Factor, Form, Linear, Product
from xosc_lateral.drivers.model.effects.response import respond
from xosc_lateral.extras.loop.dictionary import beside, respond_by_second
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.terms.column import driven_values
from xosc_lateral.extras.loop.terms.mean import NEAR_SCALES, MeanTerm, _profile, _shapes, widening


@pytest.mark.parametrize("response_s", [0.6, 1.5, 4.0])
def test_a_response_by_the_second_is_the_mean_of_the_response_within_it(response_s: float) -> None:
    quantity = np.random.default_rng(5).normal(size=(60, 2))
    fine = respond(np.repeat(quantity, 1000, axis=0), 0.001, 0.0, response_s)
    expected = fine.reshape(60, 1000, 2).mean(axis=1)
    np.testing.assert_allclose(
        respond_by_second(quantity, response_s, np.zeros(60, dtype=np.intp)), expected, atol=2e-3
    )


def test_a_size_beside_known_columns_is_that_of_least_squares() -> None:
    rng = np.random.default_rng(6)
    known, rows, series = rng.normal(size=(200, 3)), rng.normal(size=(200, 2)), rng.normal(size=200)
    others, _ = np.linalg.qr(known)
    contrast = np.array([1.0, -0.5])
    explained, size, variance = _profile(beside(others, rows), beside(others, series), contrast)
    both = np.column_stack([known, rows])
    sizes, left, *_ = np.linalg.lstsq(both, series, rcond=None)
    _, alone, *_ = np.linalg.lstsq(known, series, rcond=None)
    assert size == pytest.approx(contrast @ sizes[3:])
    assert explained == pytest.approx(alone[0] - left[0])
    inverse = np.linalg.inv(both.T @ both)[3:, 3:]
    assert variance == pytest.approx(contrast @ inverse @ contrast)


@pytest.mark.parametrize(("memory", "least", "most"), [(2.0, 1.05, 6.0), (200.0, 1.0, 1.6)], ids=["quick", "slow"])
def test_not_knowing_the_timing_widens_the_error_of_a_quick_column_and_hardly_of_a_slow_one(
    memory: float, least: float, most: float
) -> None:
    """A column that stays for minutes is responded to alike whatever the delay."""
    rng = np.random.default_rng(7)
    x = wander(rng, 4500, memory)
    shift = 0.15 * respond(x, 0.2, 0.4, 1.5)
    term = MeanTerm.of(Linear(acts=Acts.LOCATION, column="x", lag_s=0.4, response_s=1.5))
    fitted = fit_model(coarse_of(shift + movement(rng, 900.0), {"x": x}), (term,))
    part = fitted.mean_part(term)
    known = {"reference": (0.0,), "driven": driven_values(fitted.coarse, ("x",))}
    effect = structs.replace(term.effect, coefficients=tuple(fitted.sizes[part]), errors=(0.1,), **known)
    assert least <= widening(fitted, effect, part) < most


def test_not_knowing_over_which_distance_a_product_fades_widens_its_error() -> None:
    rng = np.random.default_rng(8)
    distance, lane = 60.0 + 40.0 * wander(rng, 4500, 20.0), (wander(rng, 4500, 60.0) > 0.0).astype(float)
    fading = Product(
        acts=Acts.LOCATION,
        factors=(
            Factor(column="lane", form=Form.EQUALS, at=1.0),
            Factor(column="distance", form=Form.PROXIMITY, at=40.0),
        ),
        response_s=1.5,
    )
    context = {"distance": np.abs(distance), "lane": lane}
    bare = coarse_of(movement(rng, 900.0), context)
    shift = 0.4 * bare.fine_response(fading)[:, 0]
    widths = []
    for effect in (fading, structs.replace(fading, factors=(fading.factors[0], Factor(column="distance")))):
        fitted = fit_model(coarse_of(bare.timeline.offset + shift, context), (MeanTerm.of(effect),))
        known = {"reference": (0.0,), "driven": driven_values(fitted.coarse, effect.columns)}
        sized = structs.replace(effect, coefficients=tuple(fitted.sizes), errors=(0.1,), **known)
        widths.append(widening(fitted, sized, slice(0, 1)))
    assert widths[0] > 1.3
    assert len(_shapes(bare, fading)) == len(NEAR_SCALES)


def test_beside_a_drive_nothing_of_the_one_before_is_left() -> None:
    """Of a quantity that is constant within drives, the response is that constant, pads included."""
    coarse = coarse_of(np.zeros(3000), drives=3)
    values = np.repeat([1.0, -2.0, 5.0], 1000)
    for lag_s, response_s in ((0.0, 60.0), (0.0, 2.0)):
        found = coarse.timeline.respond(values, lag_s, response_s)
        np.testing.assert_allclose(found, values, atol=1e-12)


@pytest.mark.parametrize("response_s", [1.0, 4.0])
def test_a_response_starts_anew_with_every_drive(response_s: float) -> None:
    rng = np.random.default_rng(6)
    lengths = (7, 1, 30)
    parts = [rng.normal(size=(n, 3)) + 10.0 * number for number, n in enumerate(lengths)]
    drive = np.repeat(np.arange(3), lengths).astype(np.intp)
    alone = [respond_by_second(part, response_s, np.zeros(len(part), dtype=np.intp)) for part in parts]
    np.testing.assert_allclose(
        respond_by_second(np.concatenate(parts), response_s, drive), np.concatenate(alone), atol=1e-12
    )
