"""What glossy vertices see: in each cell of a coarse cube, the sky or a vertex whose light is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32, Int32, Normals, Positions, UInt16
from ..bases.cube_map import AXIS, U, V
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.geometry import Scene
from .hemisphere import lit_sides

CELLS = 16  # along a side of a face of the cube that vertices look into
SUBRAYS = 4  # of a cell
NONE = (1 << 25) - 1  # the vertex of a cell that shows none
_QUARTERS = 6 * CELLS * CELLS * SUBRAYS
_LANES = 1 << 22
_STAGE = 37  # keeps these random numbers apart from those of other stages
_AHEAD = 1e-4  # of the way, and metres: where a ray goes on behind a pane

Report = Callable[[float], None]


@dataclass(frozen=True)
class Seen:
    """Cells above the horizon of each row, one row after the other.

    ``codes``: sky · 2²⁸ + surface · 2²⁵ + vertex, the first two the quarters of the cell that show the sky, and a lit
    surface; ``vertex`` (or NONE) one of those that the surface's light is known at.
    """

    counts: UInt16[np.ndarray, "rows"]
    texels: UInt16[np.ndarray, "entries"]  # face · 16² + row · 16 + column
    codes: Int32[np.ndarray, "entries"]
    rays: int
    panes: UInt16[np.ndarray, "entries"] | None = None  # that the sky is seen through; 0 where none is


@dataclass(frozen=True)
class Glazing:
    """Panes that the sky is seen through, and nothing else: triangles that are no occluders, and each one's pane."""

    scene: Any  # of Mitsuba's
    pane_of: Int32[np.ndarray, "triangles"]
    layers: int = 1  # that a ray may pass; what it passes last is its pane


