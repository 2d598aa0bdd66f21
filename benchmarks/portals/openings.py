"""Panes that lie beside each other in one plane, as the parallelograms a reference looks for light through."""

from __future__ import annotations

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

NEAR = 0.35  # metres between panes of one window, about
_FLAT = 0.02  # metres, and difference of normals


def openings_of(corners: np.ndarray) -> np.ndarray:
    """(K, 3, 3) a corner and two edges of the rectangle around each window, from triangles (T, 3, 3).

    Triangles belong together that lie in one plane and whose boxes, grown, meet.
    """
    corners = corners.astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corners = corners[np.linalg.norm(across, axis=1) > 1e-9]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = across / np.linalg.norm(across, axis=1, keepdims=True)
    low, high = corners.min(axis=1) - NEAR / 2, corners.max(axis=1) + NEAR / 2
    meets = ((low[:, None] <= high[None]) & (high[:, None] >= low[None])).all(axis=2)
    meets &= np.abs(np.abs(normals @ normals.T) - 1) < _FLAT
    offset = np.einsum("tx,stx->st", normals, corners[None, :, 0] - corners[:, None, 0])
    meets &= np.abs(offset) < _FLAT
    count, of = scipy.sparse.csgraph.connected_components(scipy.sparse.csr_matrix(meets))
    return np.array([_rectangle(corners[of == k], normals[of == k][0]) for k in range(count)])


def _rectangle(corners: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Around triangles in a plane; upright where the plane is."""
    up = np.eye(3)[1] if abs(normal[1]) < 0.9 else np.eye(3)[0]
    first = np.cross(up, normal)
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first)])
    places = corners.reshape(-1, 3)
    at = places @ axes.T
    low, high = at.min(axis=0), at.max(axis=0)
    corner = low @ axes + (places[0] @ normal) * normal
    return np.stack([corner, (high - low)[0] * axes[0], (high - low)[1] * axes[1]])
