"""Irradiance / π without clusters, by a shadow ray to every environment light: what a bake is held against."""

from __future__ import annotations

import numpy as np

from ..arrays import CubeMap, Float64, Int32, Normals, Positions, Triangles
from ..bases.cube_map import solid_angles, texel_directions
from .visibility import Visibility

_PAIRS = 1 << 22  # receiver-directions held as floats at a time


def integrate_exactly(
    positions: Positions,
    triangles: Triangles,
    normals: Normals,
    *,
    receivers: Int32[np.ndarray, "chosen"],
    cube: CubeMap,
) -> Float64[np.ndarray, "chosen channels"]:
    """Σ_j L(d_j) Δω_j V(x_i, d_j) max(d_j · n_i, 0) / π over all 6R² lights (Eq. 1), albedo left out.

    ``cube`` may have any number of channels, so that several maps share their rays.
    """
    R = cube.shape[1]
    n = normals[receivers]
    visibility = Visibility(positions, triangles, origins=positions[receivers], normals=n)
    light = (cube * solid_angles(R)[None, :, :, None]).reshape(6 * R * R, -1)
    total = np.zeros((len(receivers), light.shape[1]))
    step = max(1, _PAIRS // len(receivers))
    for start in range(0, len(light), step):
        texels = np.arange(start, min(start + step, len(light)))
        d = texel_directions(texels, R)
        bits, _ = visibility.trace(d)
        seen = np.unpackbits(bits, axis=1, count=len(receivers), bitorder="little")
        T = np.maximum(d @ n.T, 0) * seen  # (directions, receivers)
        total += T.T @ light[texels]
    return total / np.pi
