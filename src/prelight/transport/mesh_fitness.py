"""Whether a mesh is fine enough to hold its light: interpolated between vertices, against gathered on the spot.

The measure is fixed before anything is compared: at a random point of every triangle (of as many as are asked for,
by area) the light that arrives is gathered anew, and held against what the triangle's vertices say. Where they differ
by more than a tenth of the light there, and of the scene's mean, the mesh does not hold the light.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Float64, Int32, Normals, Positions
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from .gathering import Gathering
from .hemisphere import HemisphereRays
from .metal_rays import Metals
from .vantage import vantage_points

LIMIT = 0.1  # of a place's light, or the mean's if that is more; four times the noise of 256 rays
MOST_POINTS = 50_000
_RAYS = 256
_HIDDEN = 0.5  # share of rays that end on backs: the point is inside something
_CLOSED_IN = 0.25  # share of the hemisphere that may be filled with triangles that do not hold the light

Light = Float32[np.ndarray, "vertices columns channels"]
DirectAt = Callable[[Positions, Normals], Light]


@dataclass(frozen=True)
class MeshFitness:
    """Where a mesh holds the light, by points on its triangles.

    Attributes
    ----------
    triangle
        ``(n,)`` that each point lies on.
    deviation
        ``(n,)`` RMS over the lights of interpolated less gathered light, as a share of what is gathered there or in
        the mean, whichever is more.
    area
        ``(n,)`` m² that each point stands for; 0 inside of things, where nobody looks.
    edge
        ``(n,)`` metres, the longest of its triangle.
    judged
        ``(V,)`` bool: vertices most of whose triangles hold the light, and that are not closed in by others.
    """

    triangle: Int32[np.ndarray, "n"]
    deviation: Float32[np.ndarray, "n"]
    area: Float64[np.ndarray, "n"]
    edge: Float64[np.ndarray, "n"]
    judged: np.ndarray

    @property
    def fit(self) -> np.ndarray:
        """(n,) bool, whether the light is held at a point."""
        return self.deviation <= LIMIT

    @property
    def share(self) -> float:
        """Of the area, where the light is held."""
        return self.share_with_edges(np.inf)

    def share_with_edges(self, longest: float) -> float:
        """The share if edges longer than this were split: an estimate from below.

        Where light changes along a line, as at the edge of a shadow, the area that does not hold it shrinks with the
        length of edges; where it changes smoothly, faster.
        """
        left = np.where(self.fit, 0.0, np.minimum(longest / self.edge, 1.0))
        return 1.0 - float((left * self.area).sum() / max(self.area.sum(), 1e-300))

    def edge_for(self, share: float) -> float:
        """The longest edge, metres, that by this estimate holds the light on such a share; infinite if all do."""
        if self.share >= share:
            return float("inf")
        low, high = 0.0, float(self.edge.max())
        for _ in range(50):
            middle = (low + high) / 2
            low, high = (middle, high) if self.share_with_edges(middle) >= share else (low, middle)
        return low


def measure_fitness(  # noqa: PLR0913 - most of them are seldom given
    scene: Scene,
    occluders: Occluders,
    *,
    direct: Light,
    indirect: Light,
    direct_at: DirectAt | None = None,
    most: int = MOST_POINTS,
    seed: int = 0,
    metals: Metals | None = None,
) -> MeshFitness:
    """How well a mesh holds this light.

    Parameters
    ----------
    scene, occluders
        Its triangles, and the renderer's scene of the same.
    direct, indirect
        Irradiance / π at vertices, ``(V, K, C)``, as for ``bounces``.
    direct_at
        Direct light of the same K at positions with normals, each ``(n, 3)``; indirect light alone is judged if
        it is not given.
    most
        Points; if there are more triangles they are chosen by area.
    metals
        That indirect light was gathered with.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 19]))
    areas = _areas(scene)
    triangle, area = _chosen(areas, most, rng)
    weights = _anywhere(len(triangle), rng)
    place, normal = (_interpolated(scene, triangle, weights, a) for a in (scene.positions, scene.normals))
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    gathering = Gathering.trace(
        scene, occluders, origins=place, normals=normal, rays=_RAYS, seed=seed + 1, metals=metals
    )
    found = gathering.bounce(direct + indirect)
    said = _interpolated(scene, triangle, weights, indirect)
    if direct_at is not None:
        found += direct_at(place, normal)
        said += _interpolated(scene, triangle, weights, direct)
    area = np.where(gathering.backs > _HIDDEN, 0.0, area)
    there = _root_mean_square(found)
    mean = float((there * area).sum() / max(area.sum(), 1e-300))
    deviation = _root_mean_square(found - said) / np.maximum(np.maximum(there, mean), 1e-30)
    unfit = np.zeros(len(areas), bool)
    unfit[triangle[deviation > LIMIT]] = True
    edge = _longest_edges(scene)[triangle]
    return MeshFitness(
        triangle.astype(np.int32),
        deviation.astype(np.float32),
        area,
        edge,
        _judged(scene, occluders, areas, unfit),
    )


