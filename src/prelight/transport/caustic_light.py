"""What glass and mirrors send of one light, quickly: photons counted where they land, between the vertices around.

A photon adds to the three vertices of its triangle by its barycentric weights: the projection on light that is linear
over triangles, its mass matrix lumped. That widens a caustic, by h²/12 times its second derivative; the whole matrix
would do twice that again, so half a step of Richardson's iteration with it takes it back. No neighbours are looked for,
so that it can follow a light that moves.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Float32, Float64
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from .lamps import SphereLamps
from .photon_sources import PhotonSource, SphereSource, TriangleSource
from .photon_tracing import BATCH, CAUSTIC, Photons, PhotonTracer
from .specular import specular_materials

_STEP = 0.5
_ENOUGH = 48  # photons of a vertex: where fewer land light is faint, and smoothed

Light = Float32[np.ndarray, "vertices 3"]


class CausticLight:
    """Caustics at the vertices of a scene.

    Parameters
    ----------
    scene, occluders
        Triangles and materials, and the renderer's scene of the same triangles.
    """

    def __init__(self, scene: Scene, occluders: Occluders) -> None:
        self._scene, self._occluders = scene, occluders
        self._tracers: dict[type, PhotonTracer] = {}

    def of_ball(self, centre: Float64[np.ndarray, "3"], radius: float, *, photons: int) -> Photons:
        """Photons of a ball or point of intensity 1 W/sr, each still without the shape of its beam."""
        lamps = SphereLamps(
            np.array([centre], np.float32),
            np.array([radius], np.float32),
            np.full((1, 3), 4 * np.pi, np.float32),
        )
        return self._traced(SphereSource(lamps, is_placed=False), photons)

    def of_panel(self, corners: Float64[np.ndarray, "4 3"], *, photons: int) -> Photons:
        """Photons of a rectangle of radiance 1, its corners counter-clockwise from where it shines."""
        triangles = corners[[[0, 1, 2], [0, 2, 3]]].astype(np.float32)
        source = TriangleSource(
            triangles, np.ones((2, 3), np.float32), np.zeros(2, np.int32), is_placed=False
        )
        return self._traced(source, photons)

    def at_vertices(self, photons: Photons) -> Light:
        """Irradiance / π."""
        scene, V = self._scene, len(self._scene.positions)
        if not len(photons):
            return np.zeros((V, 3), np.float32)
        corners = scene.triangles[photons.triangle]
        weights = _barycentric(
            scene.positions[corners].astype(np.float64), photons.position.astype(np.float64)
        )
        power = photons.power / (np.pi * photons.emitted)
        landed = np.stack(
            [
                sum(np.bincount(corners[:, k], weights[:, k] * power[:, c], V) for k in range(3))
                for c in range(3)
            ],
            axis=1,
        )
        triangles, areas, around = self._landed_on
        inverse = np.divide(1, around, out=np.zeros_like(around), where=around > 0)[:, None]
        light = landed * inverse

        def wider(values: np.ndarray) -> np.ndarray:
            return _mass_times(values, triangles, areas) * inverse

        blurred = wider(light)
        sharp = light + _STEP * (light - blurred)
        counted = np.bincount(corners.ravel(), weights.ravel(), V)[:, None]
        trust = np.minimum(wider(wider(counted * inverse)) / _ENOUGH * around[:, None], 1)
        found = trust * sharp + (1 - trust) * wider(wider(blurred))
        return np.maximum(found, 0).astype(np.float32)

    def _traced(self, source: PhotonSource, photons: int) -> Photons:
        known = self._tracers.get(type(source))
        if known is None:
            known = PhotonTracer(self._scene, self._occluders, source, ways=CAUSTIC)
            self._tracers[type(source)] = known
        tracer = known.sending(source)
        return Photons.together([tracer.batch(number) for number in range(max(1, photons // BATCH))])

    @cached_property
    def _landed_on(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Triangles that photons land on, their areas, and a third of those around each vertex, m²."""
        scene = self._scene
        triangles = scene.triangles[~specular_materials(scene)[scene.material_of]]
        a, b, c = (scene.positions[triangles[:, k]].astype(np.float64) for k in range(3))
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        around = sum(np.bincount(triangles[:, k], areas / 3, len(scene.positions)) for k in range(3))
        return triangles, areas, np.asarray(around, np.float64)


def _barycentric(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n, 3) weights of the corners (n, 3, 3) of triangles at points (n, 3) of them."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    across = np.cross(b - a, c - a)
    twice = np.maximum(np.einsum("ij,ij->i", across, across), 1e-300)
    v = np.einsum("ij,ij->i", np.cross(points - a, c - a), across) / twice
    w = np.einsum("ij,ij->i", np.cross(b - a, points - a), across) / twice
    weights = np.clip(np.stack([1 - v - w, v, w], axis=1), 0, None)
    return weights / weights.sum(axis=1, keepdims=True)


def _mass_times(light: np.ndarray, triangles: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """∫ of light (V, colours), linear over triangles, times the hat of each vertex."""
    out = np.empty_like(light)
    for c in range(light.shape[1]):
        values = light[triangles, c]
        each = (values + values.sum(axis=1, keepdims=True)) * (areas / 12)[:, None]
        out[:, c] = np.bincount(triangles.ravel(), each.ravel(), len(light))
    return out
