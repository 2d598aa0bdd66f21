"""Normals of a triangle mesh."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import Float64, Positions, Triangles

_FLAT = 1e-12  # twice the area over the longest edge squared, below which a triangle is a line or a point
_BLOCK = 1 << 21


def _blocks(triangles: Triangles) -> Iterator[slice]:
    """Parts of the mesh whose float64 temporaries stay below a gigabyte."""
    return (slice(start, start + _BLOCK) for start in range(0, len(triangles), _BLOCK))


def _edges(positions: Positions, triangles: Triangles) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges a→b, b→c and c→a of every triangle, each (F, 3) float64."""
    a, b, c = (positions[triangles[:, k]].astype(np.float64) for k in range(3))
    return b - a, c - b, a - c


def zero_area(positions: Positions, triangles: Triangles) -> np.ndarray:
    """(F,) bool: whether a triangle is a line or a point, whatever the scale of the model."""
    flat = np.empty(len(triangles), bool)
    for block in _blocks(triangles):
        ab, bc, ca = _edges(positions, triangles[block])
        area = np.linalg.norm(np.cross(ab, -ca), axis=1)
        longest = np.max([np.einsum("ij,ij->i", e, e) for e in (ab, bc, ca)], axis=0)
        flat[block] = area <= _FLAT * longest
    return flat


def is_mirrored(linear: Float64[np.ndarray, "3 3"]) -> bool:
    """Whether a transform turns a triangle's winding round."""
    (a, b, c), (d, e, f), (g, h, i) = (
        linear.tolist()
    )  # plain numbers: ten times faster than an array of three
    return a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g) < 0


def normal_matrix(linear: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "3 3"]:
    """What acts on normals (columns) when ``linear`` acts on positions, up to a positive factor.

    The cofactor matrix: as the inverse transpose, but defined for a scale of zero along an axis too.
    """
    cofactors = np.stack([np.cross(linear[(k + 1) % 3], linear[(k + 2) % 3]) for k in range(3)])
    return -cofactors if is_mirrored(linear) else cofactors


def vertex_normals(positions: Positions, triangles: Triangles) -> Float64[np.ndarray, "vertices 3"]:
    """Unit normals: the sum of the unit normals of the triangles around a vertex, weighted by their angles.

    Zero where no triangle uses the vertex or where its triangles cancel. Triangles must have an area.

    References
    ----------
    Thürrner and Wüthrich, Computing Vertex Normals from Polygonal Facets, 1998; as trimesh does.
    """
    total = np.zeros((len(positions), 3))
    for block in _blocks(triangles):
        ab, bc, ca = _edges(positions, triangles[block])
        across = np.cross(ab, -ca)
        doubled = np.linalg.norm(across, axis=1)  # twice the area: |u × v| is the same at every corner
        unit = across / doubled[:, None]
        for corner, (u, v) in enumerate(((ab, -ca), (bc, -ab), (ca, -bc))):
            angle = np.arctan2(doubled, np.einsum("ij,ij->i", u, v))
            for axis in range(3):
                weight = angle * unit[:, axis]
                total[:, axis] += np.bincount(triangles[block, corner], weight, minlength=len(positions))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.divide(total, length, out=np.zeros_like(total), where=length > 1e-12)
