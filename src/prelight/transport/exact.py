"""B = T·l without clusters, by a shadow ray to every environment light: what a bake is held against."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import CubeMap, Float64, Int32, Normals, Positions, Triangles
from ..bases.cube_map import solid_angles, texel_directions
from ..rays.mitsuba import Occluders
from .direct import DiffuseTransfer
from .transfer import Transfer
from .visibility import MAX_LANES

_PAIRS = 1 << 22  # receiver-directions held as floats at a time


def integrate(
    transfer: Transfer, cube: CubeMap, *, report: Callable[[float], None] | None = None
) -> Float64[np.ndarray, "receivers channels"]:
    """Σ_j L(d_j) Δω_j T_j over all 6R² lights (Eq. 7), of any number of maps that share their rays.

    ``cube`` (6, R, R, channels) holds one map behind the other; for a transfer of three channels each is red,
    green, blue. Lights that are dark in all of them cost nothing. ``report`` hears the share done, 0 to 1.
    """
    R, channels = cube.shape[1], transfer.channels
    light = (cube * solid_angles(R)[None, :, :, None]).reshape(6 * R * R, -1)
    lit = np.flatnonzero(light.any(axis=1))
    total = np.zeros((transfer.receivers, light.shape[1]))
    step = max(1, _PAIRS // (max(transfer.receivers, 1) * channels))
    for start in range(0, len(lit), step):
        texels = lit[start : start + step]
        d = texel_directions(texels, R)
        rows, _ = transfer.trace(d, lanes=MAX_LANES)
        T = transfer.values(rows, d)  # (directions, channels, receivers)
        for c in range(channels):
            total[:, c::channels] += T[:, c].T @ light[texels, c::channels]
        if report is not None:
            report(min(start + step, len(lit)) / len(lit))
    return total


def integrate_exactly(
    positions: Positions,
    triangles: Triangles,
    normals: Normals,
    *,
    receivers: Int32[np.ndarray, "chosen"],
    cube: CubeMap,
) -> Float64[np.ndarray, "chosen channels"]:
    """Irradiance / π of diffuse vertices (Eq. 1 with albedo left out).

    ``cube`` may have any number of channels, so that several maps share their rays.
    """
    transfer = DiffuseTransfer(Occluders(positions, triangles), positions[receivers], normals[receivers])
    return integrate(transfer, cube)
