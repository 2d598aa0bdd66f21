"""The few cells of a shell that no harmonics of low order can hold: a sun's, or a lamp's."""

from __future__ import annotations

import numpy as np

from ..arrays import CubeMap
from ..bases import cube_map

_ABOVE = 6.0  # times the mean radiance of a shell: a cell that is brighter is a sun's, or a lamp's
_SHARE = 0.05  # of a shell's light that such cells have, if they are to count


def strong_cells(shell: CubeMap) -> CubeMap | None:
    """The light of the brightest cells and nothing else; None where they have little of a shell's light."""
    radiance = shell.sum(axis=3)
    energy = radiance * cube_map.solid_angles(shell.shape[1])
    whole = float(energy.sum(dtype=np.float64))
    strong = radiance > _ABOVE * whole / (4 * np.pi)
    if float(energy[strong].sum(dtype=np.float64)) <= _SHARE * whole:
        return None
    return np.where(strong[..., None], shell, np.float32(0))
