"""Walls from a plan: boxes of a grid that are solid, and the faces between them and the air."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...arrays import Float64
from ...material import Material
from .parts import Part, sheet, together

Paint = Callable[[int, int, tuple[int, int, int]], Material]  # axis, side (−1 or 1), solid cell


def block_faces(
    solid: np.ndarray, lines: Sequence[Float64[np.ndarray, "n"]], *, step: float, paint: Paint
) -> list[tuple[Part, Material]]:
    """Faces between solid cells and free ones, in meshes of about ``step`` metres, one part a material.

    Parameters
    ----------
    solid
        ``(X, Y, Z)`` bool. Beyond the grid all is free.
    lines
        Where cells begin and end along x, y and z, metres.
    paint
        The material of a face.
    """
    of: dict[str, tuple[list[Part], Material]] = {}
    padded = np.pad(solid, 1)
    for axis in range(3):
        for side in (-1, 1):
            beyond = np.roll(padded, -side, axis=axis)[1:-1, 1:-1, 1:-1]
            for cell in np.argwhere(solid & ~beyond).tolist():
                i, j, k = cell
                material = paint(axis, side, (i, j, k))
                of.setdefault(material.name, ([], material))[0].append(_face(lines, cell, axis, side, step))
    return [(together(parts), material) for parts, material in of.values()]


def _face(lines: Sequence[np.ndarray], cell: list[int], axis: int, side: int, step: float) -> Part:
    first, second = (axis + 1) % 3, (axis + 2) % 3  # first × second = +axis
    if side < 0:
        first, second = second, first
    corner = np.zeros(3)
    corner[axis] = lines[axis][cell[axis] + (side > 0)]
    ticks = []
    for a in (first, second):
        low, high = lines[a][cell[a]], lines[a][cell[a] + 1]
        ticks.append(np.linspace(low, high, max(1, round((high - low) / step)) + 1))
    return sheet(corner, np.eye(3)[first], np.eye(3)[second], s=ticks[0], t=ticks[1])
