"""Whether a scene's mesh is fine enough for the light that bounces in it, told when it is baked."""

from __future__ import annotations

import numpy as np

from ..arrays import Normals, Positions
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from ..transport.bounces import bounced
from ..transport.gathering import Gathering
from ..transport.mesh_fitness import MeshFitness, measure_fitness

_POINTS = 4_000  # the share is then known to a percent
_RAYS = 256
_TOLERANCE = 1e-2  # far below what is called unfit


def even_sky_fitness(scene: Scene, occluders: Occluders, gathering: Gathering) -> MeshFitness:
    """How well the mesh holds the light of an even sky, direct and bounced: the smoothest there is.

    What cannot hold this holds nothing sharper. ``gathering`` is the scene's, from its vertices.
    """
    E = np.repeat(gathering.sky[:, None, None], 1 if gathering.is_grey else 3, axis=2).astype(np.float32)

    def sky_at(positions: Positions, normals: Normals) -> np.ndarray:
        there = Gathering.trace(scene, occluders, origins=positions, normals=normals, rays=_RAYS, seed=2)
        return np.repeat(there.sky[:, None, None], E.shape[2], axis=2).astype(np.float32)

    return measure_fitness(
        scene, occluders, direct=E, indirect=bounced(gathering, E, tolerance=_TOLERANCE).indirect,
        direct_at=sky_at, most=_POINTS,
    )  # fmt: skip
