"""Spherical harmonics over the cells of a cube map: their means and their integrals."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..arrays import CubeMap, Float32
from . import cube_map, spherical_harmonics

_POINTS = 3  # of Gauss's rule along a side of a cell


@lru_cache(maxsize=4)
def cell_harmonics(
    order: int, resolution: int
) -> tuple[Float32[np.ndarray, "cells functions"], Float32[np.ndarray, "cells functions"]]:
    """Means of every function over each cell, and integrals, (6·R², (order + 1)²) each; read-only.

    The integrals project a map that is even over its cells; the means say what light of one function a cell has.
    """
    node, weight = np.polynomial.legendre.leggauss(_POINTS)
    edges = np.linspace(-1.0, 1.0, resolution + 1)
    half = 1.0 / resolution
    at = (edges[:-1, None] + half * (node + 1)).ravel()
    w = np.tile(weight * half, resolution)
    v, u = np.meshgrid(at, at, indexing="ij")
    area = np.multiply.outer(w, w) * (1 + u * u + v * v) ** -1.5
    tables = []
    for face in range(6):
        d = cube_map.directions(np.full(u.size, face), u.ravel(), v.ravel())
        values = spherical_harmonics.evaluate(order, d) * area.reshape(-1, 1)
        split = values.reshape(resolution, _POINTS, resolution, _POINTS, -1)
        tables.append(split.sum(axis=(1, 3)).reshape(resolution * resolution, -1))
    integrals = np.concatenate(tables)
    whole = np.add.reduceat(
        np.add.reduceat(area, np.arange(0, len(area), _POINTS), axis=0),
        np.arange(0, len(area), _POINTS),
        axis=1,
    )
    means = integrals / np.tile(whole.ravel(), 6)[:, None]
    out = means.astype(np.float32), integrals.astype(np.float32)
    for table in out:
        table.flags.writeable = False
    return out


def spectrum_of(cube: CubeMap, order: int) -> tuple[float, ...]:
    """The energy of a cube map in each order from 0 to ``order``: squares of its coefficients, of all colours."""
    _, integrals = cell_harmonics(order, cube.shape[1])
    squares = np.square(integrals.T.astype(np.float64) @ cube.reshape(-1, 3).astype(np.float64)).sum(axis=1)
    return tuple(float(squares[band * band : (band + 1) ** 2].sum()) for band in range(order + 1))
