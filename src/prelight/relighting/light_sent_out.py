"""Lamplight falling out of a room: what its portals send into every direction, from the rows that light comes in by.

A row says how much of the light of a cell of a portal's shell arrives at a vertex. Light goes back along the same
lines (Helmholtz), so the product with the rows' transpose tells what the vertices' radiance sends out through the
portal toward that cell: nothing more is baked for it. What is sent out does not come back (R_Θ says from where on that
would matter).
"""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Float64, Radiance, Triangles
from ..bases import cube_map
from ..encoding.pulse_or_haar import RunRows, tables_of
from ..errors import InputError
from ..lighting.glass import Glass
from .portals_layer import PortalsLayer

_BYTES_AT_ONCE = 1 << 22


def sent_out(
    layer: PortalsLayer,
    radiance: Radiance,
    areas: Float64[np.ndarray, "vertices"],
    glass: list[Glass] | None = None,
) -> Float32[np.ndarray, "portals 6 row column 3"]:
    """Radiant intensity of each portal toward the cells of its shell, W/sr: a light in its middle, seen from far.

    Parameters
    ----------
    radiance
        ``(V, 3)`` that the vertices send to all sides: albedo times irradiance / π, and what they emit.
    areas
        ``(V,)`` m² of surface that each vertex stands for (``areas_around``).
    glass
        Of each portal, as now; what it lets out is what it lets in, frost aside. As built if not given.

    Raises InputError for arrays of another size.
    """
    vertices = int(layer.receiver.max(initial=-1)) + 1
    if radiance.shape != (len(areas), 3) or len(areas) < vertices:
        raise InputError(
            "radiance", f"{radiance.shape} and {len(areas)} areas, expected (V, 3) and V of the bake"
        )
    flux = np.pi * radiance.astype(np.float64) * np.asarray(areas, np.float64)[:, None]
    if len(layer.glass):
        flux[layer.glass] = 0  # panes send nothing of their own
    n = layer.cube
    out = np.zeros((len(layer.names), 6 * n * n, 3))
    for pane, portal in enumerate(layer.portal_of_pane.tolist()):
        first, last = int(layer.pane_rows[pane]), int(layer.pane_rows[pane + 1])
        if last > first:
            rows = layer.rows.chosen(np.arange(first, last))
            out[portal] += transposed(rows, flux[layer.receiver[first:last]]) * layer.pane_tints[pane]
    own = layer.tints.tolist()
    factors = [(glass[p] if glass else Glass()).factor(own[p]) for p in range(len(out))]
    solid = np.tile(cube_map.solid_angles(n).ravel(), 6)[None, :, None]
    return (out * np.array(factors)[:, None] / solid).reshape(len(out), 6, n, n, 3).astype(np.float32)


def transposed(rows: RunRows, values: Float64[np.ndarray, "rows n"]) -> Float64[np.ndarray, "cells n"]:
    """Rowsᵀ · values."""
    cells, ends = 6 * rows.resolution**2, rows.row_bytes
    sums = np.zeros((2, cells, values.shape[1]))  # of pulses, and of Haar coefficients
    first = 0
    while first < len(rows):
        last = max(first + 1, int(np.searchsorted(ends, ends[first] + _BYTES_AT_ONCE, side="right")) - 1)
        _add_some(rows, values, first, min(last, len(rows)), sums)
        first = min(last, len(rows))
    # Haar's transform is orthonormal: its transpose brings coefficients back to cells, face by face.
    face = cells // 6
    identity = np.zeros((cells, face), np.float32)
    identity[:face] = np.eye(face, dtype=np.float32)
    transform = tables_of(identity, rows.resolution)[1][:face].astype(np.float64)
    return sums[0] + np.einsum("kc,fkn->fcn", transform, sums[1].reshape(6, face, -1)).reshape(cells, -1)


def areas_around(positions: np.ndarray, triangles: Triangles) -> Float64[np.ndarray, "vertices"]:
    """(V,) a third of the area of each vertex's triangles, m²."""
    a, b, c = np.moveaxis(positions[triangles].astype(np.float64), 1, 0)
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return np.bincount(triangles.ravel(), np.repeat(area / 3, 3), minlength=len(positions))


def _add_some(rows: RunRows, values: np.ndarray, first: int, last: int, sums: np.ndarray) -> None:
    runs = rows.runs[rows.row_runs[first] : rows.row_runs[last]].astype(np.int64)
    begin, end = int(rows.row_bytes[first]), int(rows.row_bytes[last])
    lengths = runs[:, 1]
    into = np.arange(end - begin) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    cell = np.repeat(runs[:, 0], lengths) + into
    row = np.repeat(np.arange(first, last), np.diff(rows.row_bytes[first : last + 1]))
    byte, kind = rows.data[begin:end], rows.kind[row].astype(np.int64)
    signed = byte.view(np.int8).astype(np.float64)
    value = np.where(kind == 1, signed * np.abs(signed), byte.astype(np.float64)) * rows.scale[row]
    for k in range(values.shape[1]):
        found = np.bincount(kind * len(sums[0]) + cell, value * values[row, k], minlength=2 * len(sums[0]))
        sums[:, :, k] += found.reshape(2, -1)
