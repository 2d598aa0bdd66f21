"""Reading an environment layer: its zones, memory-mapped, and every number checked that a kernel follows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit, types

from ..arrays import Float32, Int32, Int64, Positions, UInt16
from ..camera import Camera
from ..encoding.sparse_tiles import GROUP, PANEL, TILE, TILES, first_tiles, panels_of_parcel
from ..errors import DamagedBakeError, InputError
from ..storage.bake import Bake
from ..storage.manifest import LayerRecord
from .takers import found_layer

LARGEST_RESOLUTION = 4096
# An element of irradiance/π is at most 1/π, of a byte's 255 parts; of a mirror's radiance, far more.
_LARGEST_SCALE = {1: np.float32(1 / 255), 3: np.float32(1e12)}
_PARTS = ("tiles", "present", "rectangles", "scales")


class Tiles(NamedTuple):
    """What a kernel needs to find a tile; checked, and nothing in it is ever written."""

    zones: Int64[np.ndarray, "zones 5"]  # first group, groups, channels, first panel, panels
    addresses: Int64[np.ndarray, "panels"]  # where each panel's tiles begin
    words: Int64[np.ndarray, "panels"]  # where its groups begin in the two below
    first: Int32[np.ndarray, "words"]  # a group's first tile, counted from its panel's
    present: UInt16[np.ndarray, "words"]  # bit s: it has a tile for clusters 16s … 16s + 15 of the panel


class EnvironmentLayer:
    """The transport of a layer, ready for its kernels.

    Clusters are numbered through all zones, from a multiple of 256 in each: ``slots``. Groups of 32 receivers
    are numbered through all zones too.

    Parameters
    ----------
    name
        Of the layer; without it the one named environment, or the first of its kind.

    Raises
    ------
    InputError
        There is no such layer.
    DamagedBakeError
        A number in it is not what it must be; says which.
    """

    def __init__(self, bake: Bake, name: str | None = None) -> None:
        self.name, record = found_layer(bake, name)
        self._bake, self._at = bake, f"layers/{self.name}"
        self.resolution: int = _whole_number(
            bake, "resolution", record.parameters.get("resolution"), LARGEST_RESOLUTION
        )
        if record.basis_lights != 6 * self.resolution**2:
            raise DamagedBakeError(bake.path, f"its basis lights are not 6·{self.resolution}² texels")
        self.picture_size = _picture_size(bake, record)  # (width, height) of a pixel layer
        self.eye = _eye(bake, record)
        vertices = bake.manifest.arrays["scene/positions"].shape[0]
        self.rows: int = self.picture_size[0] * self.picture_size[1] if self.picture_size else vertices
        zones = self._read_zones(record)
        self.order = self._read_order(zones)
        self.channels_of_group = np.repeat(zones[:, 1], zones[:, 0]).astype(np.uint8)
        self.groups = len(self.channels_of_group)
        self._read_parcels(zones)
        self._origins = self._read_origins()
        self.bytes = sum(tiles.nbytes for tiles in self._kept) + self.tiles.present.nbytes

        present, words = self.tiles.present, self.tiles.words
        counts = [np.add.reduceat(present >> s & 1, words, dtype=np.int64) for s in range(TILES)]
        self._tiles_of_column = np.stack(counts, axis=1).ravel()  # how many groups have a tile there

    @property
    def origins(self) -> Positions:
        """(vertices, 3) where rays of vertices begin, before they are lifted."""
        return self._bake.receivers.positions if self._origins is None else self._origins

    def _read_origins(self) -> Positions | None:
        arrays = self._bake.manifest.arrays
        if f"{self._at}/origins" not in arrays:
            return None
        origins = self._array("origins", "float32", arrays["scene/positions"].shape)
        if not np.isfinite(origins).all():
            raise self._damaged("its origins are not finite")
        return origins

    def bytes_in(self, column: np.ndarray, start: np.ndarray) -> int:
        """Bytes of tiles that changes read, listed as by ``gather_changes``."""
        return int(self._tiles_of_column[column] @ (start[1:] - start[:-1])) * GROUP

    def even_shares(self, threads: int) -> Int64[np.ndarray, "threads+1"]:
        """Groups for each thread, so that all have as many bytes of tiles; thread t has shares[t] … shares[t+1]."""
        size = np.ones(self.groups, np.int64)  # to write its sums is work too
        counts, word = np.bitwise_count(self.tiles.present).astype(np.int64), 0
        for first, groups, channels, _, panels in self.tiles.zones.tolist():
            of_zone = counts[word : word + panels * channels * groups].reshape(-1, groups)
            size[first : first + groups] += of_zone.sum(axis=0)
            word += of_zone.size
        done = np.cumsum(size)
        shares = np.searchsorted(done, done[-1] * np.arange(threads + 1) // threads)
        shares[-1] = self.groups
        shares.flags.writeable = False
        return shares.astype(np.int64, copy=False)

    def _damaged(self, what: str) -> DamagedBakeError:
        return DamagedBakeError(self._bake.path, f"{what} (layer {self.name})")

    def _array(self, name: str, dtype: str, shape: list[int]) -> np.ndarray:
        """Raises DamagedBakeError, before anything is read, for an array of another type or shape."""
        spec = self._bake.manifest.arrays.get(f"{self._at}/{name}")
        if spec is None or spec.dtype != dtype or spec.shape != shape:
            found = "is missing" if spec is None else f"is {spec.dtype} {spec.shape}"
            raise DamagedBakeError(
                self._bake.path, f"array {self._at}/{name} {found}, expected {dtype} {shape}"
            )
        return self._bake.array(f"{self._at}/{name}")

    def _read_zones(self, record: LayerRecord) -> Int64[np.ndarray, "zones 4"]:
        spec = self._bake.manifest.arrays.get(f"{self._at}/zones")
        count = spec.shape[0] if spec is not None and spec.shape[0] <= self.rows else 1
        zones = self._array("zones", "int32", [count, 4]).astype(np.int64)
        groups, channels, clusters, parcels = zones.T
        for wrong, what in (
            ((groups < 1) | (groups > self.rows), "groups"),
            ((channels != 1) & (channels != 3), "channels"),
            ((clusters < 1) | (clusters > record.basis_lights), "clusters"),
            (parcels != _parcels(np.maximum(groups, 1), np.maximum(channels, 1), clusters), "parcels"),
        ):
            if wrong.any():
                z = int(wrong.argmax())
                raise self._damaged(
                    f"zone {z} says {zones[z].tolist()} groups, channels, clusters, parcels: wrong {what}"
                )
        if clusters.sum() != record.coefficients:
            raise self._damaged(f"its zones have {clusters.sum()} clusters, not {record.coefficients}")
        if self.picture_size and (channels != 3).any():
            raise self._damaged("a zone of its pixels has one channel, expected 3")
        return zones

    def _read_order(self, zones: np.ndarray) -> Int32[np.ndarray, "stored"]:
        """Rows in storage order, −1 where a group is filled up."""
        order = self._array("order", "int32", [GROUP * int(zones[:, 0].sum())])
        rows = order[order != -1]
        if len(rows) != self.rows or not np.array_equal(np.sort(rows), np.arange(self.rows)):
            raise self._damaged(f"its order does not name each of {self.rows} receivers once")
        return order

    def _read_parcels(self, zones: np.ndarray) -> None:
        """Sets ``tiles``, ``rectangles`` (clusters, 5), ``starts`` (zones + 1) of them, ``slots`` and ``scales``."""
        addresses, words, first, present, rectangles, scales, slots = [], [], [], [], [], [], []
        self._kept: list[np.ndarray] = []  # the maps that addresses point into
        q = panel = word = 0
        for groups, channels, clusters, _ in zones.tolist():
            size = int(panels_of_parcel(groups, channels)) * PANEL
            for start in range(0, clusters, size):
                count = min(size, clusters - start)
                panels = -(-count // PANEL)
                bits = self._array(f"present/{q:05d}", "uint16", [panels, channels * groups])
                there = np.bitwise_count(bits).sum(axis=1, dtype=np.int64)
                tiles = self._array(f"tiles/{q:05d}", "uint8", [max(int(there.sum()), 1), TILE, GROUP])
                self._kept.append(tiles)
                addresses.append(tiles.ctypes.data + (np.cumsum(there) - there) * (TILE * GROUP))
                words.append(word + np.arange(panels) * (channels * groups))
                present.append(bits.ravel())
                first.append(first_tiles(bits).ravel())
                rectangles.append(self._array(f"rectangles/{q:05d}", "int32", [count, 5]))
                scales.append(self._read_scales(q, count, channels))
                slots.append(panel * PANEL + np.arange(count))
                q, panel, word = q + 1, panel + panels, word + bits.size
        panels = -(-zones[:, 2] // PANEL)
        table = [
            np.cumsum(zones[:, 0]) - zones[:, 0],
            zones[:, 0],
            zones[:, 1],
            np.cumsum(panels) - panels,
            panels,
        ]
        self.tiles = Tiles(
            np.ascontiguousarray(np.stack(table, axis=1), np.int64),
            np.concatenate(addresses).astype(np.int64),
            np.concatenate(words).astype(np.int64),
            np.concatenate(first).astype(np.int32),
            np.concatenate(present).astype(np.uint16),
        )
        for table in self.tiles:
            table.flags.writeable = False
        self.slots: Int64[np.ndarray, "clusters"] = np.concatenate(slots).astype(np.int64)
        self.scales: Float32[np.ndarray, "slots 3"] = np.zeros((panel * PANEL, 3), np.float32)
        self.scales[self.slots] = np.concatenate(scales)
        self.rectangles: Int32[np.ndarray, "clusters 5"] = np.concatenate(rectangles)
        self.starts = np.append(0, np.cumsum(zones[:, 2])).astype(np.int64)
        wrong = first_broken_tree(self.rectangles, self.starts, self.resolution)
        if wrong >= 0:
            raise self._damaged(
                f"the rectangles of zone {wrong} are no quadtree of 6·{self.resolution}² texels"
            )

    def _read_scales(self, q: int, count: int, channels: int) -> np.ndarray:
        scales = self._array(f"scales/{q:05d}", "float32", [count, channels])
        if not ((scales >= 0) & (scales <= _LARGEST_SCALE[channels])).all():
            bound = "1/255" if channels == 1 else f"{_LARGEST_SCALE[channels]:.0e}"
            raise self._damaged(f"a scale in {self._at}/scales/{q:05d} is not a number from 0 to {bound}")
        return np.broadcast_to(scales, (count, 3))


@njit(
    types.int64(types.Array(types.int32, 2, "C"), types.Array(types.int64, 1, "C"), types.int64), cache=True
)
def first_broken_tree(rectangles, starts, resolution):
    """The first zone whose rectangles are not all leaves of six quadtrees in Z-order; −1 if there is none.

    A walk that expects each node in turn: what fits none of them is found within the depth of the tree.
    """
    stack = np.empty((64, 4), np.int64)
    for z in range(len(starts) - 1):
        k, end = starts[z], starts[z + 1]
        for face in range(6):
            stack[0] = (0, 0, resolution, resolution)
            depth = 1
            while depth:
                depth -= 1
                row, column, height, width = stack[depth]
                if k == end or rectangles[k, 0] != face:
                    return z
                leaf = rectangles[k]
                if leaf[1] == row and leaf[2] == column and leaf[3] == height and leaf[4] == width:
                    k += 1
                    continue
                upper, left = (height + 1) // 2, (width + 1) // 2
                if height * width == 1 or depth + 4 > len(stack):
                    return z
                for quarter in range(3, -1, -1):  # the last one first, so that they are popped in Z-order
                    h = height - upper if quarter // 2 else upper
                    w = width - left if quarter % 2 else left
                    if h > 0 and w > 0:
                        stack[depth] = (row + quarter // 2 * upper, column + quarter % 2 * left, h, w)
                        depth += 1
        if k != end:
            return z
    return -1


def _parcels(groups: np.ndarray, channels: np.ndarray, clusters: np.ndarray) -> np.ndarray:
    panels = -(-clusters // PANEL)
    return -(-panels // panels_of_parcel(groups, channels))


def _whole_number(bake: Bake, name: str, value: object, most: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 1 <= value <= most:
        raise DamagedBakeError(bake.path, f"its {name} is {value!r}, expected 1 to {most}")
    return value


def _picture_size(bake: Bake, record: LayerRecord) -> tuple[int, int] | None:
    kind = record.parameters.get("receivers")
    if kind == "vertices":
        return None
    if kind != "pixels":
        raise DamagedBakeError(bake.path, f"its receivers are {kind!r}, expected vertices or pixels")
    if record.camera is None:
        raise DamagedBakeError(bake.path, "its receivers are pixels, of no camera")
    width, height = (_whole_number(bake, n, record.parameters.get(n), 16384) for n in ("width", "height"))
    return width, height


def _eye(bake: Bake, record: LayerRecord) -> Camera | None:
    if record.camera is None:
        return None
    try:
        return Camera.from_dict(record.camera.view)
    except InputError as error:
        raise DamagedBakeError(bake.path, f"the eye of its layer is wrong: {error.reason}") from None
