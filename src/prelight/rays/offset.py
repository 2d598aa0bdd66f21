"""How far from its surface a ray begins."""

from __future__ import annotations

import numpy as np

from ..arrays import Positions

_OFFSET = 1e-4  # of the scene's bounding-box diagonal


def ray_offset(positions: Positions) -> float:
    """How far along its normal a receiver's rays begin, in metres.

    1e-4 of the scene's diagonal, and at least eight steps of float32 at its farthest coordinate.
    """
    diagonal = float(np.linalg.norm(np.ptp(positions.astype(np.float64), axis=0)))
    return _OFFSET * diagonal + 8.0 * float(np.spacing(np.abs(positions).max()))
