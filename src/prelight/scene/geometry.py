"""A scene: static triangles and what they are made of, as plain arrays."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field

import numpy as np

from ..arrays import Albedo, Normals, Positions, Triangles
from ..camera import Camera
from ..receivers import Receivers


@dataclass(frozen=True)
class Scene:
    """Triangles with one diffuse albedo a vertex; every vertex is a receiver."""

    name: str
    positions: Positions  # (V, 3) metres, finite
    normals: Normals  # (V, 3) unit length; zero where no triangle uses the vertex
    triangles: Triangles  # (F, 3) indices into positions
    albedo: Albedo  # (V, 3) linear Rec.709, in [0, 1]
    cameras: dict[str, Camera] = field(default_factory=dict)
    notes: tuple[str, ...] = ()  # what the loader read otherwise than the file says, one line each

    @property
    def receivers(self) -> Receivers:
        return Receivers(self.positions, self.normals, self.albedo)

    @property
    def digest(self) -> str:
        """sha256 of everything the light depends on."""
        h = hashlib.sha256()
        for array in (self.positions, self.normals, self.triangles, self.albedo):
            h.update(repr((array.shape, array.dtype.str)).encode())
            h.update(np.ascontiguousarray(array).data)
        return h.hexdigest()
