"""Relighting an environment layer (paper, section 5): in full, or only where the light changed."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numba
import numpy as np

from ..arrays import CubeMap, Float32, Float64, Int32, Radiance
from ..bases.cube_map import solid_angles
from ..bases.quadtree import LeafCover
from ..encoding.sparse_tiles import GROUP, PANEL, TILE, TILES, first_tiles, groups_of
from ..errors import DamagedBakeError, InputError
from ..storage.bake import Bake
from .tile_kernels import EVERY, cluster_light, in_receiver_order, relight_full, relight_local

_LOCAL_SHARE = 0.2  # of the clusters: beyond it a full relight is faster
_REFRESH_AFTER = 4096  # local updates
_REFRESH_BELOW = 1e-3  # of the brightest light since the last full relight


@dataclass(frozen=True)
class Update:
    """What the last change of light took."""

    kind: str  # "full", "local" or "none"
    milliseconds: float
    bytes_read: int
    clusters: int  # changed


class EnvironmentLayer:
    """The transport of a layer, memory-mapped, ready for its kernels."""

    def __init__(self, bake: Bake, name: str = "environment") -> None:
        record = bake.layers.get(name)
        if record is None or record.kind != "environment":
            raise InputError(
                bake.path, f"has no environment layer; its layers are {', '.join(bake.layers) or 'none'}"
            )
        at = f"layers/{name}"
        self.resolution = _whole_number(bake, record.parameters.get("resolution"))
        self.rectangles: Int32[np.ndarray, "clusters 5"] = bake.array(f"{at}/rectangles")
        self.scales: Float32[np.ndarray, "clusters"] = bake.array(f"{at}/scales")
        self.order: Int32[np.ndarray, "receivers"] = bake.array(f"{at}/order")
        self.present = np.ascontiguousarray(bake.array(f"{at}/present"))
        self.first = first_tiles(self.present).astype(np.int32)
        self.tiles = [bake.array(f"{at}/tiles/{p:05d}") for p in range(len(self.present))]
        self.addresses = np.array([tiles.ctypes.data for tiles in self.tiles], np.int64)
        bits = self.present[:, :, None] >> np.arange(TILES, dtype=np.uint16) & 1
        self.groups_of_column = bits.sum(axis=1, dtype=np.int64).ravel()  # that have a tile there
        self.tree = LeafCover(self.rectangles, self.resolution)
        self._check(bake)

    def _check(self, bake: Bake) -> None:
        """A kernel follows these numbers to memory: none may point outside."""
        receivers, clusters = len(bake.receivers), len(self.rectangles)
        sound = (
            len(self.scales) == clusters
            and len(self.present) == -(-clusters // PANEL)
            and self.present.shape[1] == groups_of(receivers)
            and self.order.shape == (receivers,)
            and np.array_equal(np.sort(self.order), np.arange(receivers))
            and np.isfinite(self.scales).all()
            and self._leaves_are_inside()
            and self.tree.is_complete
            and all(
                tiles.shape[1:] == (TILE, GROUP) and len(tiles) >= int(np.bitwise_count(bits).sum())
                for tiles, bits in zip(self.tiles, self.present, strict=True)
            )
        )
        if not sound:
            raise DamagedBakeError(bake.path, "the arrays of its environment layer contradict each other")

    def _leaves_are_inside(self) -> bool:
        face, row, column, height, width = self.rectangles.T.astype(np.int64)
        R = self.resolution
        return bool(
            ((face >= 0) & (face < 6) & (row >= 0) & (column >= 0) & (height > 0) & (width > 0)).all()
            and ((row + height <= R) & (column + width <= R)).all()
        )

    @property
    def bytes(self) -> int:
        """Bytes that a full relight reads."""
        return sum(tiles.nbytes for tiles in self.tiles) + self.present.nbytes


class EnvironmentRelighter:
    """A layer, the light that falls on it now, and the radiance that follows."""

    def __init__(self, layer: EnvironmentLayer, albedo: Float32[np.ndarray, "receivers 3"]) -> None:
        self.layer = layer
        self._albedo = _grouped(albedo, layer.order)
        R, clusters = layer.resolution, len(layer.rectangles)
        self._cube = np.zeros((6, R, R, 3), np.float32)
        self._light: Float64[np.ndarray, "clusters 3"] = np.zeros((clusters, 3))
        self._sums = np.zeros((layer.present.shape[1], 3 * GROUP))
        self._radiance = np.zeros_like(self._albedo)  # in groups, storage order
        self._threads = numba.get_num_threads()
        self._scratch = np.zeros((self._threads, 3 * GROUP), np.float32)
        self._brightest = 0.0
        self._since_full = 0
        self.last = Update("none", 0.0, 0, 0)

    @property
    def cube(self) -> CubeMap:
        """The environment now, (6, R, R, 3) radiance; read-only."""
        view = self._cube.view()
        view.flags.writeable = False
        return view

    @property
    def radiance(self) -> Radiance:
        """(R, 3), in receiver order; a copy."""
        radiance = np.empty((len(self.layer.order), 3), np.float32)
        in_receiver_order(self.layer.order, self._radiance, radiance)
        return radiance

    def set_cube(self, cube: CubeMap) -> Update:
        """Replace the whole environment (copied); only the clusters whose light changes are summed again."""
        R = self.layer.resolution
        if cube.shape != (6, R, R, 3):
            raise InputError("environment", f"a cube map of shape {cube.shape}, expected (6, {R}, {R}, 3)")
        cube = _radiances(cube)
        started = time.perf_counter()
        self._cube[...] = cube
        return self._set_light(np.arange(len(self._light)), started)

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
        R = self.layer.resolution
        for name, part in (("rows", rows), ("columns", columns)):
            if (
                part.step not in (None, 1)
                or not 0 <= (part.start or 0) < (part.stop if part.stop is not None else R) <= R
            ):
                raise InputError(name, f"{part}, expected slice(start, stop) within 0 to {R}")
        if face not in range(6):
            raise InputError("face", f"{face!r}, expected 0 to 5")
        rows = slice(rows.start or 0, R if rows.stop is None else rows.stop)
        columns = slice(columns.start or 0, R if columns.stop is None else columns.stop)
        values = _radiances(np.asarray(radiance, np.float32))
        shape = (rows.stop - rows.start, columns.stop - columns.start, 3)
        if values.shape not in (shape, (3,)):
            raise InputError("radiance", f"shape {values.shape}, expected (3,) or {shape}")
        started = time.perf_counter()
        self._cube[face, rows, columns] = values
        return self._set_light(self.layer.tree.intersecting(face, rows, columns), started)

    def refresh(self) -> Update:
        """Relight in full: sums made anew, whatever came before."""
        return self._full(time.perf_counter(), len(self._light))

    def _set_light(self, clusters: np.ndarray, started: float) -> Update:
        light = np.empty((len(clusters), 3))
        cluster_light(self._cube, solid_angles(self.layer.resolution), self.layer.rectangles, clusters, light)
        change = light - self._light[clusters]
        changed = change.any(axis=1)
        clusters, change = clusters[changed], change[changed]
        self._light[clusters] = light[changed]
        total = float(self._light.sum())
        self._brightest = max(self._brightest, total)
        if not len(clusters):
            self.last = Update("none", (time.perf_counter() - started) * 1e3, 0, 0)
        elif (
            len(clusters) > _LOCAL_SHARE * len(self._light)
            or self._since_full >= _REFRESH_AFTER
            or total < _REFRESH_BELOW * self._brightest
        ):
            self._full(started, len(clusters))
        else:
            self._local(started, clusters, change)
        return self.last

    def _full(self, started: float, changed: int) -> Update:
        layer = self.layer
        weights = np.zeros((len(layer.present) * PANEL, 3), np.float32)
        weights[: len(self._light)] = self._light * layer.scales[:, None]
        lit = weights.reshape(-1, TILES, TILE * 3).any(axis=2) @ (1 << np.arange(TILES))
        relight_full(
            layer.addresses,
            layer.first,
            layer.present,
            lit.astype(np.uint16),
            weights,
            EVERY.copy(),
            self._scratch,
            self._albedo,
            self._sums,
            self._radiance,
        )
        self._since_full, self._brightest = 0, float(self._light.sum())
        self.last = Update("full", (time.perf_counter() - started) * 1e3, layer.bytes, changed)
        return self.last

    def _local(self, started: float, clusters: np.ndarray, change: np.ndarray) -> None:
        layer = self.layer
        tile, within = np.divmod(clusters, TILE)
        start = np.flatnonzero(np.diff(tile, prepend=-1))
        column, start = tile[start], np.append(start, len(clusters))
        relight_local(
            layer.addresses,
            layer.first,
            layer.present,
            column,
            start,
            within.astype(np.int32),
            change * layer.scales[clusters, None],
            self._albedo,
            self._sums,
            self._radiance,
            self._threads,
        )
        self._since_full += 1
        read = int((layer.groups_of_column[column] * np.diff(start)).sum()) * GROUP
        self.last = Update("local", (time.perf_counter() - started) * 1e3, read, len(clusters))


def _grouped(values: np.ndarray, order: np.ndarray) -> np.ndarray:
    """(R, 3) in receiver order as groups (G, 96), filled up with zeros."""
    groups = groups_of(len(order))
    stored = np.zeros((groups * GROUP, 3), np.float32)
    stored[: len(order)] = values[order]
    return np.ascontiguousarray(stored.reshape(groups, GROUP, 3).transpose(0, 2, 1)).reshape(
        groups, 3 * GROUP
    )


def _radiances(values: np.ndarray) -> np.ndarray:
    values = np.ascontiguousarray(values, np.float32)
    if not np.isfinite(values).all() or (values < 0).any():
        raise InputError("radiance", "has values that are negative or not finite; expected numbers from 0 up")
    return values


def _whole_number(bake: Bake, value: object) -> int:
    if not isinstance(value, int) or not 1 <= value <= 4096:
        raise DamagedBakeError(bake.path, f"its resolution is {value!r}")
    return value
