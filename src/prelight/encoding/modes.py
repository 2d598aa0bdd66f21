"""A few modes for many columns: T ≈ U·W, the receivers' part U as signed bytes, groups of 32 receivers together.

Where one mode is bright and where it is dark is a byte for every receiver; W says how much of each mode a light
brings. A product takes as many bytes a receiver as there are modes, however many lights.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Int32
from .sparse_tiles import GROUP, groups_of

MOST_MODES = 256
_LEVELS = 127
_FINE_LEVELS = 32767
BLOCK = 64  # neighbouring vertices that share scales of their own


def in_bytes(
    values: Float32[np.ndarray, "rows modes"],
) -> tuple[np.ndarray, Float32[np.ndarray, "modes"]]:
    """Signed bytes (rows, modes) and a scale for each mode: value ≈ scale · byte, rounded to nearest, 0 exactly 0."""
    scale = (np.abs(values).max(axis=0, initial=0.0) / _LEVELS).astype(np.float32)
    inverse = np.divide(1, scale, out=np.zeros_like(scale), where=scale > 0)
    return np.rint(values * inverse).astype(np.int8), scale


def in_blocks(
    values: Float32[np.ndarray, "rows modes"], order: Int32[np.ndarray, "rows"]
) -> tuple[np.ndarray, Float32[np.ndarray, "blocks modes"]]:
    """Signed 16-bit numbers of the rows in ``order``, and scales for each 64 of them."""
    rows, scales = [], []
    for first in range(0, len(order), BLOCK):
        own = values[order[first : first + BLOCK]]
        scale = (np.abs(own).max(axis=0) / _FINE_LEVELS).astype(np.float32)
        rows.append(np.rint(np.divide(own, scale, out=np.zeros_like(own), where=scale > 0)).astype(np.int16))
        scales.append(scale)
    return np.concatenate(rows), np.stack(scales)


def grouped(rows: np.ndarray) -> np.ndarray:
    """Bytes (rows, modes) in storage order as (groups, modes, 32), the last group filled up with zeros."""
    count, modes = rows.shape
    filled = np.zeros((groups_of(count) * GROUP, modes), rows.dtype)
    filled[:count] = rows
    return np.ascontiguousarray(filled.reshape(-1, GROUP, modes).transpose(0, 2, 1))


def ungrouped(groups: np.ndarray) -> np.ndarray:
    """The inverse of ``grouped``, with what it was filled up by."""
    return groups.transpose(0, 2, 1).reshape(-1, groups.shape[1])
