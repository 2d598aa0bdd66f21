"""The one-bounce operator: what light leaves all surfaces, to what of it arrives at every vertex.

Final gathering from a vertex meets triangles; where, and with what barycentric weights, makes a sparse matrix G
whose rows and columns are vertices. It is the same for every light: one gather serves all columns of T.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int32, Int64, Normals, Positions
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from .gap_rays import GapRays, Gaps
from .gathering_kernels import count_entries, fill_entries
from .hemisphere import BACK, NOTHING, HemisphereRays
from .hit_colour import HitColour
from .metal_rays import MetalRays, Metals, MirroredHits, ToSky, with_albedo
from .sparse_product import LightBlocks
from .vantage import vantage_points

RAYS = 1024  # a receiver: 0.7 to 1.2 % RMS noise in a bounce
_RAYS_AT_ONCE = 1 << 22  # of a tile

Report = Callable[[float], None]


@dataclass(frozen=True)
class _Tile:
    """Rows first … first + len(starts) − 1 as a sparse matrix; columns ascend in a row."""

    first: int
    starts: Int64[np.ndarray, "rows_and_one"]
    columns: Int32[np.ndarray, "entries"]
    values: Float32[np.ndarray, "channels entries"]

    @property
    def bytes(self) -> int:
        return self.starts.nbytes + self.columns.nbytes + self.values.nbytes

    @property
    def rows(self) -> slice:
        return slice(self.first, self.first + len(self.starts) - 1)


class Gathering:
    """(Gρ E)_i = mean over cosine-distributed rays from receiver i of albedo × E where they end.

    E is irradiance / π, without albedo, at vertices; at a hit it is interpolated between the vertices of the
    triangle, and the albedo is that of the place, texture included. All surfaces reflect diffusely, with their base
    colour if they are not Lambertian. They do so on the side of their vertices' normals, on which alone light is
    known; a ray that ends on the back of one brings nothing. Made by ``Gathering.trace``.

    Attributes
    ----------
    rows, columns
        How many receivers and vertices; they are the same, in the scene's order, if no others were asked for.
    entries, bytes
        Of the whole operator, kept or not.
    rays, seconds
        Sent, and wall time of tracing them.
    sky
        ``(rows,)`` share of a receiver's rays that meet nothing.
    mirrored_sky
        ``(rows, 3)`` what an even sky of 1 brings by way of rough metal, if rays were to be followed from it.
    backs
        ``(rows,)`` share of a receiver's rays that end on the back of a surface.
    albedo
        ``(V, 3)`` of the vertices.
    to_sky
        The same of each cell of the sky, some rows after the other; light of it is in no entry.
    """

    def __init__(self, scene: Scene, rays: HemisphereRays) -> None:
        self.rows, self.columns = rays.receivers, len(scene.positions)
        self.albedo = scene.albedo
        self.sky, self.backs = np.zeros((2, self.rows), np.float32)
        self.mirrored_sky = np.zeros((self.rows, 3), np.float32)
        self.entries = self.bytes = self.rays = 0
        self.seconds = 0.0
        self._triangles = np.ascontiguousarray(scene.triangles)
        self._scene, self._colour, self._rays = scene, HitColour(scene), rays
        self._channels = 3 if isinstance(rays, MetalRays) else self._colour.channels
        self.to_sky: list[ToSky] = []
        self._kept: dict[int, _Tile] = {}
        self._rows_at_once = max(1, _RAYS_AT_ONCE // rays.rays)
        self._sends = rays.sends

    @classmethod
    def trace(  # noqa: PLR0913 - most of them are seldom given
        cls,
        scene: Scene,
        occluders: Occluders,
        *,
        origins: Positions | None = None,
        normals: Normals | None = None,
        rays: int = RAYS,
        seed: int = 0,
        memory: int | None = None,
        gaps: Gaps | None = None,
        metals: Metals | None = None,
        report: Report | None = None,
    ) -> Gathering:
        """Trace the operator of a scene.

        Parameters
        ----------
        scene, occluders
            Its triangles, and the renderer's scene of the same.
        origins
            ``(R, 3)`` where rays begin, before they are lifted from the surface; if not given, the
            ``vantage.vantage_points`` of the vertices.
        normals
            ``(R, 3)`` unit length, if the receivers are not the vertices.
        rays
            From each receiver; a square number.
        memory
            Bytes the operator may take, half of the machine's if not given. Tiles of rows beyond it are traced again in
            each product, to the same bytes.
        gaps
            Of the scene, if rays of its vertices are to be followed out of them.
        metals
            Of the scene, if rays are to go on from them as their BSDFs say. Not beside ``gaps``.
        report
            Hears the share done, 0 to 1.

        Raises InputError for a number of rays that is no square or above 16,384.
        """
        begin = time.perf_counter()
        origins = vantage_points(scene, occluders) if origins is None else origins
        normals = scene.normals if normals is None else normals
        sent = HemisphereRays(occluders, scene, origins=origins, normals=normals, rays=rays, seed=seed)
        if gaps is not None:
            sent = GapRays(occluders, scene, gaps, origins=origins, normals=normals, rays=rays, seed=seed)
        if metals is not None:
            sent = MetalRays(occluders, scene, metals, origins=origins, normals=normals, rays=rays, seed=seed)
        memory = _half_of_memory() if memory is None else memory
        gathering = cls(scene, sent)
        for first in range(0, gathering.rows, gathering._rows_at_once):
            tile = gathering._trace(first, count=True)
            gathering.entries += len(tile.columns)
            if gathering.bytes + tile.bytes <= memory:
                gathering._kept[first] = tile
            gathering.bytes += tile.bytes
            if report is not None:
                report(tile.rows.stop / gathering.rows)
        gathering.rays = int(gathering._sends.sum()) * rays + sum(part.rays for part in gathering.to_sky)
        gathering.seconds = time.perf_counter() - begin
        return gathering

    def _trace(self, first: int, *, count: bool = False) -> _Tile:
        rows = min(self._rows_at_once, self.rows - first)
        hits = self._rays.trace(first, rows)
        if count:
            tile = slice(first, first + rows)
            sends = self._sends[tile]
            self.sky[tile] = sends * (hits.triangle == NOTHING).mean(axis=1, dtype=np.float32)
            self.backs[tile] = (hits.triangle == BACK).mean(axis=1, dtype=np.float32)
            if isinstance(hits, MirroredHits):
                self.to_sky.append(hits.to_sky)
                self.mirrored_sky[tile] = hits.to_sky.by_row() / np.float32(self._rays.rays)
        counts = np.empty(rows, np.int64)
        count_entries(self._triangles, hits.triangle, counts, self.columns)
        starts = np.concatenate([[0], np.cumsum(counts)])
        columns = np.empty(starts[-1], np.int32)
        values = np.empty((max(1, self._channels), starts[-1]), np.float32)
        colours = self._colour.at(hits)
        if isinstance(hits, MirroredHits):
            colours = with_albedo(hits, colours, self._scene).weights
        fill_entries(
            self._triangles, hits.triangle, hits.u, hits.v, colours, starts, columns, values, self.columns
        )
        return _Tile(first, starts, columns, values)

    def tiles(self) -> Iterator[_Tile]:
        """The operator, some rows after the other: kept, or traced again."""
        for first in range(0, self.rows, self._rows_at_once):
            yield self._kept.get(first) or self._trace(first)

    def bounce(
        self, B: Float32[np.ndarray, "vertices columns channels"]
    ) -> Float32[np.ndarray, "rows columns channels"]:
        """Gρ B: irradiance / π (rows, K, C) that arrives by one bounce of B (V, K, C), irradiance / π before albedo.

        C is 3, or 1 where every albedo is grey.
        """
        if B.ndim != 3 or len(B) != self.columns or B.shape[2] not in (1, 3):
            raise InputError("light", f"is {B.shape}, expected ({self.columns}, columns, 1 or 3)")
        V, K, C = B.shape
        if C == 1 and not self.is_grey:
            raise InputError("light", "has one channel, but the scene has colours; give three")
        albedo_in_entries = self._channels
        by_channel = albedo_in_entries == 3  # then each has entries of its own
        light = B if albedo_in_entries else B * self.albedo[:, None, :C]
        light = np.moveaxis(light, 2, 0) if by_channel else light.reshape(1, V, K * C)
        blocks = [LightBlocks(part) for part in light]
        out = np.empty((len(light), self.rows, light.shape[2]), np.float32)
        for tile in self.tiles():
            for c, part in enumerate(blocks):
                part.multiplied(tile.starts, tile.columns, tile.values[c], out[c, tile.rows])
        return np.ascontiguousarray(np.moveaxis(out, 0, 2)) if by_channel else out.reshape(self.rows, K, C)

    @property
    def coloured_entries(self) -> int:
        """Channels of the albedo that is in the entries, 1 or 3; 0 where that of the vertices is to be multiplied."""
        return self._channels

    @property
    def is_grey(self) -> bool:
        """Whether red, green and blue are reflected alike everywhere."""
        if self._channels:
            return self._channels == 1
        return bool((self.albedo == self.albedo[:, :1]).all())


def _half_of_memory() -> int:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
