"""Triangles in place of round shapes: vertices lie on the shape, winding is counter-clockwise from outside.

Each is in the frame and with the texture coordinates of Mitsuba's shape of that name.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

AROUND = 96  # facets around an axis: a silhouette off by 0.05 % of the radius
_FROM_POLE_TO_POLE = 48
_RINGS = 8


class Facets(NamedTuple):
    """Arrays of float64 and int32."""

    positions: np.ndarray  # (V, 3)
    triangles: np.ndarray  # (F, 3)
    normals: np.ndarray  # (V, 3) unit length, in the same frame
    uv: np.ndarray  # (V, 2)


def sphere() -> Facets:
    """Of radius 1 about the origin; poles at ±z."""
    v, u = _grid(_FROM_POLE_TO_POLE, AROUND)
    theta, phi = np.pi * v, 2 * np.pi * u
    ring = np.sin(theta)
    ring[[0, -1]] = 0
    points = np.stack([ring * np.cos(phi), ring * np.sin(phi), np.cos(theta)], axis=-1).reshape(-1, 3)
    return _wound(_cells(_FROM_POLE_TO_POLE, AROUND), points, points, _uv(u, v))


def cylinder() -> Facets:
    """Of radius 1 about the z axis from 0 to 1, open at both ends."""
    v, u = _grid(_RINGS, AROUND)
    out = np.stack([np.cos(2 * np.pi * u), np.sin(2 * np.pi * u), np.zeros_like(u)], axis=-1).reshape(-1, 3)
    points = out + np.array([0.0, 0.0, 1.0]) * v.reshape(-1, 1)
    return _wound(_cells(_RINGS, AROUND), points, out, _uv(u, v))


def disk() -> Facets:
    """Of radius 1 about the origin, in the xy plane, facing +z."""
    radius, turn = _grid(_RINGS, AROUND)
    phi = 2 * np.pi * turn
    points = np.stack([radius * np.cos(phi), radius * np.sin(phi), 0 * phi], axis=-1).reshape(-1, 3)
    up = np.tile(np.array([0.0, 0.0, 1.0]), (len(points), 1))
    return _wound(_cells(_RINGS, AROUND), points, up, _uv(radius, turn))


def rectangle() -> Facets:
    """From (−1, −1) to (1, 1) in the xy plane, facing +z."""
    points = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float64)
    up = np.tile(np.array([0.0, 0.0, 1.0]), (4, 1))
    return Facets(points, np.array([(0, 1, 2), (0, 2, 3)], np.int32), up, (points[:, :2] + 1) / 2)


def _grid(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    """(rows + 1, columns + 1) of 0 to 1 down and across: the seam is there twice, for its two coordinates."""
    down, across = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    return down, across


def _uv(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.stack([u.ravel(), v.ravel()], axis=-1)


def _cells(rows: int, columns: int) -> np.ndarray:
    corner = np.arange((rows + 1) * (columns + 1), dtype=np.int32).reshape(rows + 1, columns + 1)
    here, right, below, across = corner[:-1, :-1], corner[:-1, 1:], corner[1:, :-1], corner[1:, 1:]
    return np.stack([here, below, right, right, below, across], axis=-1).reshape(-1, 3)


def _wound(triangles: np.ndarray, points: np.ndarray, normals: np.ndarray, uv: np.ndarray) -> Facets:
    """Triangles counter-clockwise about their normals, without those (at a pole, half) that have no area."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    there = np.linalg.norm(across, axis=1) > 1e-9
    wrong = np.einsum("ij,ij->i", across, normals[triangles].sum(axis=1)) < 0
    used, corners = np.unique(
        np.where(wrong[:, None], triangles[:, ::-1], triangles)[there], return_inverse=True
    )
    return Facets(points[used], corners.reshape(-1, 3).astype(np.int32), normals[used], uv[used])
