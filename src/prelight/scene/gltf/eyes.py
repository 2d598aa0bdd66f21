"""The cameras of a glTF file."""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Positions
from ...camera import Camera
from ...errors import InputError
from ..mesh import short_name
from .document import Document

_MOST = 100


def read_cameras(
    document: Document, matrices: dict[int, np.ndarray], *, positions: Positions, notes: list[str]
) -> dict[str, Camera]:
    """Perspective cameras of the placed nodes, by the name of camera or node; others are counted in a note.

    A glTF camera has no target: it is put as far along its view as the middle of the scene is.
    """
    found: dict[str, Camera] = {}
    others = 0
    middle = (positions.min(axis=0).astype(np.float64) + positions.max(axis=0)) / 2
    for index, world in matrices.items():
        node = document.nodes[index]
        if node.camera is None:
            continue
        given = document.cameras[node.camera]
        view = given.perspective if len(found) < _MOST else None
        camera = None if view is None else _placed(world, view.yfov, middle)
        if given.type != "perspective" or camera is None:
            others += 1
            continue
        name = plain = short_name(given.name or node.name or "camera")
        again = 2
        while name in found:
            name, again = f"{plain}-{again}", again + 1
        found[name] = camera
    if others:
        notes.append(f"cameras not read, which are not perspective, look nowhere or are too many: {others:,}")
    return found


def _placed(world: np.ndarray, yfov: float, middle: np.ndarray) -> Camera | None:
    """A camera looks along its own -Z, with +Y up; None where its node leaves it no direction."""
    eye, forward = world[:3, 3], -world[:3, 2]
    length = np.linalg.norm(forward)
    if not 0 < length < np.inf or not np.isfinite(eye).all():
        return None
    target = eye + forward / length * (float(np.linalg.norm(middle - eye)) or 1.0)
    up = world[:3, 1]
    try:
        return Camera(tuple(eye), tuple(target), tuple(up), vertical_fov_deg=math.degrees(yfov))
    except InputError:
        return None
