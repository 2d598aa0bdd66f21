"""Lights anywhere in a scene, from a seed: what modes are found from, and other ones that errors are measured on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Positions
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from ..transport.hemisphere import HemisphereRays
from ..transport.lamps import SphereLamps, lamp_light
from ..transport.spreading import vertex_areas

_STAGE = 37  # keeps these random numbers apart from those of other stages
_NEAREST, _FARTHEST = 0.08, 0.92  # of the way from one surface to the next
_TRIES = 6  # places for each light, of which those between surfaces are taken first
_WIDTHS = (20.0, 100.0)  # degrees, of spots
_AT_ONCE = 32  # lights
_LOOKED_AT = 20_000  # vertices, for how far away they are


@dataclass(frozen=True)
class TrialLights:
    """Points, every other of which is a spot: a power of the cosine about its beam.

    ``exponents`` is 0 where a light shines alike all around.
    """

    places: Float64[np.ndarray, "lights 3"]
    beams: Float64[np.ndarray, "lights 3"]
    exponents: Float64[np.ndarray, "lights"]

    @classmethod
    def anywhere(
        cls,
        scene: Scene,
        occluders: Occluders,
        origins: Positions,
        *,
        count: int,
        seed: int,
        clear: float = 0.0,
    ) -> TrialLights:
        """Between surfaces, where there are any: on the way from a vertex, chosen by area, to what it sees.

        Those go first that are farther from all vertices than ``clear``, a share of the scene's extent.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, _STAGE]))
        areas = np.where(scene.normals.any(axis=1), vertex_areas(scene), 0).astype(np.float64)
        rows = (
            rng.choice(len(areas), _TRIES * count, p=areas / areas.sum()) if areas.any() else np.zeros(0, int)
        )
        ends, met = _ends(scene, occluders, origins, rows=rows, seed=seed)
        along = rng.uniform(_NEAREST, _FARTHEST, (len(rows), 1))
        places = origins[rows] * (1 - along) + ends * along
        near = _distances(places, origins) < clear * float(np.ptp(origins, axis=0).max())
        first = np.lexsort((near, ~met))[:count]
        places = places[first]
        beams = rng.standard_normal((len(first), 3))
        beams /= np.linalg.norm(beams, axis=1, keepdims=True)
        widths = np.exp(rng.uniform(*np.log(_WIDTHS), len(first)))
        exponents = np.log(0.5) / np.log(np.cos(np.radians(widths / 2)))
        exponents[::2] = 0.0
        return cls(places, beams, exponents)

    def __len__(self) -> int:
        return len(self.places)

    def direct(
        self, occluders: Occluders, origins: Positions, normals: Positions
    ) -> Float32[np.ndarray, "receivers lights"]:
        """Irradiance / π of each light, of intensity 1 along its beam, at receivers."""
        out = np.empty((len(origins), len(self)), np.float32)
        for start in range(0, len(self), _AT_ONCE):
            part = slice(start, min(start + _AT_ONCE, len(self)))
            places = self.places[part].astype(np.float32)
            power = np.full((len(places), 3), 4 * np.pi, np.float32)
            lamps = SphereLamps(places, np.zeros(len(places), np.float32), power)
            out[:, part] = lamp_light(occluders, origins, normals, lamps=lamps, rays=1)[..., 0]
        for k in np.flatnonzero(self.exponents):
            way = origins - self.places[k]
            cosine = way @ self.beams[k] / np.maximum(np.linalg.norm(way, axis=1), 1e-12)
            out[:, k] *= np.maximum(cosine, 0.0) ** self.exponents[k]
        return out


def _distances(places: np.ndarray, origins: Positions) -> np.ndarray:
    """To the nearest of the vertices, or of some of them."""
    some = origins[:: max(1, len(origins) // _LOOKED_AT)].astype(np.float64)
    return np.array([np.sqrt(np.square(some - place).sum(axis=1).min()) for place in places])


def _ends(
    scene: Scene, occluders: Occluders, origins: Positions, *, rows: np.ndarray, seed: int
) -> tuple[Float64[np.ndarray, "rows 3"], np.ndarray]:
    """Where one ray of each row ends, and whether it met the lit side of something; else somewhere ahead."""
    rays = HemisphereRays(
        occluders, scene, origins=origins[rows], normals=scene.normals[rows], rays=1, seed=seed + _STAGE
    )
    hits = rays.trace(0, len(rows)) if len(rows) else None
    if hits is None:
        return np.zeros((0, 3)), np.zeros(0, bool)
    triangle, u, v = hits.triangle[:, 0], hits.u[:, :1].astype(np.float64), hits.v[:, :1].astype(np.float64)
    a, b, c = (scene.positions[scene.triangles[triangle, k]].astype(np.float64) for k in range(3))
    extent = float(np.ptp(scene.positions, axis=0).max())
    ahead = origins[rows] + 0.5 * extent * scene.normals[rows]
    met = triangle >= 0
    return np.where(met[:, None], (1 - u - v) * a + u * b + v * c, ahead), met
