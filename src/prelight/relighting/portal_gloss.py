"""Gloss of a room lit through portals: each pane shows its shell, and suns are mirrored by themselves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import CubeMap, Float32, Float64, Int32, Normals, Positions, Radiance
from ..bases import cube_map
from ..lighting.quantities import Triple
from .exitant import CELLS, CellLight, Lights, on_cells
from .live_gloss import Falling
from .portal_sunlight import Sunlight

_FLAT = 0.05  # cosine: what a light brings to a place that sees it flatter than this is not told from its irradiance
_RAYS = 4  # to a disc, from each pixel


@dataclass(frozen=True)
class PortalLight:
    """What falls into a room now.

    Attributes
    ----------
    irradiance
        (V, 3) irradiance / π of all bounces.
    shells
        Of each portal, as its glass shows it, without the discs of ``suns``.
    portal_of_pane, of_pane
        And what each pane lets through, (N, 3).
    suns
        Discs through clear glass.
    normals
        (V, 3) of the vertices.
    """

    irradiance: Radiance
    shells: Sequence[CubeMap]
    portal_of_pane: Int32[np.ndarray, "panes"]
    of_pane: Float32[np.ndarray, "panes 3"]
    suns: Sunlight | None
    normals: Normals

    def falling(self) -> Falling:
        """For gloss to mirror."""
        return Falling(self.irradiance, self._sky, self._of_rows, self._at)

    def _sky(self) -> CellLight:
        cells = np.zeros((len(self.portal_of_pane), 6, CELLS, CELLS, 3), np.float32)
        known: dict[int, np.ndarray] = {}
        for pane, portal in enumerate(self.portal_of_pane.tolist()):
            shell = self.shells[portal]
            if id(shell) not in known:
                known[id(shell)] = on_cells(shell)
            cells[pane] = known[id(shell)] * self.of_pane[pane]
        return cells

    def _of_rows(self, rows: Int32[np.ndarray, "rows"]) -> Lights | None:
        if self.suns is None or not self.suns.is_on:
            return None
        return _as_falls([(d, light[rows]) for d, light in self.suns.of_discs()], self.normals[rows])

    def _at(self, points: Positions, normals: Normals) -> Lights:
        discs = [] if self.suns is None else self.suns.of_discs_at(points, normals, shadow_rays=_RAYS)
        return _as_falls(discs, normals)


def _as_falls(discs: Sequence[tuple[Triple, Radiance]], normals: Normals) -> Lights:
    """Irradiance / π of discs as what a surface facing each gets."""
    d = np.array([direction for direction, _ in discs], np.float32).reshape(-1, 3)
    d /= np.maximum(np.linalg.norm(d, axis=1, keepdims=True), np.float32(1e-20))
    energy = np.zeros((len(normals), len(d), 3), np.float32)
    for k, (_, light) in enumerate(discs):
        energy[:, k] = np.float32(np.pi) * light / np.maximum(normals @ d[k], np.float32(_FLAT))[:, None]
    return np.ascontiguousarray(np.broadcast_to(d, (len(normals), *d.shape))), energy


def seen_in(
    shells: Mapping[int, CubeMap], portal_of: Int32[np.ndarray, "n"], *, positions: Positions, eye: Triple
) -> Radiance:
    """(n, 3) radiance of each portal's shell behind points of panes, as an eye sees it."""
    d = positions.astype(np.float64) - np.asarray(eye, np.float64)
    d /= np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-12)
    out = np.zeros((len(positions), 3), np.float32)
    for portal, shell in shells.items():
        own = portal_of == portal
        out[own] = _along(shell, d[own])
    return out


def _along(shell: CubeMap, d: Float64[np.ndarray, "n 3"]) -> Float32[np.ndarray, "n 3"]:
    """The texels that directions fall in."""
    n = shell.shape[1]
    face, u, v = cube_map.face_coordinates(d)
    row, column = (np.clip(((t + 1) / 2 * n).astype(np.int64), 0, n - 1) for t in (v, u))
    return shell[face, row, column]
