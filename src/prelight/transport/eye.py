"""What an eye sees: the points behind a camera's pixels, and the vertices as they look from it.

A point is a triangle and two weights; everything else (position, normal, texture coordinates, material) follows
from them, for a picture and for a vertex alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32, Int32
from ..camera import Camera, sample_offsets
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene

MOST_SAMPLES = 64  # a pixel
_RAYS = 1 << 22  # of one launch


@dataclass(frozen=True)
class SeenPoints:
    """Receivers of a layer under a fixed eye, each the mean of as many samples.

    ``triangle`` is −1 where a sample meets nothing; ``weights`` are the barycentric ones of the triangle's second
    and third vertex. Pixels are in rows from the top, vertices in the scene's order.
    """

    eye: tuple[float, float, float]
    triangle: Int32[np.ndarray, "receivers samples"]
    weights: Float32[np.ndarray, "receivers samples 2"]
    at_vertices: bool

    def __len__(self) -> int:
        return len(self.triangle)

    @property
    def samples(self) -> int:
        return self.triangle.shape[1]

    @property
    def coverage(self) -> Float32[np.ndarray, "receivers"]:
        """Share of a receiver's samples that meet the scene."""
        return (self.triangle >= 0).mean(axis=1, dtype=np.float32)

    def interpolated(
        self, scene: Scene, values: Float32[np.ndarray, "vertices 3"]
    ) -> Float32[np.ndarray, "receivers 3"]:
        """The mean over a receiver's samples of what is given at vertices; zero where there are none."""
        total = np.zeros((len(self), 3), np.float32)
        for k in range(self.samples):
            triangle, w = self.triangle[:, k], self.weights[:, k]
            of_corner = np.stack([1 - w.sum(axis=1), w[:, 0], w[:, 1]], axis=1) * (triangle >= 0)[:, None]
            for corner in range(3):
                total += of_corner[:, corner, None] * values[scene.triangles[triangle, corner]]
        return total / np.maximum((self.triangle >= 0).sum(axis=1), 1)[:, None]

    def material(self, scene: Scene) -> Int32[np.ndarray, "receivers"]:
        """Material of the first sample that meets the scene; −1 where none does."""
        first = (self.triangle >= 0).argmax(axis=1)
        triangle = np.take_along_axis(self.triangle, first[:, None], axis=1)[:, 0]
        return np.where(triangle >= 0, scene.material_of[triangle], -1).astype(np.int32)

    def share_on(self, scene: Scene, chosen: np.ndarray) -> float:
        """Share of the points whose material is ``chosen`` (materials,) bool."""
        there = self.triangle[self.triangle >= 0]
        return float(chosen[scene.material_of[there]].mean()) if len(there) else 0.0


def seen_points(
    occluders: Occluders, camera: Camera, *, width: int, height: int, samples: int = 4
) -> SeenPoints:
    """What ``camera`` sees in a picture of ``width`` × ``height`` pixels, ``samples`` points a pixel.

    The same rays as those of pictures drawn of meshes (``camera.sample_offsets``): every pixel has the same
    pattern, so that nothing is random. Raises InputError unless ``samples`` is a square number up to 64.
    """
    check_samples(samples)
    rays = width * height * samples
    triangle = np.empty(rays, np.int32)
    weights = np.empty((rays, 2), np.float32)
    for start in range(0, rays, _RAYS):
        part = slice(start, min(start + _RAYS, rays))
        d = pixel_directions(camera, np.arange(start, part.stop), width=width, height=height, samples=samples)
        triangle[part], weights[part] = _first_hits(occluders, camera.eye, d)
    shape = (width * height, samples)
    return SeenPoints(camera.eye, triangle.reshape(shape), weights.reshape(*shape, 2), False)


def vertex_points(scene: Scene, eye: tuple[float, float, float]) -> SeenPoints:
    """Every vertex as a receiver with one sample, in the first of its triangles; none where it has no triangle."""
    corners = scene.positions[scene.triangles].astype(np.float64)
    flat = ~np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).any(axis=1)
    order = np.argsort(flat, kind="stable")[::-1]  # what is written last stays: the first that has an area
    of_vertex = np.full(len(scene.positions), -1)
    of_vertex[scene.triangles[order, ::-1]] = 3 * order[:, None] + (2, 1, 0)
    triangle, corner = (of_vertex // 3).astype(np.int32), of_vertex % 3
    weights = np.stack([corner == 1, corner == 2], axis=1).astype(np.float32)
    return SeenPoints(eye, triangle[:, None], weights[:, None], True)


def check_samples(samples: int) -> int:
    """The side of the square that ``samples`` is. Raises InputError."""
    side = round(max(samples, 0) ** 0.5)
    if side < 1 or side * side != samples or samples > MOST_SAMPLES:
        raise InputError("samples", f"{samples} a pixel, expected a square number from 1 to {MOST_SAMPLES}")
    return side


def pixel_directions(
    camera: Camera, sample: np.ndarray, *, width: int, height: int, samples: int
) -> Float32[np.ndarray, "rays 3"]:
    """Unit directions of samples, numbered pixel · ``samples`` + which, pixels in rows from the top."""
    pixel, which = np.divmod(sample, samples)
    row, column = np.divmod(pixel, width)
    x, y = sample_offsets(check_samples(samples))[which].T
    focal = height / (2 * np.tan(np.radians(camera.vertical_fov_deg) / 2))  # pixels
    right, up = (column + x - width / 2) / focal, (height / 2 - row - y) / focal
    d = np.stack([right, up, -np.ones_like(right)], axis=-1) @ camera.axes().astype(np.float64)
    return (d / np.linalg.norm(d, axis=-1, keepdims=True)).astype(np.float32)


def _first_hits(occluders: Occluders, eye: tuple[float, float, float], d: np.ndarray) -> tuple[Any, Any]:
    mi = occluders.mi
    direction = mi.Vector3f(*(mi.Float(np.ascontiguousarray(x)) for x in d.T))
    hit = occluders.scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(*eye), direction), coherent=True)
    found = hit.is_valid().numpy()
    triangle = np.where(found, hit.prim_index.numpy().astype(np.int64), -1).astype(np.int32)
    return triangle, np.where(found, hit.prim_uv.numpy(), 0).T.astype(np.float32)
