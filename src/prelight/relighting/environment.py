"""Relighting an environment layer (paper, section 5): in full, or only where the light changed."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass

import numba
import numpy as np

from ..arrays import CubeMap, Float32, Radiance
from ..encoding.sparse_tiles import GROUP
from ..errors import InputError
from ..lighting.disc import Disc
from ..lighting.regions import Cap
from .bounced import BouncedLight
from .bounced_layer import BouncedLayer
from .disc_lights import DiscLights
from .layer import EnvironmentLayer
from .light_tree import LightTree
from .pace import Pace
from .tile_kernels import (
    EVERY,
    relight_full,
    relight_local,
    write_radiance,
)

_LOCAL_SHARE = 0.2  # of the clusters: beyond it a full relight is faster
_REFRESH_AFTER = 4096  # local updates
_REFRESH_BELOW = 0.03  # of the brightest light since the last full relight, which is right to 2e-8 of that
MOST_DISCS = 32  # whose radiance is kept apart

_INFINITY = np.float32(np.inf).view(np.uint32)


@dataclass(frozen=True)
class Update:
    """What the last change of light took."""

    kind: str  # "full", "local" or "none"
    milliseconds: float
    bytes_read: int
    clusters: int  # changed

    def after(self, other: Update) -> Update:
        """Both in one."""
        kind = next((k for k in ("full", "local") if k in (self.kind, other.kind)), "none")
        return Update(
            kind,
            self.milliseconds + other.milliseconds,
            self.bytes_read + other.bytes_read,
            self.clusters + other.clusters,
        )


@dataclass
class _Ledger:
    """How much light the cube has and had: when sums are to be made anew."""

    total: float = 0.0
    brightest: float = 0.0
    since_full: int = 0

    def is_due(self) -> bool:
        self.brightest = max(self.brightest, self.total)
        return self.since_full >= _REFRESH_AFTER or self.total < _REFRESH_BELOW * self.brightest


class EnvironmentRelighter:
    """A layer, the light that falls on it now, and what follows from it (``_sums``, storage order).

    The light is a cube of texels and, on top of it, soft discs (``disc_lights``), which ``_sums`` does not have.

    Parameters
    ----------
    albedo
        (rows, 3), multiplies irradiance / π where the layer keeps that; None for a layer of pixels.
    bounced
        The layer's bounced part; direct light only without it.
    """

    def __init__(
        self,
        layer: EnvironmentLayer,
        albedo: Float32[np.ndarray, "receivers 3"] | None = None,
        bounced: BouncedLayer | None = None,
    ) -> None:
        self.layer = layer
        self._albedo = np.ones((1, 3), np.float32) if albedo is None else np.ascontiguousarray(albedo)
        if albedo is None and (layer.channels_of_group == 1).any():
            raise InputError("albedo", "None, expected (rows, 3): this layer keeps irradiance")
        R = layer.resolution
        self._cube = np.zeros((6, R, R, 3), np.float32)
        self._tree = LightTree(layer, None if bounced is None else bounced.cells)
        self._discs = DiscLights(layer, self._tree)
        self._sums = np.zeros((layer.groups, 3 * GROUP))
        self._shares = layer.even_shares(numba.get_num_threads())
        self._scratch = np.zeros((len(self._shares) - 1, 3 * GROUP), np.float32)
        self._ledger, self._local, self._write = _Ledger(), Pace(relight_local), Pace(write_radiance)
        self.last = Update("none", 0.0, 0, 0)
        self.bounced: BouncedLight | None = None
        if bounced is not None:
            self.bounced = BouncedLight(bounced, layer, self._tree.cell_nodes, len(self._tree))
        self._both = np.empty_like(self._sums)

    @property
    def cube(self) -> CubeMap:
        """The texels of the environment now, (6, R, R, 3) radiance, without its discs; read-only."""
        view = self._cube.view()
        view.flags.writeable = False
        return view

    @property
    def radiance(self) -> Radiance:
        """(rows, 3), in receiver order; a copy."""
        return self._written(self._albedo)

    @property
    def irradiance(self) -> Radiance:
        """The same without the albedo: irradiance / π, where the layer keeps that; a copy."""
        return self._written(np.ones_like(self._albedo))

    def _written(self, albedo: np.ndarray) -> Radiance:
        layer, radiance = self.layer, np.empty((self.layer.rows, 3), np.float32)
        size = self._sums.nbytes + self._discs.bytes + radiance.nbytes
        discs, sums = self._discs.shine(), self._sums
        if self.bounced is not None:
            self.settle()
            sums = np.add(sums, self.bounced.sums, out=self._both)
        self._write(size, layer.order, albedo, sums, *discs, radiance, self._shares)
        return radiance

    def settle(self) -> None:
        """Let the light that there is now bounce; ``last`` then tells that too. Reading radiance does it by itself."""
        if self.bounced is None:
            return
        started = time.perf_counter()
        if self.bounced.follow(self.bounced.light_of(self._tree.light, self._discs.falling())):
            took, read = (time.perf_counter() - started) * 1e3, self.bounced.part.bytes
            self.last = Update("none", took, read, 0).after(self.last)

    def set_cube(self, cube: CubeMap) -> Update:
        """Replace all texels (copied); only clusters whose light changes are summed again. Discs stay.

        Raises InputError for another shape, or radiance that is negative or not finite.
        """
        R = self.layer.resolution
        if cube.shape != (6, R, R, 3):
            raise InputError("environment", f"a cube map of shape {cube.shape}, expected (6, {R}, {R}, 3)")
        cube = _radiances(cube)
        started = time.perf_counter()
        np.copyto(self._cube, cube)
        return self._follow(*self._tree.light_all(self._cube), started)

    def edit(self, face: int, rows: slice, columns: slice, radiance: np.ndarray) -> Update:
        """Replace a rectangle of texels (section 5.2).

        Parameters
        ----------
        face
            0 to 5, in the order of ``bases.cube_map``.
        rows, columns
            Texels, start and stop within 0 to R.
        radiance
            One colour ``(3,)`` or texels ``(rows, columns, 3)``; finite, not negative.
        """
        started = time.perf_counter()
        R = self.layer.resolution
        if face not in range(6):
            raise InputError("face", f"{face!r}, expected 0 to 5")
        top, bottom = _ends("rows", rows, R)
        left, right = _ends("columns", columns, R)
        values = _radiances(np.asarray(radiance, np.float32))
        shape = (bottom - top, right - left, 3)
        if values.shape not in (shape, (3,)):
            raise InputError("radiance", f"shape {values.shape}, expected (3,) or {shape}")
        self._cube[face, top:bottom, left:right] = values
        return self._follow(*self._tree.light_part(self._cube, face, (top, left, bottom, right)), started)

    def set_discs(self, discs: Iterable[Disc]) -> Update:
        """Light these discs on top of the cube, and no others; at most 32 places, raises InputError beyond.

        A disc of a place where one is already only changes its colour; others move from where discs have gone.
        """
        started = time.perf_counter()
        wanted: dict[Cap, np.ndarray] = {}
        for disc in discs:
            wanted[disc.region] = wanted.get(disc.region, 0.0) + np.array(disc.radiance)
        if len(wanted) > MOST_DISCS:
            raise InputError("discs", f"{len(wanted)} of them, expected at most {MOST_DISCS}")
        clusters, read = self._discs.change(wanted, self._shares)
        kind = "local" if clusters else "none"
        self.last = Update(kind, (time.perf_counter() - started) * 1e3, read, clusters)
        return self.last

    def refresh(self) -> Update:
        """Relight in full: sums made anew, whatever came before."""
        return self._full(time.perf_counter(), len(self.layer.rectangles))

    def _follow(self, nodes: np.ndarray, change: np.ndarray, started: float) -> Update:
        """Relight after nodes of the tree have changed their light."""
        clusters = self._tree.clusters_of(nodes)
        self._ledger.total += self._tree.total(nodes, change)
        if clusters == 0:
            self.last = Update("none", (time.perf_counter() - started) * 1e3, 0, 0)
        elif self._ledger.is_due() or clusters > _LOCAL_SHARE * len(self.layer.rectangles):
            self._full(started, clusters)
        else:
            *changes, weights = self._tree.gather((nodes, change))
            read = self.layer.bytes_in(changes[1], changes[2])
            self._local(read, self.layer.tiles, tuple(changes), weights, self._sums, self._shares)
            self._ledger.since_full += 1
            self.last = Update("local", (time.perf_counter() - started) * 1e3, read, clusters)
        return self.last

    def _full(self, started: float, changed: int) -> Update:
        weights, lit = self._tree.weigh()
        relight_full(self.layer.tiles, lit, weights, EVERY, self._scratch, self._sums, self._shares)
        ledger = self._ledger
        ledger.total = ledger.brightest = self._tree.total()
        ledger.since_full = 0
        self.last = Update("full", (time.perf_counter() - started) * 1e3, self.layer.bytes, changed)
        return self.last


def _ends(name: str, part: slice, resolution: int) -> tuple[int, int]:
    start, stop = part.start or 0, resolution if part.stop is None else part.stop
    if part.step not in (None, 1) or not 0 <= start < stop <= resolution:
        raise InputError(name, f"{part}, expected slice(start, stop) within 0 to {resolution}")
    return start, stop


def _radiances(values: np.ndarray) -> np.ndarray:
    values = np.ascontiguousarray(values, np.float32)
    # One quick pass: as whole numbers, the bits of what is negative or no number are above those of infinity.
    suspect = values.size and values.view(np.uint32).max() >= _INFINITY  # −0 too, which is no harm
    if suspect and not ((values >= 0).all() and np.isfinite(values).all()):
        raise InputError("radiance", "has values that are negative or not finite; expected numbers from 0 up")
    return values
