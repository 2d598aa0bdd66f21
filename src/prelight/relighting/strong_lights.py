"""The few lights that carry much of the energy: found in an environment, to be traced exactly.

A cluster stands for its lights to within the bake's tolerance, which is an error of that share of each
light's own contribution. Over thousands of lights such errors average out; for a sun that is half of all
light they are seen. So cells of a third of a degree that carry more than a five-hundredth of the light are
taken out of the clusters, and B gains Σ E_cell · T(direction of the cell), its visibility found by rays.
What is strong follows from the environment alone, never from how it came about.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import CubeMap, Directions, Float32, Float64, Int32
from ..bases.cube_map import directions, solid_angles
from ..lighting.disc import Disc, Texels
from .strong_light_kernels import cell_energies

SHARE = 0.002  # of all light of some channel, from which a cell is strong
MOST = 64  # cells
_GRID = 256  # cells along a face's side: 0.35° each in its middle
_TIMES_MEAN = 10  # a cell's radiance over the mean
LARGEST_DISC_DEG = 2.0  # of a disc that may be traced
_SHARE_OF_DISC = 0.01


@dataclass(frozen=True)
class StrongLights:
    """Rectangles of texels, the direction each one's light comes from, and how much there is."""

    rectangles: Int32[np.ndarray, "cells 5"]  # face, row, column, height, width; none overlap
    directions: Directions  # (cells, 3) unit; towards the centre of the cell's energy
    energy: Float64[np.ndarray, "cells 3"]  # Σ radiance · solid angle

    def __len__(self) -> int:
        return len(self.rectangles)

    def chosen(self, which: Sequence[int]) -> StrongLights:
        """Some of them."""
        k = np.array(which, np.int64)
        return StrongLights(self.rectangles[k], self.directions[k], self.energy[k])

    def parts(self, side: int, *, resolution: int) -> Float32[np.ndarray, "cells parts 3"]:
        """Unit directions of the middles of side × side parts of each rectangle, in texels of R² to a face."""
        face, row, column, height, width = (x[:, None] for x in self.rectangles.T)
        down, right = (x.ravel() for x in np.meshgrid(*2 * [(np.arange(side) + 0.5) / side], indexing="ij"))
        v, u = (2 * (row + height * down) / resolution - 1, 2 * (column + width * right) / resolution - 1)
        d = directions(np.broadcast_to(face, v.shape), u, v)
        return np.ascontiguousarray(d, np.float32)


NO_LIGHTS = StrongLights(np.zeros((0, 5), np.int32), np.zeros((0, 3), np.float32), np.zeros((0, 3)))


