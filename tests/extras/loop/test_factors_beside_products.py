"""A term tested anew beside the others: what a product leaves for its factors, and what it does not."""

import numpy as np
import pytest

from tests.kit.planted import planted_drive
from xosc_lateral.drivers.model.effects import Acts, Product
from xosc_lateral.drivers.model.effects.shapes import Factor, Form
from xosc_lateral.extras.loop.column_search import ColumnSearch
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.identify import usable_columns
from xosc_lateral.extras.loop.model import fit_model
from xosc_lateral.extras.loop.selection import ERROR_BUDGET
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
