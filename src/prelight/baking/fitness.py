"""Whether a scene's mesh is fine enough for the light that bounces in it, told when it is baked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Directions, Normals, Positions
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from ..transport.bounces import bounced
from ..transport.gathering import Gathering
from ..transport.mesh_fitness import MeshFitness, measure_fitness
from ..transport.metal_rays import Metals

_POINTS = 4_000  # the share is then known to a percent
_RAYS = 256
_TOLERANCE = 1e-2  # far below what is called unfit


def even_sky_fitness(
    scene: Scene, occluders: Occluders, gathering: Gathering, *, metals: Metals | None = None
) -> MeshFitness:
    """How well the mesh holds the light of an even sky, direct and bounced: the smoothest there is.

    What cannot hold this holds nothing sharper. ``gathering`` is the scene's, from its vertices, with ``metals``.
    """
    if metals is not None:
        metals = replace(metals, cell_of=_no_cells, cells=1)  # the sky is even
    C = 1 if gathering.is_grey else 3

    def sky_at(positions: Positions, normals: Normals) -> np.ndarray:
        there = Gathering.trace(
            scene, occluders, origins=positions, normals=normals, rays=_RAYS, seed=2, metals=metals
        )
        return _even_sky(there, C)

    E = _even_sky(gathering, C)
    return measure_fitness(
        scene, occluders, direct=E, indirect=bounced(gathering, E, tolerance=_TOLERANCE).indirect,
        direct_at=sky_at, most=_POINTS, metals=metals,
    )  # fmt: skip


def _even_sky(gathering: Gathering, channels: int) -> np.ndarray:
    """Direct light of a sky of 1, (rows, 1, channels): of grey scenes, which follow no metal, one channel."""
    return (gathering.sky[:, None] + gathering.mirrored_sky[:, :channels])[:, None]


def _no_cells(d: Directions) -> np.ndarray:
    return np.zeros(len(d), np.int32)