def quarters(cells: int) -> tuple[Float32[np.ndarray, "quarters 3"], Float32[np.ndarray, "faces 2 3"]]:
    """A corner of every quarter of every cell, before normalisation, and the quarters' sides on each face.

    Cells in the order of texels, each one's quarters together.
    """
    face, row, column, quarter = (x.ravel() for x in np.indices((6, cells, cells, SUBRAYS)))
    v, u = ((2 * place + half) / cells - 1 for place, half in ((row, quarter // 2), (column, quarter % 2)))
    corner = AXIS[face] + u[:, None] * U[face] + v[:, None] * V[face]
    return corner.astype(np.float32), np.stack([U, V], axis=1).astype(np.float32) / np.float32(cells)


def seen_from(
    occluders: Occluders,
    scene: Scene,
    *,
    origins: Positions,
    normals: Normals,
    glazing: Glazing | None = None,
    seed: int = 0,
    report: Report | None = None,
) -> Seen:
    """What each of some places sees above its horizon: a ray for every quarter of every cell.

    A ray goes anywhere in its quarter, else a window along the cube's axes is a row of quarters too large or too small
    for all places at once. With ``glazing`` there is no sky but behind panes. ``origins`` before they are lifted from
    their surface; ``normals`` unit length.
    """
    sent = _CellRays(occluders, scene, origins=origins, normals=normals, glazing=glazing, seed=seed)
    counts, texels, codes, panes, rays = [], [], [], [], 0
    step = max(1, _LANES // (_QUARTERS))
    for first in range(0, len(origins), step):
        rows = slice(first, min(first + step, len(origins)))
        found, u, v, above = sent.trace(rows)
        rng = np.random.default_rng(np.random.SeedSequence([seed, _STAGE, first]))
        cell_codes, shown = _coded(found, u, v, above, scene.triangles, rng)
        panes.append(_panes(found, rng)[shown])
        rays += int(above.sum())
        counts.append(shown.sum(axis=1))
        texels.append(np.nonzero(shown)[1].astype(np.uint16))
        codes.append(cell_codes[shown])
        if report is not None:
            report(rows.stop / len(origins))
    if not counts:
        return Seen(np.zeros(0, np.uint16), np.zeros(0, np.uint16), np.zeros(0, np.int32), 0)
    parts = (np.concatenate(part) for part in (counts, texels, codes))
    counts_, texels_, codes_ = parts
    behind = None if glazing is None else np.concatenate(panes)
    return Seen(counts_.astype(np.uint16), texels_, codes_, rays, behind)


class _CellRays:
    """Rays through the quarters of all cells."""

    def __init__(
        self,
        occluders: Occluders,
        scene: Scene,
        *,
        origins: Positions,
        normals: Normals,
        glazing: Glazing | None,
        seed: int,
    ) -> None:
        self._glazing = glazing
        self._mi, self._scene = occluders.mi, occluders.scene
        mi = self._mi
        lifted = origins + np.float32(ray_offset(occluders.positions)) * normals
        corner, sides = quarters(CELLS)
        self._origin, self._normal, self._corner, self._lit, self._right, self._down = (
            mi.Vector3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in a.T))
            for a in (lifted, normals, corner, lit_sides(scene), sides[:, 0], sides[:, 1])
        )
        self._key = np.random.SeedSequence([seed, _STAGE]).generate_state(1)

    def trace(self, rows: slice) -> tuple[np.ndarray, ...]:
        """Triangles (rows, cells, 4), −1 the sky (−3 − p behind pane p), −2 what sends nothing; weights; and which are
        above the horizon."""
        import drjit as dr

        mi, count = self._mi, rows.stop - rows.start
        lane = dr.arange(mi.UInt32, count * _QUARTERS)
        row = lane // dr.opaque(mi.UInt32, _QUARTERS)
        ray = lane - row * dr.opaque(mi.UInt32, _QUARTERS)
        row += dr.opaque(mi.UInt32, rows.start)
        face = ray // dr.opaque(mi.UInt32, _QUARTERS // 6)
        drawn = mi.sample_tea_32(row, ray ^ dr.opaque(mi.UInt32, int(self._key[0])), 8)
        across, along = (mi.Float(number) * 2.0**-32 for number in drawn)
        d = dr.gather(mi.Vector3f, self._corner, ray)
        d += across * dr.gather(mi.Vector3f, self._right, face)
        d = dr.normalize(d + along * dr.gather(mi.Vector3f, self._down, face))
        above = dr.dot(dr.gather(mi.Vector3f, self._normal, row), d) > 0
        origin = mi.Point3f(dr.gather(mi.Vector3f, self._origin, row))
        hit = self._scene.ray_intersect_preliminary(mi.Ray3f(origin, d), active=above)
        met = above & hit.is_valid()
        lit = dr.dot(dr.gather(mi.Vector3f, self._lit, hit.prim_index, met), d) < 0
        outcome = dr.select(lit, mi.Int32(hit.prim_index), mi.Int32(-2))
        sky = mi.Int32(-1) if self._glazing is None else self._behind(self._glazing, origin, d, above & ~met)
        found = dr.select(met, outcome, dr.select(above, sky, mi.Int32(-2)))
        u, v = (dr.select(met, w, mi.Float(0)) for w in (hit.prim_uv.x, hit.prim_uv.y))
        up = dr.select(above, mi.UInt32(1), mi.UInt32(0))
        dr.eval(found, u, v, up)
        shape = (count, _QUARTERS // SUBRAYS, SUBRAYS)
        values = [a.numpy().reshape(shape) for a in (found, u, v)]
        return (*values, up.numpy().reshape(shape).astype(bool))

    def _behind(self, glazing: Glazing, origin: Any, d: Any, active: Any) -> Any:
        """−3 − the last pane on the way, −2 without one."""
        import drjit as dr

        mi = self._mi
        pane_of = mi.Int32(np.ascontiguousarray(glazing.pane_of, np.int32))
        found, start = mi.Int32(-2), mi.Float(0)
        for _ in range(glazing.layers):
            hit = glazing.scene.ray_intersect_preliminary(mi.Ray3f(origin + start * d, d), active=active)
            active &= hit.is_valid()
            pane = dr.gather(mi.Int32, pane_of, hit.prim_index, active)
            found = dr.select(active, -3 - pane, found)
            start += dr.select(active, hit.t * (1 + _AHEAD) + _AHEAD, 0)
        return found


def _panes(found: np.ndarray, rng: np.random.Generator) -> UInt16[np.ndarray, "rows cells"]:
    """One of the panes that the sky in each cell is behind; 0 where there is none."""
    through = found <= -3
    count = through.sum(axis=2)
    wanted = np.minimum((rng.random(count.shape) * count).astype(np.int64), np.maximum(count - 1, 0))
    which = ((np.cumsum(through, axis=2) - 1 == wanted[..., None]) & through).argmax(axis=2)[..., None]
    pane = -3 - np.take_along_axis(found, which, axis=2)[..., 0]
    return np.where(count > 0, pane, 0).astype(np.uint16)


def _coded(
    found: np.ndarray,
    u: np.ndarray,
    v: np.ndarray,
    above: np.ndarray,
    triangles: np.ndarray,
    rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Codes (rows, cells), and which cells have light to bring: one hit stands for all of a cell, one vertex for it."""
    sky = (((found == -1) | (found <= -3)) & above).sum(axis=2)
    lit = found >= 0
    surface = lit.sum(axis=2)
    draw = rng.random((*sky.shape, 2), np.float32)
    wanted = np.minimum((draw[..., 0] * surface).astype(np.int64), np.maximum(surface - 1, 0))
    which = ((np.cumsum(lit, axis=2) - 1 == wanted[..., None]) & lit).argmax(axis=2)[..., None]
    triangle, u, v = (np.take_along_axis(a, which, axis=2)[..., 0] for a in (found, u, v))
    corner = (draw[..., 1] < u + v).astype(np.int64) + (draw[..., 1] < v)  # 2 by v, 1 by u, else 0
    vertex = np.where(surface > 0, triangles[np.maximum(triangle, 0), corner], NONE)
    codes = (sky.astype(np.int64) << 28) | (surface.astype(np.int64) << 25) | vertex
    return codes.astype(np.int32), (sky + surface) > 0
