"""Types of arrays, by what one element is."""

import copyreg
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Int32Array = NDArray[np.int32]
IndexArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


def frozen(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    """A mapping that nobody changes."""
    return MappingProxyType(values)


# Frozen mappings are values, too: they can be copied and pickled, which Python leaves out.
copyreg.pickle(MappingProxyType, lambda held: (frozen, (dict(held),)))
