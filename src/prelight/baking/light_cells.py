"""Cells of the light: the nodes of the quadtree at one depth, coarse, for what light does after it has bounced.

Bounced light hardly changes from one direction to the next, so its lights are some sixteen by sixteen cells of a
face, whatever the resolution of the cube map; T of a cell is the mean over it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import Directions, Float32, Float64
from ..bases.cube_map import directions, mean_directions, rectangle_solid_angles
from ..bases.quadtree import Nodes, roots, split
from ..transport.direct import DiffuseTransfer

DEPTH = 4  # 16×16 cells of a face, if R is as large
_FINEST = 32  # directions along a face's side that visibility is asked in
DIRECTIONS = 6 * _FINEST**2  # of all cells, about
ASKED_AT_ONCE = 1 << 23  # receiver-directions whose transfer is held as floats


def light_cells(resolution: int) -> Nodes:
    """Cells (K, 5) in Z-order: 6·16² nodes, or single texels of a smaller cube map."""
    nodes = roots(resolution)
    for _ in range(DEPTH):
        nodes, _ = split(nodes)
    return nodes


def cell_samples(
    cells: Nodes, resolution: int
) -> tuple[Float32[np.ndarray, "cells samples 3"], Float32[np.ndarray, "cells samples"]]:
    """Directions that stand for each cell, and the share of its solid angle that each has."""
    depth = min(DEPTH, int(np.ceil(np.log2(resolution)))) if resolution > 1 else 0
    side = _FINEST >> depth
    face, row, column, height, width = cells.T
    part = np.arange(side) + 0.5
    v = (row[:, None] + height[:, None] * part / side) * (2.0 / resolution) - 1
    u = (column[:, None] + width[:, None] * part / side) * (2.0 / resolution) - 1
    u, v = (a.reshape(len(cells), -1) for a in np.broadcast_arrays(u[:, None, :], v[:, :, None]))
    d = directions(np.repeat(face, side * side), u.ravel(), v.ravel())
    shares = (1 + u * u + v * v) ** -1.5  # of equal areas of the face, to well within their size
    shares /= shares.sum(axis=1, keepdims=True)
    return d.reshape(len(cells), -1, 3).astype(np.float32), shares.astype(np.float32)


def solid_angles_of(cells: Nodes, resolution: int) -> Float64[np.ndarray, "cells"]:
    """Of each cell, steradians."""
    _, row, column, height, width = cells.T
    v = np.stack([row, row + height], axis=1) * (2.0 / resolution) - 1
    u = np.stack([column, column + width], axis=1) * (2.0 / resolution) - 1
    return np.array([rectangle_solid_angles(a, b)[0, 0] for a, b in zip(u, v, strict=True)])


def smooth_lights(cells: Nodes, resolution: int) -> Float64[np.ndarray, "cells 9"]:
    """Skies as smooth as skies can be: 1, x, y, z and their five products of second degree, of each cell."""
    d = mean_directions(cells, resolution)
    x, y, z = (d / np.linalg.norm(d, axis=1, keepdims=True)).T
    return np.stack([np.ones(len(d)), x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1], axis=1)


class CellLight:
    """Direct light of each cell alone at a set of Lambertian receivers; rays are traced once and kept as bits."""

    def __init__(self, transfer: DiffuseTransfer, cells: Nodes, resolution: int) -> None:
        self._transfer = transfer
        self._d, self._shares = cell_samples(cells, resolution)
        self._seen: list[np.ndarray] = []
        self.rays = 0

    def trace(self, *, lanes: int) -> Iterator[float]:
        """Ask for visibility; yields the share done."""
        for part in self._parts():
            bits, rays = self._transfer.trace(self._directions(part), lanes=lanes)
            self._seen.append(bits)
            self.rays += int(rays.sum())
            yield part.stop / len(self._d)

    def blocks(self) -> Iterator[tuple[slice, Float32[np.ndarray, "cells receivers"]]]:
        """Some cells after the other: irradiance / π of unit light from each."""
        for part, bits in zip(self._parts(), self._seen, strict=True):
            T = self._transfer.values(bits, self._directions(part))[:, 0]
            shares = self._shares[part]
            T = T.reshape(*shares.shape, -1)
            of_cell = T[:, 0] * shares[:, :1]
            for sample in range(1, T.shape[1]):
                of_cell += T[:, sample] * shares[:, sample, None]
            yield part, of_cell

    def _directions(self, part: slice) -> Directions:
        return self._d[part].reshape(-1, 3)

    def _parts(self) -> Iterator[slice]:
        step = max(1, ASKED_AT_ONCE // (self._d.shape[1] * max(self._transfer.receivers, 1)))
        for start in range(0, len(self._d), step):
            yield slice(start, min(start + step, len(self._d)))
