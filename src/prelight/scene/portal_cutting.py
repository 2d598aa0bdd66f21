"""Cutting portals until none is larger than what is outside allows (paper, section 6)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Float64, Int32
from ..errors import InputError

_SLIVER = 1e-9  # of the extent squared: pieces of less area are left out

Piece = tuple[Float64[np.ndarray, "triangles 3 3"], Int32[np.ndarray, "triangles"]]


def cut_to_size(
    corners: Float64[np.ndarray, "triangles 3 3"],
    source: Int32[np.ndarray, "triangles"],
    *,
    longest: float,
    most: int,
    extent_of: Callable[[np.ndarray], float],
) -> list[Piece]:
    """Pieces of triangles, no two points of one piece farther apart than ``longest`` metres, in order along the cuts.

    Halved again and again across the middle of the longest side of the box around them; triangles that lie across
    a cut are cut. ``source`` goes along. Raises InputError where that makes more than ``most``.
    """
    done: list[Piece] = []
    open_: list[Piece] = [(corners, source)]
    while open_:
        piece = open_.pop()
        if extent_of(piece[0]) < longest:
            done.append(piece)
            continue
        open_.extend(reversed(_halved(*piece)))
        if len(done) + len(open_) > most:
            what = f"cut to {longest:.3g} m they would be more than {most:,}; a larger --exterior-distance or --theta"
            raise InputError("portals", what + " makes fewer")
    return done


def _halved(corners: np.ndarray, source: np.ndarray) -> list[Piece]:
    flat = corners.reshape(-1, 3)
    low, high = flat.min(axis=0), flat.max(axis=0)
    axis = int(np.argmax(high - low))
    middle = (low[axis] + high[axis]) / 2
    least = _SLIVER * float(np.linalg.norm(high - low)) ** 2
    pieces = []
    for side in (1, -1):
        made, of = _clipped(corners, side * (corners[:, :, axis] - middle))
        a, b, c = np.moveaxis(made, 1, 0)
        kept = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2 > least
        if kept.any():
            pieces.append((made[kept], source[of][kept]))
    return pieces


def _clipped(corners: np.ndarray, height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What of the triangles lies where ``height`` (T, 3), linear between corners, is below 0; and of which it is."""
    below = height <= 0
    count = below.sum(axis=1)
    made, of = [corners[count == 3]], [np.flatnonzero(count == 3)]
    for kept in (1, 2):
        chosen = np.flatnonzero(count == kept)
        lone = (below if kept == 1 else ~below)[chosen].argmax(axis=1)  # the corner on a side by itself
        turned = (lone[:, None] + np.arange(3)) % 3
        p = np.take_along_axis(corners[chosen], turned[:, :, None], axis=1)
        h = np.take_along_axis(height[chosen], turned, axis=1)
        share = h[:, :1] / (h[:, :1] - h[:, 1:])
        crossing = p[:, :1] + share[:, :, None] * (p[:, 1:] - p[:, :1])
        q, r = crossing[:, 0], crossing[:, 1]
        if kept == 1:
            made.append(np.stack([p[:, 0], q, r], axis=1))
            of.append(chosen)
        else:
            made += [np.stack([q, p[:, 1], p[:, 2]], axis=1), np.stack([q, p[:, 2], r], axis=1)]
            of += [chosen, chosen]
    return np.concatenate(made), np.concatenate(of)
