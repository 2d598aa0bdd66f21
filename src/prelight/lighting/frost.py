"""Frosted glass: the light of a shell blurred on the sphere, not on the pixels of its cube."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ..arrays import CubeMap, Float32, Float64, Int32
from ..bases import cube_map
from .frost_code import HALVINGS, TERMS, WIDE
from .frost_kernels import blur
from .glass import Glass
from .rough_pane import rough_pane

CELLS_PER_SIGMA = 2.0  # of the cube that is blurred
_ROUGHLY, _MOST_ROUGHLY = 1.5, 16  # the same while a hand drags, and cells of a side at most
_CUT = 4.0  # standard deviations
_LEAST_DEG, _LEAST_OF_CELL = 0.05, 0.1  # less frost changes nothing: absolutely, and of a cell of the cube
_PLACES = 64  # at which the polynomial of a weight is fitted


def frosted(
    shell: CubeMap,
    frost_deg: float,
    outward: Float32[np.ndarray, "3"] | None = None,
    *,
    cells_per_sigma: float = CELLS_PER_SIGMA,
    most_cells: int = 64,
) -> CubeMap:
    """What comes through frosted glass: each direction the mean of those around it, by a Gaussian of their angle.

    Parameters
    ----------
    shell
        ``(6, n, n, 3)`` radiance.
    frost_deg
        Standard deviation, degrees; 0 leaves everything as it is, and so does a tenth of a cell.
    outward
        The unit normal of a flat pane, toward the outside: light from behind the pane's plane does not count. Zeros or
        None where a pane is not flat.
    cells_per_sigma, most_cells
        Of the cube that is blurred, at least, and of its side at most, while its resolution can be halved.

    An even shell stays as it is.
    """
    n = shell.shape[1]
    if frost_deg <= max(_LEAST_DEG, _LEAST_OF_CELL * 90 / n):  # what reaches the next cell is below float32
        return shell
    sigma = math.radians(frost_deg)
    coarse = n
    enough = cells_per_sigma * math.pi / 2 / sigma
    while coarse % 2 == 0 and (coarse // 2 >= enough or coarse > most_cells):
        coarse //= 2
    directions, _ = _cells(n)
    inner, areas, order = *_cells(coarse), _neighbours(coarse)
    light = shell.reshape(-1, 3) if coarse == n else _averaged(shell, coarse)
    if coarse != n:
        inner = _middles(shell, coarse)
    cells = np.zeros((len(inner), 8), np.float32)
    cells[:, :3], cells[:, 4:7], cells[:, 7] = inner, light * areas[:, None], areas
    cells = cells[order]
    if outward is not None:  # what does not count need not be looked at for every direction
        cells = cells[cells[:, :3] @ outward >= 0]
    reach = float(np.float32(min(math.pi, _CUT * sigma)))  # so that all agree whether it is wide
    out = np.empty((len(directions), 3), np.float32)
    blur(
        *(_frozen(a) for a in (directions[_neighbours(n)], cells, _weight(sigma, reach))),
        np.float32(reach),
        out,
    )
    blurred = np.empty_like(out)
    blurred[_neighbours(n)] = out
    return blurred.reshape(shell.shape)


@lru_cache(maxsize=1)
def _fit() -> tuple[Float64[np.ndarray, "places"], Float64[np.ndarray, "terms places"]]:
    """Places between 0 and 1, and what makes a polynomial of values there."""
    places = 0.5 - 0.5 * np.cos(np.pi * (np.arange(_PLACES) + 0.5) / _PLACES)
    return places, np.linalg.pinv(places[:, None] ** np.arange(TERMS))


def _weight(sigma: float, reach: float) -> Float32[np.ndarray, "terms_and_one"]:
    """A Gaussian of the angle up to ``reach``, radians, as the kernel takes it."""
    places, fit = _fit()
    part = 2 if reach > WIDE else 1  # of the angle: see frost_code
    most = 1 - math.cos(reach / part)
    angle = part * np.arccos(np.clip(1 - most * places, -1, 1))
    root = np.exp(-0.5 * (angle / sigma) ** 2 / 2**HALVINGS)
    return np.append(fit @ root, 1 / most).astype(np.float32)


def through_glass(
    shell: CubeMap, glass: Glass, outward: Float32[np.ndarray, "3"], *, roughly: bool = False
) -> CubeMap:
    """A shell as it is seen through glass but for its colour: blurred, and of a rough pane dimmed at a slant.

    A pane that is not flat (``outward`` zero) lets as much through everywhere as a rough one does of an even sky.
    ``roughly``: of larger cells, while a hand drags.
    """
    cells, most = (_ROUGHLY, _MOST_ROUGHLY) if roughly else (CELLS_PER_SIGMA, shell.shape[1])
    blurred = frosted(shell, glass.frost, outward, cells_per_sigma=cells, most_cells=most)
    if glass.rough is None:
        return blurred
    pane = rough_pane(glass.rough)
    if not outward.any():
        return blurred * np.float32(pane.mean)
    directions, _ = _cells(shell.shape[1])
    share = pane.share(directions @ outward).astype(np.float32)
    return blurred * share.reshape(*shell.shape[:3], 1)


@lru_cache(maxsize=8)
def _cells(resolution: int) -> tuple[Float32[np.ndarray, "cells 3"], Float32[np.ndarray, "cells"]]:
    texels = np.arange(6 * resolution**2, dtype=np.int32)
    areas = np.tile(cube_map.solid_angles(resolution).ravel(), 6)
    return cube_map.texel_directions(texels, resolution), areas


@lru_cache(maxsize=8)
def _neighbours(resolution: int) -> Int32[np.ndarray, "cells"]:
    """The cells in an order in which neighbours follow each other: squares of four, of four of these, and so on."""
    row, column = np.meshgrid(np.arange(resolution), np.arange(resolution), indexing="ij")
    code = np.zeros((resolution, resolution), np.int64)
    for bit in range(resolution.bit_length()):
        code |= (column >> bit & 1) << 2 * bit | (row >> bit & 1) << 2 * bit + 1
    face = np.argsort(code.ravel(), kind="stable")
    return (np.arange(6)[:, None] * resolution**2 + face).ravel().astype(np.int32)


def _middles(shell: CubeMap, coarse: int) -> Float32[np.ndarray, "cells 3"]:
    """Where the light of each block of cells is, unit directions: of one with a sun, the sun's own cell."""
    n, small = shell.shape[1], np.float32(1e-6) * max(float(shell.mean()), 1e-30)
    towards = _cells(n)[0].reshape(6, n, n, 3)
    weight = (shell.sum(axis=3) + small) * cube_map.solid_angles(n).astype(np.float32)
    split = (6, coarse, n // coarse, coarse, n // coarse, 3)
    sums = (towards * weight[..., None]).reshape(split).sum(axis=(2, 4)).reshape(-1, 3)
    return (sums / np.linalg.norm(sums, axis=1, keepdims=True)).astype(np.float32)


def _averaged(shell: CubeMap, coarse: int) -> Float32[np.ndarray, "cells 3"]:
    """Means over blocks of cells, by solid angle."""
    n = shell.shape[1]
    area = cube_map.solid_angles(n)[None, :, :, None]
    split = (6, coarse, n // coarse, coarse, n // coarse)
    sums = (shell * area).reshape(*split, 3).sum(axis=(2, 4))
    areas = np.broadcast_to(area, (6, n, n, 1)).reshape(*split, 1).sum(axis=(2, 4))
    return np.ascontiguousarray((sums / areas).reshape(-1, 3), np.float32)


def _frozen(a: np.ndarray) -> np.ndarray:
    view = np.ascontiguousarray(a, np.float32).view()
    view.flags.writeable = False
    return view
