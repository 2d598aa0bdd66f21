"""A sparse matrix times columns of light, in blocks as wide as a vector of the processor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import Float32, Int32, Int64
from .sparse_product_kernels import WIDTHS, multiply_block

_LINE = 64  # bytes of a cache line


class LightBlocks:
    """Columns of light (vertices, n), laid out to be multiplied by many parts of a matrix one after the other."""

    def __init__(self, light: Float32[np.ndarray, "vertices n"]) -> None:
        self._count = light.shape[1]
        self._blocks = [(columns, _padded(light[:, columns], width)) for columns, width in _cut(self._count)]

    def multiplied(
        self,
        starts: Int64[np.ndarray, "rows_and_one"],
        columns: Int32[np.ndarray, "entries"],
        values: Float32[np.ndarray, "entries"],
        out: Float32[np.ndarray, "rows n"],
    ) -> None:
        """Write the product of some rows to ``out``; row i has entries starts[i] … starts[i + 1] − 1."""
        for where, light in self._blocks:
            product = aligned(len(out), light.shape[1])
            multiply_block(starts, columns, values, light, product)
            out[:, where] = product[:, : where.stop - where.start]


def multiply(
    starts: Int64[np.ndarray, "rows_and_one"],
    columns: Int32[np.ndarray, "entries"],
    values: Float32[np.ndarray, "entries"],
    light: Float32[np.ndarray, "vertices n"],
    out: Float32[np.ndarray, "rows n"],
) -> None:
    """out = M · light, written, for a matrix that is used once."""
    LightBlocks(light).multiplied(starts, columns, values, out)


def _cut(count: int) -> Iterator[tuple[slice, int]]:
    """Blocks of columns, each a slice and how wide it is with its padding, of which there is little."""
    wide, narrow = WIDTHS
    start = 0
    while start < count:
        width = narrow if count - start <= narrow else wide
        yield slice(start, min(start + width, count)), width
        start += width


def _padded(light: np.ndarray, width: int) -> Float32[np.ndarray, "vertices width"]:
    block = aligned(len(light), width)
    block[:, : light.shape[1]] = light
    block[:, light.shape[1] :] = 0
    return block


def aligned(rows: int, columns: int) -> Float32[np.ndarray, "rows columns"]:
    """Memory in which every row begins with a cache line."""
    raw = np.empty(4 * rows * columns + _LINE, np.uint8)
    start = -raw.ctypes.data % _LINE
    return raw[start : start + 4 * rows * columns].view(np.float32).reshape(rows, columns)