def _judged(scene: Scene, occluders: Occluders, areas: np.ndarray, unfit: np.ndarray) -> np.ndarray:
    """(V,) bool; see ``MeshFitness``."""
    around, bad = (
        np.bincount(scene.triangles.ravel(), np.repeat(a, 3), minlength=len(scene.positions))
        for a in (areas, areas * unfit)
    )
    own = bad <= around / 2
    return own & (_seen_share(scene, occluders, unfit) <= _CLOSED_IN)


def _seen_share(scene: Scene, occluders: Occluders, unfit: np.ndarray) -> np.ndarray:
    """(V,) share of a vertex's rays that end on triangles marked as unfit."""
    rays = HemisphereRays(
        occluders, scene, origins=vantage_points(scene, occluders), normals=scene.normals, rays=64, seed=2
    )
    step, seen = 1 << 16, np.zeros(len(scene.positions), np.float32)
    for first in range(0, len(seen), step):
        hit = rays.trace(first, min(step, len(seen) - first)).triangle
        seen[first : first + step] = (unfit[hit] & (hit >= 0)).mean(axis=1)
    return seen


def _chosen(areas: np.ndarray, most: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Triangles, and the area each stands for: all, or so many by chance."""
    if len(areas) <= most:
        return np.arange(len(areas)), areas
    total = np.cumsum(areas)
    at = (np.arange(most) + rng.random(most)) / most * total[-1]
    return np.minimum(np.searchsorted(total, at, side="right"), len(areas) - 1), np.full(
        most, total[-1] / most
    )


def _anywhere(count: int, rng: np.random.Generator) -> Float64[np.ndarray, "n 3"]:
    """Barycentric weights of points spread evenly over triangles."""
    root, along = np.sqrt(rng.random(count)), rng.random(count)
    return np.stack([1 - root, root * (1 - along), root * along], axis=1)


def _interpolated(scene: Scene, triangle: np.ndarray, weights: np.ndarray, values: np.ndarray) -> np.ndarray:
    total = np.zeros((len(triangle), *values.shape[1:]), np.float32)
    for corner in range(3):
        w = weights[:, corner].reshape(-1, *[1] * (values.ndim - 1)).astype(np.float32)
        total += w * values[scene.triangles[triangle, corner]]
    return total


def _root_mean_square(light: np.ndarray) -> np.ndarray:
    flat = light.reshape(len(light), -1).astype(np.float64)
    return np.sqrt(np.einsum("ij,ij->i", flat, flat) / flat.shape[1])


def _corners(scene: Scene) -> np.ndarray:
    return scene.positions[scene.triangles].astype(np.float64)


def _areas(scene: Scene) -> Float64[np.ndarray, "triangles"]:
    a, b, c = np.moveaxis(_corners(scene), 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def _longest_edges(scene: Scene) -> Float64[np.ndarray, "triangles"]:
    corners = _corners(scene)
    return np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
