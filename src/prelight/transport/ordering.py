"""An order of receivers in which neighbours see alike: by normal, then along a Morton curve.

It makes rays coherent (about twice the rays a second on a scanned mesh) and gathers the zeros of
transfer vectors into whole tiles. Bakes keep T in this order and radiance in the scene's.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Int32, Normals, Positions

_NORMAL_CELLS = 8  # a side of the octahedral map
_MORTON_BITS = 10  # a coordinate


def receiver_order(positions: Positions, normals: Normals) -> Int32[np.ndarray, "receivers"]:
    """Storage position → receiver. Receivers without a normal come first."""
    unlit = ~normals.any(axis=1)
    cell = np.where(unlit, -1, _octahedral_cell(normals))
    return np.lexsort((_morton(positions), cell)).astype(np.int32)


def _octahedral_cell(normals: Normals) -> np.ndarray:
    n = normals / np.maximum(np.abs(normals).sum(axis=1, keepdims=True), 1e-30)
    x, y, z = n.T
    x, y = (
        np.where(z < 0, (1 - np.abs(y)) * np.where(x < 0, -1, 1), x),
        np.where(z < 0, (1 - np.abs(x)) * np.where(y < 0, -1, 1), y),
    )
    cell = np.clip((np.stack([x, y]) + 1) / 2 * _NORMAL_CELLS, 0, _NORMAL_CELLS - 1).astype(np.int64)
    return cell[0] * _NORMAL_CELLS + cell[1]


def _morton(positions: Positions) -> np.ndarray:
    low = positions.min(axis=0)
    extent = float((positions.max(axis=0) - low).max()) or 1.0
    grid = ((positions - low) / extent * (2**_MORTON_BITS - 1)).astype(np.int64)
    code = np.zeros(len(positions), np.int64)
    for bit in range(_MORTON_BITS):
        for axis in range(3):
            code |= ((grid[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code
