"""The radiance that a few strong lights bring to a layer's receivers, by a shadow ray for each.

Vertices need no renderer for it. What a fixed eye sees of other materials does: their BSDFs are Mitsuba's.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import CubeMap, Directions, Float32, Float64, Int32, Normals, Positions, Radiance
from ..errors import MissingExtraError
from ..lighting.disc import Disc
from ..lighting.environment import Environment
from ..rays.plain import PlainOccluders, PlainVisibility
from ..storage.bake import Bake
from .exitant import Lights
from .layer import EnvironmentLayer
from .strong_lights import LARGEST_DISC_DEG, NO_LIGHTS, StrongLights, strong_discs, strongest, without

if TYPE_CHECKING:
    from ..transport.viewed import ViewedTransfer

_KEPT_BYTES = 128_000_000  # of transfer, for lights that come again
_AT_ONCE = 1 << 16  # points
_PARTS = 8  # of a light's side, each with a ray of its own from pixels in its penumbra
_RAYS = 64  # of such a pixel to all lights, but for one to each


class TracedLights:
    """T of single directions at the receivers of a layer.

    Lambertian rows answer with irradiance / π for unit light, the same for red, green and blue; others with
    radiance toward the layer's eye.
    """

    def __init__(self, bake: Bake, layer: EnvironmentLayer) -> None:
        self._bake, self._layer = bake, layer
        channels = np.ones(layer.rows, np.uint8)
        rows = layer.order >= 0
        channels[layer.order[rows]] = np.repeat(layer.channels_of_group, 32)[rows]
        self._plain, self._seen = np.flatnonzero(channels == 1), np.flatnonzero(channels == 3)
        self.lambertian = self._plain
        self._known: OrderedDict[bytes, tuple[np.ndarray, np.ndarray]] = OrderedDict()

    @cached_property
    def is_possible(self) -> bool:
        """Whether this installation can: without the renderer only where all rows are Lambertian."""
        if not len(self._seen):
            return True
        try:
            return self._viewed is not None
        except MissingExtraError:
            return False

    def radiance(self, lights: StrongLights) -> Float64[np.ndarray, "rows 3"]:
        """Σ energy · T(direction), albedo left out where the layer leaves it out."""
        self._trace(lights.directions)
        total = np.zeros((self._layer.rows, 3))
        normals = self._bake.receivers.normals[self._plain] if len(self._plain) else np.zeros((0, 3))
        for d, energy in zip(lights.directions, lights.energy, strict=True):
            bits, seen = self._known[d.tobytes()]
            if len(self._plain):
                there = np.unpackbits(bits, count=len(self._plain), bitorder="little")
                T = np.maximum(normals @ d, 0) * there * np.float32(1 / np.pi)
                total[self._plain] += T[:, None] * energy
            if len(self._seen):
                total[self._seen] += seen.T * energy
        while len(self._known) > max(len(lights), _KEPT_BYTES // self._bytes_of_one):
            self._known.popitem(last=False)
        return total

    def visible(self, lights: StrongLights, rows: Int32[np.ndarray, "some"]) -> np.ndarray:
        """(lights, some) bool: which Lambertian rows each light reaches, above their horizons."""
        self._trace(lights.directions)
        places = np.searchsorted(self._plain, rows)
        bits = np.stack([self._known[d.tobytes()][0] for d in lights.directions])
        return np.unpackbits(bits, axis=1, count=len(self._plain), bitorder="little")[:, places].astype(bool)

    def reaching(self, lights: StrongLights, rows: Int32[np.ndarray, "some"]) -> Lights:
        """Directions toward the lights, and the irradiance that surfaces at Lambertian rows facing them get."""
        return _as_falls(lights, self.visible(lights, rows))

    def reaching_at(self, lights: StrongLights, points: Positions, normals: Normals) -> Lights:
        """The same at points (n, 3) of surfaces with unit normals, by rays to parts of each light.

        A texel is as wide as it is, and so is the penumbra; at vertices each light is a single direction.
        """
        side = min(_PARTS, max(1, math.isqrt(_RAYS // max(1, len(lights)))))
        parts = lights.parts(side, resolution=self._layer.resolution)
        seen = np.zeros((len(lights), len(points)), np.float32)
        for light, toward in enumerate(parts):
            seen[light] = self._share(toward, points, normals)
        return _as_falls(lights, seen)

    def _share(
        self, toward: Directions, points: Positions, normals: Normals
    ) -> Float32[np.ndarray, "points"]:
        """Of side × side directions, what points see: five of them say whether all others are asked."""
        parts, side = len(toward), math.isqrt(len(toward))
        first = np.unique([0, side - 1, parts // 2 + side // 2 * (1 - side % 2), parts - side, parts - 1])
        share = self._free(toward[first], points, normals)
        mixed = np.flatnonzero((share > 0) & (share < 1))
        if len(mixed) and len(first) < parts:
            share[mixed] = self._free(toward, points[mixed], normals[mixed])
        return share

    def _free(self, toward: Directions, points: Positions, normals: Normals) -> Float32[np.ndarray, "points"]:
        bits, _ = PlainVisibility(self._occluders, origins=points, normals=normals).trace(toward)
        return np.unpackbits(bits, axis=1, count=len(points), bitorder="little").mean(
            axis=0, dtype=np.float32
        )

    def irradiance_at(self, lights: StrongLights, points: Positions, normals: Normals) -> Radiance:
        """(n, 3) irradiance / π of the lights at points of surfaces."""
        out = np.zeros((len(points), 3), np.float32)
        for first in range(0, len(points), _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            d, energy = self.reaching_at(lights, points[part], normals[part])
            cosine = np.maximum(normals[part] @ d[0].T, 0)
            out[part] = np.einsum("nk,nkc->nc", cosine, energy) / np.float32(np.pi)
        return out

    @property
    def _bytes_of_one(self) -> int:
        return len(self._plain) // 8 + 12 * len(self._seen) + 1

    def _trace(self, directions: Directions) -> None:
        for d in directions:
            if d.tobytes() in self._known:
                self._known.move_to_end(d.tobytes())
        new = np.array([d for d in directions if d.tobytes() not in self._known], np.float32).reshape(-1, 3)
        if not len(new):
            return
        bits = self._visibility.trace(new)[0] if len(self._plain) else np.zeros((len(new), 0), np.uint8)
        seen: Float32[np.ndarray, "lights 3 rows"] = np.zeros((len(new), 3, 0), np.float32)
        if len(self._seen):
            rows, _ = self._viewed.trace(new)
            seen = self._viewed.values(rows, new)
        for k, d in enumerate(new):
            self._known[d.tobytes()] = bits[k], seen[k]

    @cached_property
    def _occluders(self) -> PlainOccluders:
        return PlainOccluders(self._bake.receivers.positions, self._bake.triangles)

    @cached_property
    def _visibility(self) -> PlainVisibility:
        receivers = self._bake.receivers
        return PlainVisibility(
            self._occluders,
            origins=self._layer.origins[self._plain],
            normals=receivers.normals[self._plain],
        )

    @cached_property
    def _viewed(self) -> ViewedTransfer:
        """Raises MissingExtraError without the renderer."""
        from .viewed import viewed_transfer

        return viewed_transfer(self._bake, self._layer, self._seen)


def _as_falls(lights: StrongLights, seen: np.ndarray) -> Lights:
    """``seen`` (lights, places), shares of the lights."""
    d = np.broadcast_to(lights.directions, (seen.shape[1], *lights.directions.shape))
    energy = (seen.T[:, :, None] * lights.energy).astype(np.float32)
    return np.ascontiguousarray(d, np.float32), energy


class Strong:
    """The strong lights of a relighter: whether they are wanted, which there are, and what the map is without."""

    def __init__(self, tracer: TracedLights, *, wanted: bool) -> None:
        self.tracer, self.wanted = tracer, wanted
        self.lights = self.of_map = NO_LIGHTS
        self._texels: list[np.ndarray] = []

    @property
    def is_on(self) -> bool:
        return self.wanted and self.tracer.is_possible

    def of_discs(self, environment: Environment, resolution: int) -> tuple[StrongLights, Sequence[Disc]]:
        """Strong discs as texels, and the other discs."""
        if not self.is_on or all(disc.radius_deg > LARGEST_DISC_DEG for disc in environment.discs):
            return NO_LIGHTS, environment.discs
        return strong_discs(environment.discs, environment.total, resolution)

    def taken_out(self, cube: CubeMap, total: Float64[np.ndarray, "3"]) -> CubeMap:
        """The cube without its strong lights, which are kept here."""
        self.of_map = strongest(cube, total=total) if self.is_on else NO_LIGHTS
        self._texels = [
            cube[f, r : r + h, c : c + w].copy() for f, r, c, h, w in self.of_map.rectangles.tolist()
        ]
        return without(cube, self.of_map) if len(self.of_map) else cube

    def give_back(
        self, face: int, rows: slice, columns: slice, resolution: int
    ) -> list[tuple[tuple[int, slice, slice], np.ndarray]]:
        """Rectangles and texels of those that a rectangle meets; they are strong no more."""
        top, bottom, _ = rows.indices(resolution)
        left, right, _ = columns.indices(resolution)
        back, keep = [], []
        for k, (f, r, c, h, w) in enumerate(self.of_map.rectangles.tolist()):
            if f == face and r < bottom and top < r + h and c < right and left < c + w:
                back.append(((f, slice(r, r + h), slice(c, c + w)), self._texels[k]))
            else:
                keep.append(k)
        if back:
            others = range(len(self.of_map), len(self.lights))
            self.lights = self.lights.chosen([*keep, *others])
            self.of_map = self.of_map.chosen(keep)
            self._texels = [self._texels[k] for k in keep]
        return back
