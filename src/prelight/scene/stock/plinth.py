"""A square plinth with chamfered edges, which catch the light."""

from __future__ import annotations

import numpy as np

from .parts import Part, rectangle, together


def plinth(*, half_width: float, height: float, chamfer: float, gap: float, cells: tuple[int, int]) -> Part:
    """A closed block centred over the origin, from y = ``gap`` to y = ``height``; metres.

    Each face and each chamfer has vertices of its own, at the same places along a common edge. ``cells``: how
    many across a face and how many up it. The gap keeps the foot's receivers off the floor.
    """
    across, up = cells
    inner = half_width - chamfer
    x, y, z = np.eye(3)
    faces = []
    for out, right in ((z, x), (x, -z), (-z, -x), (-x, z)):  # right: of one who faces the block
        side = half_width * out - inner * right
        rise = (height - chamfer - gap) * y
        span = 2 * inner * right
        faces.append(rectangle(side + gap * y, span, rise, cells=(across, up)))
        slant = -chamfer * out + chamfer * y
        faces.append(rectangle(side + (height - chamfer) * y, span, slant, cells=(across, 1)))
        turn = half_width * out + inner * right
        faces.append(rectangle(turn + gap * y, chamfer * (right - out), rise, cells=(1, up)))
        faces.append(_corner(turn + (height - chamfer) * y, chamfer * (right - out), slant))
    faces.append(
        rectangle(inner * (z - x) + height * y, 2 * inner * x, -2 * inner * z, cells=(across, across))
    )
    faces.append(_underside(half_width, inner, gap, across=across))
    return together(faces)


def _corner(tip: np.ndarray, across: np.ndarray, slant: np.ndarray) -> Part:
    """The triangle where three chamfers meet."""
    positions = np.stack([tip, tip + across, tip + slant])
    normal = np.cross(across, slant)
    return Part(
        positions, np.broadcast_to(normal / np.linalg.norm(normal), (3, 3)), np.array([[0, 1, 2]], np.int32)
    )


def _underside(half_width: float, inner: float, gap: float, *, across: int) -> Part:
    """The octagon below; nobody sees it, but it closes the block to light."""
    line = np.linspace(-inner, inner, across + 1)
    side = np.stack([line, np.full(across + 1, half_width)], axis=1)  # x, z; clockwise seen from below
    rim = np.concatenate([side, side[:, ::-1] * (1, -1), -side, side[:, ::-1] * (-1, 1)])
    positions = np.array([(0.0, gap, 0.0), *((x, gap, z) for x, z in rim)])
    k = np.arange(len(rim))
    triangles = np.stack([np.zeros(len(rim), int), 1 + (k + 1) % len(rim), 1 + k], axis=1).astype(np.int32)
    return Part(positions, np.broadcast_to([0.0, -1.0, 0.0], positions.shape), triangles)
