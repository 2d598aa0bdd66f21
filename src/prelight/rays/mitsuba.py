"""Triangles as a Mitsuba scene: the only place that builds a mesh, so that its API may change once."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from ..arrays import Normals, Positions, Triangles
from ..scene.variant import mitsuba


def triangle_mesh(
    positions: Positions, triangles: Triangles, *, normals: Normals | None = None, bsdf: dict | None = None
) -> Any:
    """A ``mi.Mesh`` with these vertices, in this order."""
    mi = mitsuba()
    props = mi.Properties()
    if bsdf is not None:
        props["bsdf"] = mi.load_dict(bsdf)
    mesh = mi.Mesh(
        "scene", len(positions), len(triangles), has_vertex_normals=normals is not None, props=props
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(positions, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(triangles, np.uint32).ravel()
    if normals is not None:
        parameters["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
    parameters.update()
    return mesh


def triangle_scene(positions: Positions, triangles: Triangles) -> tuple[ModuleType, Any]:
    """Mitsuba and a scene of nothing but these triangles, for shadow rays."""
    mi = mitsuba()
    return mi, mi.load_dict({"type": "scene", "mesh": triangle_mesh(positions, triangles)})
