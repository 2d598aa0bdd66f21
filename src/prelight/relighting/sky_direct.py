"""Direct light of an environment at the vertices: strong lights by rays of their own, the rest by cells of the sky."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np

from ..arrays import Float32, Int32, Positions, Radiance
from ..bases.cube_map import solid_angles, texel_directions
from ..encoding.pulse_or_haar import flat_layer, lit
from ..lighting.environment import Environment
from ..storage.bake import Bake
from .form_factor_kernels import of_sky
from .light_rays import sky_bits
from .placed_direct import PlacedDirect
from .strong_lights import MOST, NO_LIGHTS, StrongLights, strong_discs, strongest, together, without

CELLS = 20  # along each face's side: 4.5°
_BYTES_AT_ONCE = 1024  # of bits that are turned over
_VERTICES_AT_ONCE, _BYTE = 1024, 255  # whose rows are made together; a cosine of 1
_FINE = 12 * CELLS  # texels along a face's side, in which suns are looked for
_ROUGH, _FEW_STRONG = 3, 4  # texels of a cell, and suns, while a hand drags
QUICK_SIDE = _ROUGH * CELLS  # texels along a face's side, then


class SkyDirect:
    """Direct irradiance / π of environments. What vertices see of the sky is traced once, when first asked for."""

    def __init__(self, bake: Bake, origins: Positions, placed: PlacedDirect) -> None:
        self._bake, self._origins, self._placed = bake, origins, placed
        self._some: tuple[np.ndarray, tuple] | None = None  # vertices, and what they see of the sky as rows

    def of(self, environment: Environment, *, check: Callable[[], None] = lambda: None) -> Radiance:
        """(V, 3); exactly zero in the dark. ``check`` is called now and then, and may raise to give up."""
        out = np.zeros((len(self._origins), 3), np.float32)
        if not max(environment.total) > 0:
            return out
        strong, rest = divided(environment)
        if rest.any():
            of_sky(self._bits, self._directions, _energies(rest), self._bake.receivers.normals, out)
        for direction, energy in zip(strong.directions, strong.energy, strict=True):
            check()
            out += self._placed.of_direction(direction)[:, None] * energy.astype(np.float32)
        return out

    def roughly(self, environment: Environment, rows: Int32[np.ndarray, "n"]) -> Float32[np.ndarray, "n 3"]:
        """(n, 3) at some vertices: by fewer cells of the sky, and few strong lights."""
        out = np.zeros((len(rows), 3), np.float32)
        if not max(environment.total) > 0:
            return out
        strong, rest = divided(environment, fine=QUICK_SIDE, most=_FEW_STRONG)
        if rest.any():
            if self._some is None or self._some[0] is not rows:
                self._some = rows, self._rows_of(rows)
            table = np.zeros((2, 6 * CELLS**2, 4), np.float32)
            table[0, :, :3] = _energies(rest)
            lit(self._some[1], [(table, out)], 0, len(rows))
        for direction, energy in zip(strong.directions, strong.energy, strict=True):
            out += self._placed.of_direction(direction, rows)[:, None] * energy.astype(np.float32)
        return out

    def _rows_of(self, rows: Int32[np.ndarray, "n"]) -> tuple:
        """Cosines / π of the cells that some vertices see, in bytes, as ``lit`` takes them."""
        cells, cosines, counts = [], [], [np.zeros(1, np.int64)]
        for first in range(0, len(rows), _VERTICES_AT_ONCE):
            some = rows[first : first + _VERTICES_AT_ONCE]
            seen = np.unpackbits(self._bits[some], axis=1, count=6 * CELLS**2, bitorder="little")
            cosine = self._bake.receivers.normals[some] @ self._directions.T * seen
            shares = np.rint(np.maximum(cosine, 0) * _BYTE).astype(np.uint8)
            vertex, cell = np.nonzero(shares)
            cells.append(cell.astype(np.uint16))
            cosines.append(shares[vertex, cell])
            counts.append(np.bincount(vertex, minlength=len(some)))
        n, starts = len(rows), np.cumsum(np.concatenate(counts))
        return flat_layer(
            np.full(n, 1 / (_BYTE * np.pi)), starts, np.concatenate(cells), np.concatenate(cosines)
        )

    @cached_property
    def _directions(self) -> np.ndarray:
        return texel_directions(np.arange(6 * CELLS**2, dtype=np.int32), CELLS)

    @cached_property
    def _bits(self) -> np.ndarray:
        """(V, bytes) which cells each vertex sees."""
        by_cell, vertices = sky_bits(self._bake, self._origins, self._directions), len(self._origins)
        out = np.empty((vertices, -(-len(by_cell) // 8)), np.uint8)
        for first in range(0, by_cell.shape[1], _BYTES_AT_ONCE):
            some = np.unpackbits(by_cell[:, first : first + _BYTES_AT_ONCE], axis=1, bitorder="little")
            rows = out[8 * first : 8 * (first + _BYTES_AT_ONCE)]
            rows[:] = np.packbits(some[:, : len(rows)].T, axis=1, bitorder="little")
        out.setflags(write=False)
        return out


def divided(
    environment: Environment, *, fine: int = _FINE, most: int = MOST
) -> tuple[StrongLights, np.ndarray]:
    """Its strong lights, at most so many of its map's, and a cube map of the rest, of ``fine`` texels a side."""
    traced, discs = NO_LIGHTS, environment.discs
    if discs:
        traced, discs = strong_discs(discs, environment.total, fine)
    cube = environment.with_discs(tuple(discs)).cube(fine)
    strong = strongest(cube, total=environment.total, most=most)
    return together([traced, strong]), without(cube, strong)


def _energies(cube: np.ndarray) -> np.ndarray:
    """(cells, 3) radiance times solid angle, float64."""
    fine = cube.astype(np.float64) * solid_angles(cube.shape[1])[..., None]
    side = cube.shape[1] // CELLS
    return fine.reshape(6, CELLS, side, CELLS, side, 3).sum(axis=(2, 4)).reshape(-1, 3)
