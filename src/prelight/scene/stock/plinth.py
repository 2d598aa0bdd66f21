"""Blocks with chamfered edges, which catch the light: a square plinth, the slab of a table."""

from __future__ import annotations

import numpy as np

from .parts import Part, rectangle, together


def plinth(*, half_width: float, height: float, chamfer: float, gap: float, cells: tuple[int, int]) -> Part:
    """A closed square block centred over the origin, from y = ``gap`` to y = ``height``; see ``slab``."""
    across, up = cells
    half = (half_width, half_width)
    return slab(half=half, height=height, chamfer=chamfer, gap=gap, cells=(across, across, up))


def slab(
    *, half: tuple[float, float], height: float, chamfer: float, gap: float, cells: tuple[int, int, int]
) -> Part:
    """A closed block centred over the origin, from y = ``gap`` to y = ``height``; metres.

    ``half`` of its width in x and of its depth in z. Each face and each chamfer has vertices of its own, at the same
    places along a common edge. ``cells``: how many in x, in z and up. The gap keeps the foot's receivers off the
    floor.
    """
    wide, deep, up = cells
    x, y, z = np.eye(3)
    inner = half[0] - chamfer, half[1] - chamfer
    faces = []
    for out, right in ((z, x), (x, -z), (-z, -x), (-x, z)):  # right: of one who faces the block
        k = 0 if right[0] else 1  # the axis along the face
        across = cells[k]
        side = half[1 - k] * out - inner[k] * right
        rise = (height - chamfer - gap) * y
        span = 2 * inner[k] * right
        faces.append(rectangle(side + gap * y, span, rise, cells=(across, up)))
        slant = -chamfer * out + chamfer * y
        faces.append(rectangle(side + (height - chamfer) * y, span, slant, cells=(across, 1)))
        turn = half[1 - k] * out + inner[k] * right
        faces.append(rectangle(turn + gap * y, chamfer * (right - out), rise, cells=(1, up)))
        faces.append(_corner(turn + (height - chamfer) * y, chamfer * (right - out), slant))
    corner = inner[1] * z - inner[0] * x + height * y
    faces.append(rectangle(corner, 2 * inner[0] * x, -2 * inner[1] * z, cells=(wide, deep)))
    faces.append(_underside(half, inner, gap, cells=(wide, deep)))
    return together(faces)


def _corner(tip: np.ndarray, across: np.ndarray, slant: np.ndarray) -> Part:
    """The triangle where three chamfers meet."""
    positions = np.stack([tip, tip + across, tip + slant])
    normal = np.cross(across, slant)
    return Part(
        positions, np.broadcast_to(normal / np.linalg.norm(normal), (3, 3)), np.array([[0, 1, 2]], np.int32)
    )


def _underside(
    half: tuple[float, float], inner: tuple[float, float], gap: float, *, cells: tuple[int, int]
) -> Part:
    """The octagon below; nobody sees it, but it closes the block to light."""
    x, z = (np.linspace(-i, i, n + 1) for i, n in zip(inner, cells, strict=True))
    front = np.stack([x, np.full(len(x), half[1])], axis=1)  # x, z; clockwise seen from below
    right = np.stack([np.full(len(z), half[0]), -z], axis=1)
    rim = np.concatenate([front, right, -front, -right])
    positions = np.array([(0.0, gap, 0.0), *((x, gap, z) for x, z in rim)])
    k = np.arange(len(rim))
    triangles = np.stack([np.zeros(len(rim), int), 1 + (k + 1) % len(rim), 1 + k], axis=1).astype(np.int32)
    return Part(positions, np.broadcast_to([0.0, -1.0, 0.0], positions.shape), triangles)
