"""A room's windows and the world outside them as Mitsuba's path tracer has them: sheets of colour, and real meshes.

Glass of portals becomes a sheet that bends nothing and takes its share of each colour, as the relighter has it: so
light is looked for through it, a sun behind it too. The world stands where it is at the rig's moment, in the room's
axes, with its own materials, which the relighter has as matte means. Frosted glass has no like among Mitsuba's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Float32
from ..errors import InputError
from ..lighting.environment import Environment
from ..lighting.glass import FROSTED, glass_of
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..rays.mitsuba import triangle_mesh
from ..rays.surfaces import SurfaceScene
from ..relighting.exterior import placed_shape
from ..relighting.portals_layer import KIND, PortalsLayer, read_portals
from ..scene.baked import scene_of
from ..scene.geometry import Scene
from ..storage.bake import Bake


@dataclass(frozen=True)
class Sheet:
    """Triangles (n, 3, 3) in metres, and what passes them of red, green and blue, 0 to 1."""

    corners: Float32[np.ndarray, "n 3 3"]
    passes: Triple


@dataclass(frozen=True)
class Windows:
    """A room without the glass of its portals, sheets in its place, what stands outside, and the sky around."""

    room: Scene
    sheets: tuple[Sheet, ...]
    outside: tuple[Scene, ...]
    environment: Environment

    def shapes(self, mi: Any) -> list[Any]:
        """Meshes of the sheets and of what stands outside."""
        made = [_sheet(mi, sheet) for sheet in self.sheets]
        for scene in self.outside:
            made += [mesh for mesh in SurfaceScene(scene).meshes if mesh is not None]
        return made


def windows_of(bake: Bake, rig: Rig) -> Windows:
    """The windows of a bake under a rig, as they are at its moment.

    Raises InputError for frosted glass, for a world that cannot be read, and for both in a bake that does not say where
    its windows are.
    """
    room = scene_of(bake)
    known = [name for name, record in bake.layers.items() if record.kind == KIND]
    layer = read_portals(bake, known[0]) if known else None
    if layer is None or layer.openings is None:
        if rig.portals or rig.outside is not None:
            what = "this bake does not say where its windows are, for the path tracer; bake its portals anew"
            raise InputError("glass", what)
        return Windows(room, (), (), rig.environment)
    sheets = _sheets(layer, rig)
    kept = np.ones(len(room.triangles), bool)
    kept[layer.openings.glass] = False
    bare = replace(room, triangles=room.triangles[kept], material_of=room.material_of[kept])
    if rig.outside is None:
        return Windows(bare, sheets, (), rig.environment)
    here = rig.outside.room.at(rig.seconds)
    shapes = (placed_shape(one, rig.seconds, room=here) for one in rig.outside.objects)
    return Windows(bare, sheets, tuple(shapes), rig.environment.rotated(here.heading_deg))


def _sheets(layer: PortalsLayer, rig: Rig) -> tuple[Sheet, ...]:
    """One for each pane that has triangles."""
    found, openings = [], layer.openings
    assert openings is not None  # looked at by the caller
    glasses = glass_of(layer.names, rig.portals)
    for pane in np.unique(openings.pane_of).tolist():
        portal = int(layer.portal_of_pane[pane])
        name, glass = layer.names[portal], glasses[portal]
        if glass.kind == FROSTED and glass.frost > 0:
            what = f"frosted glass has no like in the path tracer, and {name!r} is; make it clear to compare"
            raise InputError("glass", what)
        red, green, blue = (float(part) for part in layer.pane_tints[pane])
        found.append(Sheet(openings.corners[openings.pane_of == pane], glass.factor((red, green, blue))))
    return tuple(found)


def _sheet(mi: Any, sheet: Sheet) -> Any:
    corners = sheet.corners.reshape(-1, 3)
    across = np.cross(sheet.corners[:, 1] - sheet.corners[:, 0], sheet.corners[:, 2] - sheet.corners[:, 0])
    length = np.linalg.norm(across, axis=1, keepdims=True)
    normals = np.repeat(across / np.maximum(length, 1e-30), 3, axis=0).astype(np.float32)
    bsdf = mi.load_dict(
        {
            "type": "thindielectric", "int_ior": 1.0, "ext_ior": 1.0,
            "specular_transmittance": {"type": "rgb", "value": list(sheet.passes)},
        }
    )  # fmt: skip
    triangles = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return triangle_mesh(corners, triangles, normals=normals, bsdf=bsdf)
