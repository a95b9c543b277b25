"""How people move from one place of rest to another: with the least jerk.

References
----------
.. [1] T. Flash, N. Hogan, "The coordination of arm movements: an experimentally confirmed mathematical model", J.
       Neuroscience 5, 1985, pp. 1688-1703.
"""

from __future__ import annotations

import numpy as np


def least_jerk(length: int) -> np.ndarray:
    """Share of the way that is done after each of so many steps, shape (length,): 10 u^3 - 15 u^4 + 6 u^5 [1]_. [-]"""
    done = np.arange(1, length + 1) / length
    return np.asarray(done**3 * (10.0 - 15.0 * done + 6.0 * done**2))
