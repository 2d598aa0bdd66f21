"""Relighting an environment layer (paper, section 5): in full, or only where the light changed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np

from ..arrays import CubeMap, Float32, Float64, Int32, Radiance
from ..bases.cube_map import solid_angles
from ..bases.quadtree import LeafCover
from ..encoding.sparse_tiles import GROUP, PANEL, TILE, TILES, first_tiles, groups_of
from ..errors import DamagedBakeError, InputError
from ..storage.bake import Bake
from .tile_kernels import (
    EVERY,
    cluster_light,
    relight_full,
    relight_local,
    relight_local_alone,
    write_radiance,
)

_LOCAL_SHARE = 0.2  # of the clusters: beyond it a full relight is faster
_TRY_THE_OTHER = 128  # local updates
_SMALL = 100_000  # bytes: below, what an update costs does not depend on them
_REFRESH_AFTER = 4096  # local updates
_LARGEST_SCALE = np.float32(1 / 255)  # an element is at most 1/π, of a byte's 255 parts
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
        receivers, clusters = bake.manifest.arrays["scene/positions"].shape[0], record.coefficients
        panels, at = -(-clusters // PANEL), f"layers/{name}"
        self.resolution = _whole_number(bake, record.parameters.get("resolution"))
        self.rectangles: Int32[np.ndarray, "clusters 5"] = _array(
            bake, f"{at}/rectangles", "int32", [clusters, 5]
        )
        self.scales: Float32[np.ndarray, "clusters"] = _array(bake, f"{at}/scales", "float32", [clusters])
        self.order: Int32[np.ndarray, "receivers"] = _array(bake, f"{at}/order", "int32", [receivers])
        present = _array(bake, f"{at}/present", "uint16", [panels, groups_of(receivers)])
        self.present = np.ascontiguousarray(present)
        self.first = first_tiles(self.present).astype(np.int32)
        counts = np.maximum(np.bitwise_count(self.present).sum(axis=1, dtype=np.int64), 1)
        self.tiles = [
            _array(bake, f"{at}/tiles/{p:05d}", "uint8", [int(count), TILE, GROUP])
            for p, count in enumerate(counts)
        ]
        self.addresses = np.array([tiles.ctypes.data for tiles in self.tiles], np.int64)
        bits = self.present[:, :, None] >> np.arange(TILES, dtype=np.uint16) & 1
        self.groups_of_column = bits.sum(axis=1, dtype=np.int64).ravel()  # that have a tile there
        self.tree = LeafCover(self.rectangles, self.resolution)
        self._check(bake, record.basis_lights)

    def _check(self, bake: Bake, basis_lights: int) -> None:
        """A kernel follows these numbers to memory: none may point outside. Raises DamagedBakeError."""
        if not np.array_equal(np.sort(self.order), np.arange(len(self.order))):
            raise DamagedBakeError(bake.path, "the order of receivers in its environment layer is not one")
        if not ((self.scales >= 0) & (self.scales <= _LARGEST_SCALE)).all():
            raise DamagedBakeError(
                bake.path, "a scale in its environment layer is not a number from 0 to 1/255"
            )
        if (
            basis_lights != 6 * self.resolution**2
            or not self._leaves_are_inside()
            or not self.tree.is_whole_tree
        ):
            what = f"the rectangles of its environment layer are no quadtree of 6·{self.resolution}² texels"
            raise DamagedBakeError(bake.path, what)

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
    """A layer, the light that falls on it now, and the irradiance / π that follows (``_sums``, storage order)."""

    def __init__(self, layer: EnvironmentLayer, albedo: Float32[np.ndarray, "receivers 3"]) -> None:
        self.layer = layer
        self._albedo = np.ascontiguousarray(albedo)
        R, clusters = layer.resolution, len(layer.rectangles)
        self._cube = np.zeros((6, R, R, 3), np.float32)
        self._light: Float64[np.ndarray, "clusters 3"] = np.zeros((clusters, 3))
        self._sums = np.zeros((layer.present.shape[1], 3 * GROUP))
        self._threads = numba.get_num_threads()
        self._scratch = np.zeros((self._threads, 3 * GROUP), np.float32)
        self._brightest = 0.0
        self._since_full = 0
        self._pace = _Pace()
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
        radiance = np.empty_like(self._albedo)
        write_radiance(self.layer.order, self._albedo, self._sums, radiance)
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
            self._sums,
        )
        self._since_full, self._brightest = 0, float(self._light.sum())
        self.last = Update("full", (time.perf_counter() - started) * 1e3, layer.bytes, changed)
        return self.last

    def _local(self, started: float, clusters: np.ndarray, change: np.ndarray) -> None:
        layer = self.layer
        began = time.perf_counter()
        tile, within = np.divmod(clusters, TILE)
        start = np.flatnonzero(np.diff(tile, prepend=-1))
        column, start = tile[start], np.append(start, len(clusters))
        read = int((layer.groups_of_column[column] * np.diff(start)).sum()) * GROUP
        kernel = self._pace.choose()
        kernel(
            layer.addresses,
            layer.first,
            layer.present,
            column,
            start,
            within.astype(np.int32),
            change * layer.scales[clusters, None],
            self._sums,
            self._threads,
        )
        self._pace.note(kernel, (time.perf_counter() - began) / max(read, _SMALL))
        self._since_full += 1
        self.last = Update("local", (time.perf_counter() - started) * 1e3, read, len(clusters))


class _Pace:
    """Which local kernel is faster here and now: both do the same, one with all threads, one with its own."""

    def __init__(self) -> None:
        self._seconds: dict[Callable, float] = {relight_local: 0.0, relight_local_alone: 0.0}
        self._count = 0

    def choose(self) -> Callable:
        """The faster one of late; now and then the other, in case that has changed."""
        self._count += 1
        faster, slower = sorted(self._seconds, key=self._seconds.__getitem__)
        return slower if self._count % _TRY_THE_OTHER == 0 else faster

    def note(self, kernel: Callable, seconds_per_byte: float) -> None:
        before = self._seconds[kernel]
        self._seconds[kernel] = 0.5 * (before + seconds_per_byte) if before else seconds_per_byte


def _radiances(values: np.ndarray) -> np.ndarray:
    values = np.ascontiguousarray(values, np.float32)
    if not np.isfinite(values).all() or (values < 0).any():
        raise InputError("radiance", "has values that are negative or not finite; expected numbers from 0 up")
    return values


def _array(bake: Bake, name: str, dtype: str, shape: list[int]) -> np.ndarray:
    """Raises DamagedBakeError, before anything is read, for an array of another type or shape."""
    spec = bake.manifest.arrays.get(name)
    if spec is None or spec.dtype != dtype or spec.shape != shape:
        found = "is missing" if spec is None else f"is {spec.dtype} {spec.shape}"
        raise DamagedBakeError(bake.path, f"array {name} {found}, expected {dtype} {shape}")
    return bake.array(name)


def _whole_number(bake: Bake, value: object) -> int:
    if not isinstance(value, int) or not 1 <= value <= 4096:
        raise DamagedBakeError(bake.path, f"its resolution is {value!r}")
    return value
