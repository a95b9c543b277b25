"""How a body lies in the world."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def axes(yaw: FloatArray, pitch: FloatArray, roll: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Ahead, left and up of a body turned by Rz(yaw) Ry(pitch) Rx(roll), as OpenSCENARIO and OSI turn; (n, 3) each."""
    (cy, sy), (cp, sp), (cr, sr) = ((np.cos(a), np.sin(a)) for a in (yaw, pitch, roll))
    return (
        np.stack([cy * cp, sy * cp, -sp], axis=1),
        np.stack([cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr], axis=1),
        np.stack([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr], axis=1),
    )
