"""Lights of a cloud in their scene, before and after they are clustered for a zone (figures 3 and 4 of the paper)."""

from __future__ import annotations

import numpy as np

from ..arrays import Albedo, Float32, Float64, Int32, Normals, Positions, Triangles
from ..camera import Camera
from .figures import Shown, panels
from .view import View

_WIDTH, _HEIGHT = 720, 540
_LIGHT = np.array([1.0, 0.72, 0.06], np.float32)  # of a ball, linear
_ZONE = np.array([0.07, 0.22, 0.62], np.float32)
_BALL = 0.085  # of the grid's step, the radius of one light
_BACK = 0.62


def light_cloud_figure(
    scene: tuple[Positions, Triangles, Normals, Albedo],
    camera: Camera,
    *,
    before: Float64[np.ndarray, "lights 3"],
    after: Float64[np.ndarray, "groups 4"],
    zone: Int32[np.ndarray, "vertices"],
    step: float,
) -> Shown:
    """Two panels: all lights of the grid, and one zone (blue) with its groups, larger the more lights they stand for.

    ``after`` are places and how many lights each stands for; ``step`` is from one light of the grid to the next.
    """
    _, _, _, albedo = scene
    painted = albedo.copy()
    painted[zone] = 0.35 * painted[zone] + 0.65 * _ZONE
    ones = np.ones((len(before), 1))
    views = [
        _drawn(scene, albedo, camera, np.concatenate([before, ones], axis=1), step),
        _drawn(scene, painted, camera, after, step),
    ]
    captions = [
        f"{len(before):,} lights of the grid",
        f"{len(after):,} groups of them for the {len(zone):,} vertices in blue",
    ]
    return panels(views, captions)


def _drawn(
    scene: tuple[Positions, Triangles, Normals, Albedo],
    colours: Float32[np.ndarray, "vertices 3"],
    camera: Camera,
    lights: Float64[np.ndarray, "lights 4"],
    step: float,
) -> Shown:
    positions, triangles, normals, _ = scene
    ball, ball_triangles = _ball()
    sizes = _BALL * step * np.cbrt(lights[:, 3])
    balls = lights[:, None, :3] + ball * sizes[:, None, None]
    numbers = len(positions) + np.arange(len(lights))[:, None, None] * len(ball) + ball_triangles
    where = np.concatenate([positions, balls.reshape(-1, 3)]).astype(np.float32)
    what = np.concatenate([triangles, numbers.reshape(-1, 3)]).astype(np.int32)
    facing = np.concatenate([normals, np.tile(ball, (len(lights), 1))])
    shade = _shade(where, facing, np.asarray(camera.eye))
    tint = np.concatenate([0.75 * colours, np.broadcast_to(_LIGHT, (len(where) - len(positions), 3))])
    view = View(where, what, camera=camera, width=_WIDTH, height=_HEIGHT)
    picture = view.draw((tint * shade[:, None]).astype(np.float32), background=(_BACK, _BACK, _BACK))
    return picture.display(exposure=0.0)


def _shade(where: np.ndarray, facing: np.ndarray, eye: np.ndarray) -> Float32[np.ndarray, "vertices"]:
    """As a headlamp and an even sky would: brightest where a surface faces the eye."""
    to_eye = eye - where
    to_eye /= np.maximum(np.linalg.norm(to_eye, axis=1, keepdims=True), 1e-9)
    return (0.35 + 0.65 * np.abs(np.einsum("ij,ij->i", facing, to_eye))).astype(np.float32)


def _ball() -> tuple[Float64[np.ndarray, "42 3"], Int32[np.ndarray, "80 3"]]:
    """An icosahedron, its faces in four: vertices on the unit sphere."""
    t = (1 + 5**0.5) / 2
    points = np.array([(-1, t, 0), (1, t, 0), (-1, -t, 0), (1, -t, 0)], np.float64)
    points = np.concatenate([points, np.roll(points, 1, axis=1), np.roll(points, 2, axis=1)])
    away = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = (away > 0) & (away < 2.01)
    faces = [
        (i, j, k) for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]
    ]  # fmt: skip
    middles: dict[tuple[int, int], int] = {}
    every = list(points)

    def middle(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in middles:
            middles[key] = len(every)
            every.append((points[a] + points[b]) / 2)
        return middles[key]

    split = []
    for a, b, c in faces:
        ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
        split += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    whole = np.array(every)
    return whole / np.linalg.norm(whole, axis=1, keepdims=True), np.array(split, np.int32)
