"""The arrays of a cloud layer, from its zones: see docs/bake-format.md."""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Int32
from ..encoding.modes import in_bytes
from .cloud_grid import LightGrid
from .cloud_zones import Zone
from .scene_arrays import not_empty


def kept_lights(zones: list[Zone]) -> tuple[Int32[np.ndarray, "lights"], Int32[np.ndarray, "zones kept"]]:
    """Lights that are in one group in every zone are one from here on.

    Which kept light each light of the grid is, and the group of each kept light in every zone.
    """
    of = np.stack([zone.groups.group_of for zone in zones])
    groups, kept = np.unique(of, axis=1, return_inverse=True)
    return kept.reshape(-1).astype(np.int32), np.ascontiguousarray(groups, np.int32)


def light_arrays(
    grid: LightGrid, zones: list[Zone], brought: Float32[np.ndarray, "lights modes"] | None
) -> tuple[dict[str, np.ndarray], float]:
    """Lights and what they are in each zone; and what fluxes, of each mode, are to be multiplied by."""
    kept_of, group_of = kept_lights(zones)
    sizes = np.bincount(kept_of)
    middles = np.zeros((len(sizes), 3))
    np.add.at(middles, kept_of, grid.positions)
    lights = np.concatenate([middles / sizes[:, None], sizes[:, None]], axis=1)
    arrays = {
        "grid": grid.positions.astype(np.float32),
        "kept_of": kept_of,
        "lights": lights.astype(np.float32),
        "group_of": group_of.astype(np.uint16),
    }
    if brought is None:
        return arrays, 0.0
    means = np.zeros((len(sizes), brought.shape[1]))
    np.add.at(means, kept_of, brought)
    means /= sizes[:, None]
    scale = float(np.abs(means).max()) or 1.0
    arrays["fluxes"] = half_floats(means / scale)
    return arrays, scale


def zone_modes(zones: list[Zone]) -> Int32[np.ndarray, "zones 2"]:
    """The first mode of each zone, and how many it has."""
    return np.array([(zone.modes.start, zone.modes.stop - zone.modes.start) for zone in zones], np.int32)


def row_arrays(zones: list[Zone], *, codes: str) -> dict[str, np.ndarray]:
    """Clusters, their bases, and the coordinates of their vertices."""
    order, table, bases, base_scales, values, value_scales = [], [], [], [], [], []
    for z, zone in enumerate(zones):
        for cluster in zone.clusters:
            order.append(zone.vertices[cluster.rows])
            table.append([z, len(cluster.rows), len(cluster.basis)])
            rows = np.concatenate([cluster.mean[None], cluster.basis])
            scale = np.abs(rows).max(axis=1)
            bases.append(half_floats(rows / np.where(scale > 0, scale, 1)[:, None]).ravel())
            base_scales.append(scale)
            for coordinates in cluster.coordinates:
                if codes == "bytes":
                    coded, own = in_bytes(np.ascontiguousarray(coordinates.T))
                    values.append(coded.T.ravel())
                else:
                    own = np.abs(coordinates).max(axis=1, initial=0)
                    values.append(half_floats(coordinates / np.where(own > 0, own, 1)[:, None]).ravel())
                value_scales.append(own)
    counts = np.array([len(zone.vertices) for zone in zones], np.int32)
    return {
        "order": np.concatenate(order).astype(np.int32),
        "zone_rows": counts,
        "clusters": np.array(table, np.int32),
        "bases": np.concatenate(bases),
        "base_scales": np.concatenate(base_scales).astype(np.float32),
        "codes": not_empty(np.concatenate(values)),
        "code_scales": not_empty(np.concatenate(value_scales).astype(np.float32)),
    }


def half_floats(values: np.ndarray) -> np.ndarray:
    """Half-precision numbers as the bits that they are, uint16; nothing is beyond them within [−1, 1]."""
    return np.ascontiguousarray(values, np.float16).view(np.uint16)
