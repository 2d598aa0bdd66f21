"""Triangles as a Mitsuba scene: the only place that builds a mesh, so that its API may change once."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from ..arrays import Albedo, Normals, Positions, TextureCoordinates, Triangles
from ..scene.variant import mitsuba


def triangle_mesh(
    positions: Positions,
    triangles: Triangles,
    *,
    normals: Normals | None = None,
    bsdf: Any = None,
    uv: TextureCoordinates | None = None,
    tint: Albedo | None = None,
    emitter: Any = None,
) -> Any:
    """A ``mi.Mesh`` with these vertices, in this order.

    ``bsdf`` is a dict for ``mi.load_dict`` or what it has made; ``tint`` becomes the attribute ``vertex_tint``;
    ``emitter`` is an area light of Mitsuba's.
    """
    mi = mitsuba()
    props = mi.Properties()
    if emitter is not None:
        props["emitter"] = emitter
    if bsdf is not None:
        props["bsdf"] = mi.load_dict(bsdf) if isinstance(bsdf, dict) else bsdf
    mesh = mi.Mesh(
        "scene",
        len(positions),
        len(triangles),
        has_vertex_normals=normals is not None,
        has_vertex_texcoords=uv is not None,
        props=props,
    )
    if tint is not None:
        mesh.add_attribute("vertex_tint", 3, np.ascontiguousarray(tint, np.float32).ravel())
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(positions, np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(triangles, np.uint32).ravel()
    if normals is not None:
        parameters["vertex_normals"] = np.ascontiguousarray(normals, np.float32).ravel()
    if uv is not None:
        parameters["vertex_texcoords"] = np.ascontiguousarray(uv, np.float32).ravel()
    parameters.update()
    return mesh


def triangle_scene(positions: Positions, triangles: Triangles) -> tuple[ModuleType, Any]:
    """Mitsuba and a scene of nothing but these triangles, for shadow rays."""
    mi = mitsuba()
    return mi, mi.load_dict({"type": "scene", "mesh": triangle_mesh(positions, triangles)})


class Occluders:
    """Mitsuba and the scene of these bare triangles: built once, whoever's shadow rays it serves.

    Parameters
    ----------
    positions, triangles
        ``(V, 3)`` metres and ``(F, 3)`` indices into them; what casts shadows.

    Attributes
    ----------
    mi, scene
        Mitsuba in the variant of this machine, and an ``mi.Scene`` of one mesh without a BSDF.
    positions
        As given: how far they reach tells how far rays must begin from their surface.
    """

    def __init__(self, positions: Positions, triangles: Triangles) -> None:
        self.positions = positions
        self.mi, self.scene = triangle_scene(positions, triangles)
