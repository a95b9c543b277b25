"""When and how slowly a driver answers, looked for at 1 Hz: the same answer as the profile's."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.driver.effects.response import respond
from xosc_lateral.identification.dictionary import respond_by_second


@pytest.mark.parametrize("response", [0.6, 1.5, 4.0])
def test_an_answer_by_the_second_is_the_mean_of_the_answer_within_it(response: float) -> None:
    quantity = np.random.default_rng(5).normal(size=(60, 2))
    fine = respond(np.repeat(quantity, 1000, axis=0), 0.001, 0.0, response)
    expected = fine.reshape(60, 1000, 2).mean(axis=1)
    np.testing.assert_allclose(respond_by_second(quantity, response), expected, atol=2e-3)
