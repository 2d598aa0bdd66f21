"""The one-bounce operator that suns bounce by in a room lit through portals, thinned for the light that comes in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Float32
from ..bases import cube_map
from ..bases.well_spread import spiral
from ..transport.bounces import bounced
from ..transport.gathering import Gathering
from .entry_weights import EntryWeights
from .first_bounce import FirstBounce, thinned_operator
from .portals_direct import DirectLight
from .portals_room import PortalsRoom

_ROUGHLY = 0.02  # of all bounced light: it only says where light is likely
_DIRECTIONS, _SUNS = 64, 8  # looked in, and measured
_REACHES = 0.05  # of the light of the brightest: what others bring at least


def bounce_of_suns(room: PortalsRoom, direct: DirectLight, gathering: Gathering) -> FirstBounce:
    """Thinned as an even sky lights the room, by way of what is outside of its glass too; with the error for suns."""
    channels = 1 if gathering.is_grey else 3
    fallen = np.zeros((len(room.scene.positions), 1, channels), np.float32)
    for portal in range(len(room.portals)):
        fallen += direct.harmonics(room, portal, slice(0, 1), channels=channels, functions=1)
    around = np.maximum(fallen, _around(room, fallen))  # suns at run time light whole triangles
    sent = bounced(gathering, around, tolerance=_ROUGHLY, most=room.settings.bounces).indirect
    weights = EntryWeights.of(around.mean(axis=(1, 2)), sent.mean(axis=(1, 2)))
    first = thinned_operator(gathering, room.bouncing, rays=room.settings.gather_rays, weights=weights)
    return replace(first, error=_error(first, direct, gathering))


def _around(room: PortalsRoom, light: np.ndarray) -> np.ndarray:
    """The mean over the triangles around each vertex."""
    scene, flat = room.open, light.reshape(len(light), -1)
    a, b, c = np.moveaxis(scene.positions[scene.triangles].astype(np.float64), 1, 0)
    area = np.repeat(np.linalg.norm(np.cross(b - a, c - a), axis=1), 3)
    corners, vertices = scene.triangles.ravel(), len(light)
    whole = np.maximum(np.bincount(corners, area, minlength=vertices), 1e-30)
    of = np.repeat(flat[scene.triangles].mean(axis=1), 3, axis=0)
    found = [np.bincount(corners, area * of[:, k], minlength=vertices) / whole for k in range(flat.shape[1])]
    return np.stack(found, axis=1).reshape(light.shape).astype(np.float32)


def _error(first: FirstBounce, direct: DirectLight, gathering: Gathering) -> float:
    """RMS over receivers and some suns of what thinning changes, as a share of the bounce itself."""
    suns = _suns(direct, len(first.order))
    if not suns.shape[1]:
        return 0.0
    D = np.repeat(suns[:, :, None], 3, axis=2)
    truth = gathering.bounce(np.ascontiguousarray(D))
    lost = whole = 0.0
    for k in range(D.shape[1]):
        found = first.bounce(np.ascontiguousarray(D[:, k]))
        lost += float(np.square(found - truth[:, k], dtype=np.float64).sum())
        whole += float(np.square(truth[:, k], dtype=np.float64).sum())
    return float(np.sqrt(lost / whole)) if whole else 0.0


def _suns(direct: DirectLight, receivers: int) -> Float32[np.ndarray, "receivers suns"]:
    """What single cells of the sky bring to all receivers, some that bring much."""
    n = direct.rows.resolution
    face, u, v = cube_map.face_coordinates(spiral(_DIRECTIONS))
    row, column = (np.minimum((x + 1) / 2 * n, n - 1).astype(np.int64) for x in (v, u))
    cells = np.unique((face * n + row) * n + column)
    light = np.zeros((6 * n * n, len(cells)), np.float32)
    light[cells, np.arange(len(cells))] = 1.0
    out = np.zeros((receivers, len(cells)), np.float32)
    for pane in range(len(direct.portal_of_pane)):
        first, last = int(direct.pane_rows[pane]), int(direct.pane_rows[pane + 1])
        out[direct.receiver[first:last]] += direct.rows.times(light, first, last)
    reach = out.sum(axis=0, dtype=np.float64)
    lit = np.flatnonzero(reach > _REACHES * reach.max(initial=0))
    return out[:, lit[np.unique(np.linspace(0, len(lit) - 1, _SUNS).astype(int))]] if len(lit) else out[:, :0]
