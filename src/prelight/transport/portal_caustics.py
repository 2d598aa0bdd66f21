"""Caustics of light that comes in through portals: one map of photons for whatever is outside.

Photons leave the panes on both sides, with the cosine there; those behind which something stands, which for one of the
sides is the room itself, come from nowhere and are dropped. What glass and mirrors send on of them is kept by the cell
of the cube map that each came from, as direct light is. Light that bounced before is dim and smooth: harmonics do.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32, Int32, Int64
from ..bases import cube_map, spherical_harmonics
from ..rays.mitsuba import Occluders
from ..rays.offset import ray_offset
from ..scene.geometry import Scene
from .photon_density import LitSurface, PhotonDensity
from .photon_mapping import PhotonMap
from .photon_sources import TriangleSource
from .photon_tracing import BOUNCED_CAUSTIC, CAUSTIC, Photons

BOUNCED_SHARE = 0.25  # of the photons, beside them, for light that bounced before
_NEAREST = 1024  # of all directions together
_WIDEST_OF_BOUNCED = 12.0  # edges of the mesh: few such photons arrive, and what they bring is smooth
_STEPS = 255  # of a byte
_STAGE = 73  # keeps these random numbers apart from those of other stages


@dataclass(frozen=True)
class CausticRows:
    """What some receivers have through each pane and of each colour: samples of rows over the cells of a cube map.

    Row ((receiver · panes) + pane) · colours + colour has samples ``starts`` up to the next start.
    """

    starts: Int64[np.ndarray, "rows_and_one"]
    cell: Int32[np.ndarray, "samples"]
    weight: Float32[np.ndarray, "samples"]


class PortalCaustics:
    """What glass and mirrors in a room send of its portals' light.

    Parameters
    ----------
    scene, occluders
        The room without the portals' glass, and the renderer's scene of the same triangles. With what bounces go, the
        gathering operator is to be traced on ``specular.without_specular(scene)``.
    corners, pane_of
        ``(T, 3, 3)`` triangles of the portals, either way round, and the pane that each is part of.
    photons
        Of all panes together; a quarter as many besides for what bounced before.
    glass
        The renderer's scene of the panes, where one may stand behind another: light then counts for the outer one.

    Attributes
    ----------
    is_dark
        There is no glass or mirror, or no light meets it: nothing is sent.
    panes, colours
        Colours are 1 where all that sends is grey, else 3.
    """

    def __init__(
        self,
        scene: Scene,
        occluders: Occluders,
        corners: Float32[np.ndarray, "triangles 3 3"],
        pane_of: Int32[np.ndarray, "triangles"],
        *,
        photons: int,
        glass: Any = None,
        seed: int = 0,
    ) -> None:
        both = np.ascontiguousarray(np.concatenate([corners, corners[:, ::-1]]), np.float32)
        source = TriangleSource(
            both,
            np.ones((len(both), 3), np.float32),
            np.tile(pane_of, 2).astype(np.int32),
            beyond=True,
            is_placed=False,
        )
        self.panes, self._occluders, self._glass, self._seed = source.lights, occluders, glass, seed
        straight = PhotonMap(scene, occluders, source, ways=CAUSTIC, seed=seed)
        straight.more(photons)
        after = PhotonMap(scene, occluders, source, ways=BOUNCED_CAUSTIC, seed=seed)
        after.more(max(1, int(photons * BOUNCED_SHARE)))
        self.emitted, self.colours = straight.emitted + after.emitted, 1
        self._photons, self._after = (
            self._counted(m.photons) if m.emitted else None for m in (straight, after)
        )
        self.is_dark = self._photons is None or not len(self._photons)
        self._vertices, surface = len(scene.positions), LitSurface(scene)
        if self._photons is not None and len(self._photons):
            self.colours = 1 if (self._photons.power == self._photons.power[:, :1]).all() else 3
            self._density = PhotonDensity(surface, self._photons, nearest=_NEAREST)
        if self._after is not None and len(self._after):
            self._wide = PhotonDensity(surface, self._after, widest=_WIDEST_OF_BOUNCED)

    @property
    def noise(self) -> float:
        """RMS, of the caustics of even light through all portals."""
        if self.is_dark:
            return 0.0
        assert self._photons is not None  # not dark
        light, squares = self._density.sums(self._photons.power.sum(axis=1, keepdims=True))
        whole = float(np.square(light, dtype=np.float64).sum())
        return float(np.sqrt(squares.sum(dtype=np.float64) / whole)) if whole > 0 else 0.0

    def rows(self, receivers: Int64[np.ndarray, "n"], resolution: int, *, number: int) -> CausticRows:
        """Of some vertices; ``number`` makes the chance its own by which small samples are rounded.

        No sample is finer than a byte's step of direct light, nor of its row's largest: rounded by chance they keep the
        mean, and dust far from glass becomes few samples.
        """
        panes, colours, cells = self.panes, self.colours, 6 * resolution**2
        count = len(receivers) * panes * colours
        if self.is_dark:
            return CausticRows(np.zeros(count + 1, np.int64), np.zeros(0, np.int32), np.zeros(0, np.float32))
        assert self._photons is not None  # not dark
        starts, which, kernel = self._density.pairs(receivers)
        row = np.repeat(np.arange(len(receivers)), np.diff(starts)) * panes + self._photons.light[which]
        cell = _cells_of(-self._photons.direction[which], resolution)
        key, place = np.unique(row * cells + cell, return_inverse=True)
        row, cell = key // cells, (key % cells).astype(np.int32)
        power = (
            self._photons.power[which, :colours]
            * (kernel / np.float32(np.pi * self._photons.emitted))[:, None]
        )
        values = np.stack(
            [np.bincount(place.ravel(), power[:, c], minlength=len(key)) for c in range(colours)]
        )
        values = self._rounded(values, row, cell, resolution, number=number)
        colour, chosen = np.nonzero(values)
        row = row[chosen] * colours + colour
        order = np.argsort(row, kind="stable")
        lengths = np.bincount(row, minlength=count)
        return CausticRows(
            np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64),
            cell[chosen[order]],
            values[colour[order], chosen[order]].astype(np.float32),
        )

    def _rounded(
        self, values: np.ndarray, row: np.ndarray, cell: np.ndarray, resolution: int, *, number: int
    ) -> np.ndarray:
        if not values.size:
            return values
        firsts = np.flatnonzero(np.diff(row, prepend=-1))
        most = np.repeat(
            np.maximum.reduceat(values.max(axis=0), firsts), np.diff(np.append(firsts, len(row)))
        )
        straight = cube_map.solid_angles(resolution).ravel()[cell % resolution**2] / np.pi
        step = np.maximum(most, straight) / _STEPS
        rng = np.random.default_rng(np.random.SeedSequence([self._seed, _STAGE, number]))
        return np.where(values < step, step * (rng.random(values.shape) < values / step), values)

    def bounced_harmonics(
        self,
        panes: Int32[np.ndarray, "some"],
        tints: Float32[np.ndarray, "some 3"],
        functions: slice,
        *,
        order: int,
    ) -> Float32[np.ndarray, "vertices functions 3"]:
        """Irradiance / π at vertices, before albedo, of what bounced and then came through glass or off a mirror.

        Of some harmonics up to ``order`` of the radiance beyond some panes of these transmittances, as functions of the
        direction toward the outside. All photons serve every one of them.
        """
        after, count = self._after, len(range(*functions.indices(spherical_harmonics.count(order))))
        if after is None or not len(after):
            return np.zeros((self._vertices, count, 3), np.float32)
        factor = np.zeros((self.panes, 3), np.float32)
        factor[panes] = tints
        power = after.power * factor[after.light] / np.float32(np.pi * after.emitted)
        values = spherical_harmonics.evaluate(order, -after.direction)[:, functions].astype(np.float32)
        light, _ = self._wide.sums((values[:, :, None] * power[:, None]).reshape(len(after), -1))
        return light.reshape(self._vertices, count, 3)

    def _counted(self, photons: Photons) -> Photons:
        """Without those that came in through another pane before."""
        if self._glass is None or not len(photons):
            return photons
        mi = self._occluders.mi
        start = photons.origin - ray_offset(self._occluders.positions) * photons.direction
        o, d = (
            kind(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in values.T))
            for kind, values in ((mi.Point3f, start), (mi.Vector3f, -photons.direction))
        )
        return photons.taken(np.flatnonzero(~np.array(self._glass.ray_test(mi.Ray3f(o, d)))))


def _cells_of(d: Float32[np.ndarray, "n 3"], resolution: int) -> Int64[np.ndarray, "n"]:
    face, u, v = cube_map.face_coordinates(d.astype(np.float64))
    row, column = (
        np.clip(((t + 1) * (resolution / 2)).astype(np.int64), 0, resolution - 1) for t in (v, u)
    )  # fmt: skip
    return (face.astype(np.int64) * resolution + row) * resolution + column
