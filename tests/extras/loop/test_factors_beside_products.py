"""A term tested anew beside the others: what a product leaves for its factors, and what it does not."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from tests.kit.planted import planted_drive
from xosc_lateral.drivers.model.effects import Acts, Linear, Product
from xosc_lateral.drivers.model.effects.shapes import Factor, Form
from xosc_lateral.extras.loop.column_search import ColumnSearch
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.identify import usable_columns
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET, Accepted, Selection, beside_products
from xosc_lateral.extras.loop.terms.mean import MeanTerm

PRODUCT = MeanTerm.of(
    Product(
        acts=Acts.LOCATION,
        factors=(Factor(column="gust", form=Form.VALUE), Factor(column="slope", form=Form.VALUE)),
        response_s=2.0,
    )
)


@pytest.mark.parametrize("seed", [821, 822])
def test_a_factor_stands_beside_its_product_if_it_acts_by_itself(seed: int) -> None:
    coarse = planted_drive(
        lambda column: 0.12 * column["gust"] + 0.12 * column["gust"] * column["slope"], seed, ("gust", "slope")
    )
    search = Search.over(coarse, usable_columns(coarse.timeline).columns, np.random.SeedSequence(1), ERROR_BUDGET)
    beside = fit_model(coarse, (PRODUCT,))
    found = ColumnSearch(search, MeanTerm, beside)
    assert found.probability_of(("gust",)) < 1e-3
    assert found.probability_of(("slope",)) > 0.02
    # looked for anew, it can't be found: the whole cross-basis of the product's columns is known
    assert found.likely_response(1.0)[1] > 0.02
    assert ColumnSearch(search, MeanTerm, fit_model(coarse, ())).probability_of(("gust", "slope")) < 1e-3


def test_beside_a_factor_of_its_own_a_product_counts_from_the_other_columns_median() -> None:
    """Else what the factor does alone would be what it does where the other column hardly ever is."""
    coarse = planted_drive(lambda column: 0.12 * column["gust"] * (1.0 + column["slope"]), 821, ("gust", "slope"))
    far = tuple(structs.replace(one, at=-1.5 * (one.column == "slope")) for one in PRODUCT.effect.factors)
    product = replace(PRODUCT, effect=structs.replace(PRODUCT.effect, factors=far))
    alone = MeanTerm.of(Linear(acts=Acts.LOCATION, column="gust", response_s=2.0))
    fitted = fit_model(coarse, (product, alone))
    found = Selection((Accepted(product, 1e-9), Accepted(alone, 1e-9)), (), fit_model(coarse, ()), fitted)
    final = beside_products(found).final
    assert fitted.sizes[1] < 0.0
    assert final.sizes[1] == pytest.approx(0.12, abs=0.03)
    for term in final.terms:
        told = term.describe(final, final.effects_of(term), "").ends
        assert told is not None
        planted = [0.12 * held["gust"] * (1.0 + held["slope"]) for held in (told.low, told.high)]
        assert told.change == pytest.approx(planted[1] - planted[0], abs=3.0 * told.error)
        assert told.change > 0.0
