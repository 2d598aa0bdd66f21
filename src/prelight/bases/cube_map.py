"""The cube map: six faces of R×R texels, their directions and solid angles.

Faces come in the order +X −X +Y −Y +Z −Z. On each face, with u to the right (column) and
v downward (row), both in [−1, 1], a direction before normalisation is ``AXIS + u·U + v·V``:

    face   AXIS   U    V          (the layout of OpenGL and three.js cube textures)
    +X     +x    −z   −y
    −X     −x    +z   −y
    +Y     +y    +x   +z
    −Y     −y    +x   −z
    +Z     +z    +x   −y
    −Z     −z    −x   −y

Texel (row i, column j) is centred at u = (2j+1)/R − 1, v = (2i+1)/R − 1.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..arrays import Directions, Float32, Float64, Int32

FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
AXIS = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], np.float64)
U = np.array([(0, 0, -1), (0, 0, 1), (1, 0, 0), (1, 0, 0), (1, 0, 0), (-1, 0, 0)], np.float64)
V = np.array([(0, -1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (0, -1, 0), (0, -1, 0)], np.float64)

MAX_RESOLUTION = 4096


def texel_centres(resolution: int) -> Float64[np.ndarray, "column"]:
    """Coordinates u (or v) of the texel centres of a face, in (−1, 1)."""
    return (2.0 * np.arange(resolution) + 1.0) / resolution - 1.0


def directions(
    face: Int32[np.ndarray, "directions"] | int,
    u: Float64[np.ndarray, "directions"],
    v: Float64[np.ndarray, "directions"],
) -> Float64[np.ndarray, "directions 3"]:
    """Unit directions of points (u, v) of faces; float64."""
    d = AXIS[face] + np.multiply.outer(u, [1.0]) * U[face] + np.multiply.outer(v, [1.0]) * V[face]
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


def texel_directions(texels: Int32[np.ndarray, "directions"], resolution: int) -> Directions:
    """Unit directions (n, 3) float32 of texels given as face·R² + row·R + column."""
    face, inside = np.divmod(texels, resolution * resolution)
    row, column = np.divmod(inside, resolution)
    centres = texel_centres(resolution)
    return directions(face, centres[column], centres[row]).astype(np.float32)


def face_coordinates(
    d: Float64[np.ndarray, "directions 3"],
) -> tuple[
    Int32[np.ndarray, "directions"], Float64[np.ndarray, "directions"], Float64[np.ndarray, "directions"]
]:
    """Face, u and v of directions (need not be unit); the inverse of ``directions``."""
    major = np.abs(d).argmax(axis=-1)
    along = np.take_along_axis(d, major[..., None], axis=-1)[..., 0]
    face = (2 * major + (along < 0)).astype(np.int32)
    scale = 1.0 / np.abs(along)
    return face, (d * U[face]).sum(-1) * scale, (d * V[face]).sum(-1) * scale


def _corner_area(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Solid angle of the rectangle from the face's centre to (u, v), signed."""
    return np.arctan2(u * v, np.sqrt(u * u + v * v + 1.0))


def rectangle_solid_angles(u_edges: np.ndarray, v_edges: np.ndarray) -> Float64[np.ndarray, "row column"]:
    """Exact solid angles of the cells of a grid on one face, in steradians."""
    area = _corner_area(u_edges[None, :], v_edges[:, None])
    return area[1:, 1:] - area[:-1, 1:] - area[1:, :-1] + area[:-1, :-1]


@lru_cache(maxsize=4)
def solid_angles(resolution: int) -> Float32[np.ndarray, "row column"]:
    """Solid angle of each texel of a face, steradians; the same on every face, 4π over all six."""
    edges = np.linspace(-1.0, 1.0, resolution + 1)
    table = rectangle_solid_angles(edges, edges).astype(np.float32)
    table.setflags(write=False)
    return table


def mean_directions(
    rectangles: Int32[np.ndarray, "nodes 5"], resolution: int
) -> Float64[np.ndarray, "nodes 3"]:
    """∫ω dω / ∫dω over rectangles (face, row, column, height, width) of texels; shorter than one.

    The integral of direction over a spherical polygon is half the sum, over its edges, of the
    edge's angle times the unit normal of the plane through the edge and the centre (Lambert).
    """
    face, row, column, height, width = rectangles.T
    v = 2.0 * np.stack([row, row, row + height, row + height], -1) / resolution - 1.0
    u = 2.0 * np.stack([column, column + width, column + width, column], -1) / resolution - 1.0
    corner = directions(np.repeat(face, 4), u.ravel(), v.ravel()).reshape(-1, 4, 3)
    following = np.roll(corner, -1, axis=1)
    normal = np.cross(corner, following)
    sine = np.linalg.norm(normal, axis=-1, keepdims=True)
    angle = np.arctan2(sine, (corner * following).sum(-1, keepdims=True))
    flux = 0.5 * (normal / sine * angle).sum(axis=1)
    area = (
        _corner_area(u[:, 2], v[:, 2])
        - _corner_area(u[:, 0], v[:, 2])
        - _corner_area(u[:, 2], v[:, 0])
        + _corner_area(u[:, 0], v[:, 0])
    )
    outward = np.sign((flux * AXIS[face]).sum(-1))
    return flux * (outward / area)[:, None]