def strongest(
    cube: CubeMap, *, total: Float64[np.ndarray, "3"], share: float = SHARE, most: int = MOST
) -> StrongLights:
    """The cells of a cube map (6, R, R, 3) that carry more than ``share`` of some channel's light each.

    In coarse maps, whose cells are large, more than ten times their part of the sphere. ``total`` is the light
    of everything, ∫ L dω by channel. At most ``most``, the strongest; while there is room they are cut in
    four, down to single texels, so that a small sun in a fine map keeps its penumbra.
    """
    R = cube.shape[1]
    side = -(-R // _GRID)
    G = -(-R // side)
    share = max(share, _TIMES_MEAN / (6 * G * G))
    energy = np.empty((6, G, G, 3))
    cell_energies(cube, solid_angles(R), side, energy)
    red, green, blue = ((energy[..., c] > share * total[c]) & (total[c] > 0) for c in range(3))
    cells = np.argwhere(red | green | blue)
    if len(cells) > most:
        weight = (energy[tuple(cells.T)] / np.where(total > 0, total, np.inf)).max(axis=-1)
        cells = cells[np.sort(np.argsort(-weight, kind="stable")[:most])]
    start = cells[:, 1:] * side
    size = np.minimum(start + side, R) - start
    rectangles = np.concatenate([cells[:, :1], start, size], axis=1).astype(np.int32)
    while len(rectangles) and (finer := _quartered(rectangles, cube)) is not None and len(finer) <= most:
        rectangles = finer
    return _measured(rectangles, cube)


def strong_discs(
    discs: Sequence[Disc], total: Float64[np.ndarray, "3"], resolution: int
) -> tuple[StrongLights, list[Disc]]:
    """The small discs that carry more than a hundredth of all light, as texels or blocks of them; and the others.

    ``total``: the light of everything, ∫ L dω by channel.
    """
    blocks, others = [], []
    for disc in discs:
        share = np.max(disc.total / np.where(total > 0, total, np.inf))
        if disc.radius_deg > LARGEST_DISC_DEG or share <= _SHARE_OF_DISC:
            others.append(disc)
            continue
        texels = disc.texels(resolution)
        side = 1
        while len(found := _blocks(texels, side, resolution)) > MOST:
            side *= 2
        blocks.append(found)
    return (together(blocks) if blocks else _of([], [], [])), others


def together(lights: Sequence[StrongLights]) -> StrongLights:
    """All of them."""
    return StrongLights(
        *(
            np.concatenate([getattr(l, name) for l in lights])
            for name in ("rectangles", "directions", "energy")
        )
    )


def without(cube: CubeMap, strong: StrongLights) -> CubeMap:
    """A copy of the cube, dark where the strong lights are."""
    left = cube.copy()
    for face, row, column, height, width in strong.rectangles:
        left[face, row : row + height, column : column + width] = 0
    return left


def _quartered(rectangles: np.ndarray, cube: CubeMap) -> np.ndarray | None:
    """Each cut in four where it can be, dark quarters left out; None where all are single texels."""
    if (rectangles[:, 3:] <= 1).all():
        return None
    face, row, column, height, width = rectangles.T
    upper, left = -(-height // 2), -(-width // 2)
    quarters = np.concatenate(
        [
            np.stack([face, row + dr, column + dc, h, w], axis=1)
            for dr, h in ((0 * row, upper), (upper, height - upper))
            for dc, w in ((0 * row, left), (left, width - left))
        ]
    )
    quarters = quarters[(quarters[:, 3] > 0) & (quarters[:, 4] > 0)]
    lit = [cube[f, r : r + h, c : c + w].any() for f, r, c, h, w in quarters]
    return quarters[lit]


def _measured(rectangles: np.ndarray, cube: CubeMap) -> StrongLights:
    """Energy of rectangles of a cube map, and the direction of its centre."""
    found = [_energy(cube[f, r : r + h, c : c + w], (f, r, c), cube.shape[1]) for f, r, c, h, w in rectangles]
    return _of(rectangles, [d for d, _ in found], [e for _, e in found])


def _blocks(texels: Sequence[Texels], side: int, resolution: int) -> StrongLights:
    """A disc's texels in blocks of side×side, dark ones left out."""
    rectangles, towards, energies = [], [], []
    for face, rows, columns, radiance in texels:
        for r in range(0, radiance.shape[0], side):
            for c in range(0, radiance.shape[1], side):
                block = radiance[r : r + side, c : c + side]
                if block.any():
                    corner = (face, rows.start + r, columns.start + c)
                    d, energy = _energy(block, corner, resolution)
                    rectangles.append((*corner, *block.shape[:2]))
                    towards.append(d)
                    energies.append(energy)
    return _of(rectangles, towards, energies)


def _energy(
    radiance: np.ndarray, corner: tuple[int, int, int], resolution: int
) -> tuple[np.ndarray, np.ndarray]:
    """Σ direction · brightest channel, and Σ radiance · solid angle, of texels from a corner on."""
    face, row, column = corner
    height, width = radiance.shape[:2]
    rows, columns = slice(row, row + height), slice(column, column + width)
    light = radiance.astype(np.float64) * solid_angles(resolution)[rows, columns, None]
    v, u = np.mgrid[rows, columns] * 2.0 / resolution + (1.0 / resolution - 1.0)
    d = directions(np.full(u.size, face), u.ravel(), v.ravel())
    return light.max(axis=-1).ravel() @ d, light.sum(axis=(0, 1))


def _of(rectangles: Sequence | np.ndarray, towards: Sequence, energy: Sequence) -> StrongLights:
    """Lights of directions of any length."""
    d = np.array(towards, np.float64).reshape(-1, 3)
    length = np.linalg.norm(d, axis=1, keepdims=True)
    return StrongLights(
        np.array(rectangles, np.int32).reshape(-1, 5),
        (d / np.where(length > 0, length, 1)).astype(np.float32),
        np.array(energy, np.float64).reshape(-1, 3),
    )
