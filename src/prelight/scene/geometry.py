"""A scene: static triangles and what they are made of, as plain arrays."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Albedo, MaterialOf, Normals, Positions, Texture, TextureCoordinates, Triangles
from ..camera import Camera
from ..material import Material
from ..receivers import Receivers


@dataclass(frozen=True)
class Scene:
    """Triangles, and what they are made of; every vertex can be a receiver.

    ``albedo`` is what a diffuse bake uses: material colour × vertex colour × texture at the vertex.
    """

    name: str
    positions: Positions  # (V, 3) metres, finite
    normals: Normals  # (V, 3) unit length; zero where no triangle uses the vertex
    triangles: Triangles  # (F, 3) indices into positions
    albedo: Albedo  # (V, 3) linear Rec.709, in [0, 1]
    cameras: dict[str, Camera] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # what the loader read otherwise than the file says, one line each
    materials: tuple[Material, ...] = (Material(),)
    material_of: MaterialOf = field(
        default_factory=lambda: np.zeros(0, np.int32)
    )  # (F,) index; all 0 if empty
    uv: TextureCoordinates | None = (
        None  # (V, 2) u to the right, v down from a texture's first row; repeating
    )
    tint: Albedo | None = None  # (V, 3) the albedo without its texture; ``albedo`` itself if None
    textures: tuple[Texture, ...] = ()  # (H, W, 3) bytes

    def __post_init__(self) -> None:
        if len(self.material_of) != len(self.triangles):
            object.__setattr__(self, "material_of", np.zeros(len(self.triangles), np.int32))

    @property
    def receivers(self) -> Receivers:
        return Receivers(self.positions, self.normals, self.albedo)

    @property
    def material_of_vertex(self) -> MaterialOf:
        """(V,) the material of a triangle at each vertex; 0 where there is none."""
        of = np.zeros(len(self.positions), np.int32)
        vertices, first = np.unique(self.triangles, return_index=True)  # the first triangle has the word
        of[vertices] = self.material_of[first // 3]
        return of

    @property
    def digest(self) -> str:
        """sha256 of everything the light depends on."""
        h = hashlib.sha256()
        arrays = [self.positions, self.normals, self.triangles, self.albedo, self.material_of, *self.textures]
        for array in arrays + [a for a in (self.uv, self.tint) if a is not None]:
            h.update(repr((array.shape, array.dtype.str)).encode())
            h.update(np.ascontiguousarray(array).data)
        materials = [material.to_dict() for material in self.materials]
        h.update(json.dumps(materials, sort_keys=True, default=list).encode())
        return h.hexdigest()
