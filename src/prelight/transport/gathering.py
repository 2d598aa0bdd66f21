"""The one-bounce operator: what light leaves all surfaces, to what of it arrives at every vertex.

Final gathering from a vertex meets triangles; where, and with what barycentric weights, makes a sparse matrix G
whose rows and columns are vertices. It is the same for every light: one gather serves all columns of T.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int32, Int64, Positions
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from .gathering_kernels import count_entries, fill_entries, multiply
from .hemisphere import BACK, NOTHING, HemisphereRays
from .hit_colour import HitColour
from .vantage import vantage_points

RAYS = 1024  # a receiver: 0.7 to 1.2 % RMS noise in a bounce
_RAYS_AT_ONCE = 1 << 22  # of a tile
_WIDEST = 64  # columns multiplied at a time

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
    """(Gρ E)_i = mean over cosine-distributed rays from vertex i of albedo × E where they end.

    E is irradiance / π, without albedo, at vertices; at a hit it is interpolated between the vertices of the
    triangle, and the albedo is that of the place, texture included. All surfaces reflect diffusely, with their base
    colour if they are not Lambertian. They do so on the side of their vertices' normals, on which alone light is
    known; a ray that ends on the back of one brings nothing. Made by ``Gathering.trace``.

    Attributes
    ----------
    rows, columns
        The vertices, in the scene's order.
    entries, bytes
        Of the whole operator, kept or not.
    rays, seconds
        Sent, and wall time of tracing them.
    sky
        ``(V,)`` share of a vertex's rays that meet nothing.
    backs
        ``(V,)`` share of a vertex's rays that end on the back of a surface.
    albedo
        ``(V, 3)`` of the vertices.
    """

    def __init__(self, scene: Scene, rays: HemisphereRays, *, memory: int | None) -> None:
        self.rows = self.columns = len(scene.positions)
        self.albedo = scene.albedo
        self.sky, self.backs = np.zeros((2, self.rows), np.float32)
        self.entries = self.bytes = self.rays = 0
        self.seconds = 0.0
        self._triangles = np.ascontiguousarray(scene.triangles)
        self._colour, self._rays, self._memory = HitColour(scene), rays, memory
        self._kept: dict[int, _Tile] = {}
        self._rows_at_once = max(1, _RAYS_AT_ONCE // rays.rays)
        self._sends = scene.normals.any(axis=1)

    @classmethod
    def trace(  # noqa: PLR0913
        cls,
        scene: Scene,
        occluders: Occluders,
        *,
        origins: Positions | None = None,
        rays: int = RAYS,
        seed: int = 0,
        memory: int | None = None,
        report: Report | None = None,
    ) -> Gathering:
        """Trace the operator of a scene.

        Parameters
        ----------
        scene, occluders
            Its triangles, and the renderer's scene of the same.
        origins
            ``(V, 3)`` where the rays of vertices begin, before they are lifted from the surface;
            ``vantage.vantage_points`` if not given.
        rays
            From each vertex; a square number.
        memory
            Bytes the operator may take. Tiles of rows beyond it are traced again in each product, to the same
            bytes. No limit if not given.
        report
            Hears the share done, 0 to 1.

        Raises InputError for a number of rays that is no square or above 16,384.
        """
        begin = time.perf_counter()
        if origins is None:
            origins = vantage_points(scene, occluders)
        sent = HemisphereRays(
            occluders, scene, origins=origins, normals=scene.normals, rays=rays, seed=seed
        )
        gathering = cls(scene, sent, memory=memory)
        for first in range(0, gathering.rows, gathering._rows_at_once):
            tile = gathering._trace(first, count=True)
            gathering.entries += len(tile.columns)
            if memory is None or gathering.bytes + tile.bytes <= memory:
                gathering._kept[first] = tile
            gathering.bytes += tile.bytes
            if report is not None:
                report(tile.rows.stop / gathering.rows)
        gathering.rays = int(gathering._sends.sum()) * rays
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
        counts = np.empty(rows, np.int64)
        count_entries(self._triangles, hits.triangle, counts, self.columns)
        starts = np.concatenate([[0], np.cumsum(counts)])
        columns = np.empty(starts[-1], np.int32)
        values = np.empty((max(1, self._colour.channels), starts[-1]), np.float32)
        colours = self._colour.at(hits)
        fill_entries(
            self._triangles, hits.triangle, hits.u, hits.v, colours, starts, columns, values, self.columns
        )
        return _Tile(first, starts, columns, values)

    def _tiles(self) -> Iterator[_Tile]:
        for first in range(0, self.rows, self._rows_at_once):
            yield self._kept.get(first) or self._trace(first)

    def bounce(
        self, B: Float32[np.ndarray, "vertices columns channels"]
    ) -> Float32[np.ndarray, "vertices columns channels"]:
        """Gρ B: irradiance / π (V, K, C) that arrives by one bounce of B, irradiance / π before albedo.

        C is 3, or 1 where every albedo is grey.
        """
        V, K, C = B.shape
        if V != self.columns or C not in (1, 3):
            raise InputError("light", f"is {B.shape}, expected ({self.columns}, columns, 1 or 3)")
        if C == 1 and not self.is_grey:
            raise InputError("light", "has one channel, but the scene has colours; give three")
        out = np.empty((V, K, C), np.float32)
        for part, channels in self._parts(K, C):
            light = B[:, part, channels].astype(np.float32).reshape(V, -1)
            if self._colour.channels == 0:
                light = self._times_albedo(light, channels, C)
            values = channels.start if self._colour.channels == 3 else 0
            light = np.ascontiguousarray(light)
            arriving = np.empty_like(light)
            for tile in self._tiles():
                multiply(tile.starts, tile.columns, tile.values[values], light, arriving[tile.rows])
            out[:, part, channels] = arriving.reshape(V, -1, channels.stop - channels.start)
        return out

    def _parts(self, K: int, C: int) -> Iterator[tuple[slice, slice]]:
        """Columns and channels that are multiplied together; those of one channel where values are coloured."""
        together = 1 if self._colour.channels == 3 else C
        step = max(1, _WIDEST // together)
        for c in range(0, C, together):
            for k in range(0, K, step):
                yield slice(k, min(K, k + step)), slice(c, c + together)

    def _times_albedo(self, light: np.ndarray, channels: slice, C: int) -> np.ndarray:
        albedo = self.albedo[:, channels]
        return (light.reshape(len(light), -1, albedo.shape[1]) * albedo[:, None]).reshape(len(light), -1)

    @property
    def is_grey(self) -> bool:
        """Whether red, green and blue are reflected alike everywhere."""
        if self._colour.channels:
            return self._colour.channels == 1
        return bool((self.albedo == self.albedo[:, :1]).all())
