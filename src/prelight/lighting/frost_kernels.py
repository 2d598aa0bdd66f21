"""Light blurred on the sphere, from cells of a cube map to cells of a finer one."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, types

from .frost_code import LANES, WIDE, cell_sums

f4 = types.float32


def _read_only(kind: types.Type, dimensions: int) -> types.Array:
    return types.Array(kind, dimensions, "C", readonly=True)


TOGETHER = 16  # cells that are passed over at once, if all of them are too far away
_add_cells, _add_far_cells = cell_sums(wide=False), cell_sums(wide=True)
_BLOCKS = 4  # of directions, of a thread at a time


@njit(cache=True)
def _cap(points, first, last, cap):
    """The middle of some unit directions, and the largest angle to it."""
    middle = cap[:3]
    middle[:] = 0
    for k in range(first, last):
        middle += points[k, :3]
    middle /= max(np.sqrt((middle * middle).sum()), np.float32(1e-6))
    least = np.float32(1)
    for k in range(first, last):
        least = min(least, (middle * points[k, :3]).sum())
    cap[3] = np.arccos(max(least, np.float32(-1)))


@njit(cache=True)
def _blur_block(directions, first, cells, weight, caps, reach, out):
    """Of up to LANES directions that are near each other."""
    last = min(len(directions), first + LANES)
    own, sums = np.empty((3, LANES), np.float32), np.zeros((4, LANES), np.float32)
    for i in range(LANES):
        for a in range(3):
            own[a, i] = directions[min(first + i, last - 1), a]
    cap = np.empty(4, np.float32)
    _cap(directions, first, last, cap)
    for b in range(len(caps)):
        angle = caps[b, 3] + cap[3] + reach + np.float32(1e-3)
        near = caps[b, 0] * cap[0] + caps[b, 1] * cap[1] + caps[b, 2] * cap[2]
        if angle >= np.pi or near >= np.cos(angle):
            begin, end = b * TOGETHER, min(len(cells), (b + 1) * TOGETHER)
            at = cells.ctypes.data + 32 * begin
            if reach > WIDE:
                _add_far_cells(own.ctypes.data, at, end - begin, weight.ctypes.data, sums.ctypes.data)
            else:
                _add_cells(own.ctypes.data, at, end - begin, weight.ctypes.data, sums.ctypes.data)
    for i in range(last - first):
        scale = np.float32(1) / sums[3, i] if sums[3, i] > 0 else np.float32(0)
        for c in range(3):
            out[first + i, c] = sums[c, i] * scale


@njit(
    [types.void(_read_only(f4, 2), _read_only(f4, 2), _read_only(f4, 1), f4, f4[:, ::1])],
    parallel=True,
    cache=True,
    nogil=True,
)
def blur(directions, cells, weight, reach, out):
    """out (n, 3): for each direction the mean of cells weighted by a function of their angle that ends at ``reach``.

    ``cells`` (m, 8) are a unit direction, 0, radiance · solid angle in three colours, and the solid angle; those that
    follow each other near each other, as are directions (n, 3). ``weight`` is as ``frost_code`` takes it, wide if it
    reaches beyond ``WIDE``.
    """
    caps = np.empty(((len(cells) + TOGETHER - 1) // TOGETHER, 4), np.float32)
    for b in range(len(caps)):
        _cap(cells, b * TOGETHER, min(len(cells), (b + 1) * TOGETHER), caps[b])
    blocks = (len(directions) + LANES - 1) // LANES
    for part in prange((blocks + _BLOCKS - 1) // _BLOCKS):
        for block in range(part * _BLOCKS, min(blocks, (part + 1) * _BLOCKS)):
            _blur_block(directions, block * LANES, cells, weight, caps, reach, out)
