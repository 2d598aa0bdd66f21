"""Points of surfaces rather than vertices: what pictures show, between receivers too, against the path tracer."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from prelight.camera import Camera
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.transport.eye import seen_points
from prelight.transport.path_traced_light import LightWithVariance, LitScene, as_diffuse


@dataclass(frozen=True)
class Points:
    """Places on the triangles of a scene, by which triangle and the weights of its corners."""

    triangle: np.ndarray  # (n,)
    weights: np.ndarray  # (n, 3)

    def of(self, scene: Scene, values: np.ndarray) -> np.ndarray:
        """(n, 3) of what is given at the scene's vertices (V, 3)."""
        return np.einsum("nk,nkc->nc", self.weights, values[scene.triangles[self.triangle]])

    def normals(self, scene: Scene) -> np.ndarray:
        """(n, 3) unit length, as between vertices."""
        found = self.of(scene, scene.normals.astype(np.float64))
        return found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-12)


def of_picture(scene: Scene, camera: Camera, *, width: int, height: int) -> tuple[Points, np.ndarray]:
    """What the middles of pixels see, and which pixels (width · height,) see anything."""
    seen = seen_points(
        Occluders(scene.positions, scene.triangles), camera, width=width, height=height, samples=1
    )
    there = seen.triangle[:, 0] >= 0
    two = seen.weights[there, 0].astype(np.float64)
    return Points(seen.triangle[there, 0], np.c_[1 - two.sum(axis=1), two]), there


def spread(scene: Scene, count: int, *, seed: int = 5) -> Points:
    """Points by area, on triangles whose vertices all have normals."""
    rng = np.random.default_rng(seed)
    a, b, c = np.moveaxis(scene.positions[scene.triangles].astype(np.float64), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    area *= (np.abs(scene.normals).sum(axis=1) > 0)[scene.triangles].all(axis=1)
    triangle = rng.choice(len(area), count, p=area / area.sum())
    root, t = np.sqrt(rng.random(count)), rng.random(count)
    return Points(triangle, np.stack([1 - root, root * (1 - t), root * t], axis=1))


def found_on(scene: Scene, places: np.ndarray, normals: np.ndarray) -> Points:
    """Where the same places lie on another mesh of the same surfaces."""
    occluders, lift = Occluders(scene.positions, scene.triangles), 1e-3
    mi = occluders.mi
    start, down = (mi.Point3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in v.T)) for v in
                   (places + lift * normals, -normals))  # fmt: skip
    hit = occluders.scene.ray_intersect_preliminary(mi.Ray3f(start, mi.Vector3f(down)))
    triangle, two = hit.prim_index.numpy().astype(np.int64), hit.prim_uv.numpy().T.astype(np.float64)
    if not hit.is_valid().numpy().all():
        raise ValueError("places that are not on this mesh")
    return Points(triangle, np.c_[1 - two.sum(axis=1), two])


def truth_at(
    scene: Scene, points: Points, emitter: Any, *, samples: int, bounces: int | None = None, seed: int = 0
) -> LightWithVariance:
    """E / π at points by Mitsuba's ``path``, direct and bounced light apart."""
    lit = LitScene(as_diffuse(scene), emitters=[emitter])
    places = points.of(scene, scene.positions.astype(np.float64)).astype(np.float32)
    lit.scene = replace(
        scene, positions=places, normals=points.normals(scene).astype(np.float32),
        triangles=np.zeros((1, 3), np.int32), material_of=np.zeros(1, np.int32), uv=None, tint=None,
        albedo=np.zeros_like(places),
    )  # fmt: skip
    return lit.light(
        np.arange(len(places), dtype=np.int32), origins=places, samples=samples, bounces=bounces, seed=seed
    )


def figures_of(ours: np.ndarray, truth: np.ndarray, variance: np.ndarray) -> dict[str, float]:
    """Of the mean: mean |difference| with the reference's noise in it, that noise, and what is left of the root mean
    square when the noise's own mean square, which is known, is taken off."""
    mean, off = float(truth.mean()), ours - truth
    noise = float(np.sqrt(variance).mean()) * math.sqrt(2 / math.pi)
    rest = float(np.square(off).mean() - variance.mean())
    return {
        "difference": float(np.abs(off).mean()) / mean, "noise": noise / mean, "signed": float(off.mean()) / mean,
        "rms": math.sqrt(float(np.square(off).mean())) / mean, "rms_without_noise": math.sqrt(max(rest, 0)) / mean,
    }  # fmt: skip
