"""Direct light of an environment at the vertices: strong lights by rays of their own, the rest by cells of the sky."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Positions, Radiance
from ..bases.cube_map import solid_angles, texel_directions
from ..lighting.environment import Environment
from ..storage.bake import Bake
from .form_factor_kernels import of_sky
from .light_rays import sky_bits
from .placed_direct import PlacedDirect
from .strong_lights import NO_LIGHTS, StrongLights, strong_discs, strongest, together, without

CELLS = 20  # along each face's side: 4.5°
_FINE = 12 * CELLS  # texels along a face's side, in which suns are looked for


class SkyDirect:
    """Direct irradiance / π of environments. What vertices see of the sky is traced once, when first asked for."""

    def __init__(self, bake: Bake, origins: Positions, placed: PlacedDirect) -> None:
        self._bake, self._origins, self._placed = bake, origins, placed

    def of(self, environment: Environment) -> Radiance:
        """(V, 3); exactly zero in the dark."""
        out = np.zeros((len(self._origins), 3), np.float32)
        if not max(environment.total) > 0:
            return out
        strong, rest = divided(environment)
        if rest.any():
            of_sky(self._bits, self._directions, _energies(rest), self._bake.receivers.normals, out)
        for direction, energy in zip(strong.directions, strong.energy, strict=True):
            out += self._placed.of_direction(direction)[:, None] * energy.astype(np.float32)
        return out

    @cached_property
    def _directions(self) -> np.ndarray:
        return texel_directions(np.arange(6 * CELLS**2, dtype=np.int32), CELLS)

    @cached_property
    def _bits(self) -> np.ndarray:
        return sky_bits(self._bake, self._origins, self._directions)


def divided(environment: Environment) -> tuple[StrongLights, np.ndarray]:
    """Its strong lights, and a cube map of the rest."""
    traced, discs = NO_LIGHTS, environment.discs
    if discs:
        traced, discs = strong_discs(discs, environment.total, _FINE)
    cube = environment.with_discs(tuple(discs)).cube(_FINE)
    strong = strongest(cube, total=environment.total)
    return together([traced, strong]), without(cube, strong)


def _energies(cube: np.ndarray) -> np.ndarray:
    """(cells, 3) radiance times solid angle, float64."""
    fine = cube.astype(np.float64) * solid_angles(_FINE)[..., None]
    side = _FINE // CELLS
    return fine.reshape(6, CELLS, side, CELLS, side, 3).sum(axis=(2, 4)).reshape(-1, 3)
