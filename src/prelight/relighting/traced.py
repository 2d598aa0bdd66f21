"""The radiance that a few strong lights bring to a layer's receivers, by a shadow ray for each.

Vertices need no renderer for it. What a fixed eye sees of other materials does: their BSDFs are Mitsuba's.
"""

from __future__ import annotations

from collections import OrderedDict
from functools import cached_property

import numpy as np

from ..arrays import Directions, Float32, Float64
from ..errors import MissingExtraError
from ..rays.plain import PlainOccluders, PlainVisibility
from ..storage.bake import Bake
from .layer import EnvironmentLayer
from .strong_lights import StrongLights

_KEPT_BYTES = 128_000_000  # of transfer, for lights that come again


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
    def _visibility(self) -> PlainVisibility:
        receivers = self._bake.receivers
        return PlainVisibility(
            PlainOccluders(receivers.positions, self._bake.triangles),
            origins=receivers.positions[self._plain],
            normals=receivers.normals[self._plain],
        )

    @cached_property
    def _viewed(self):
        """Raises MissingExtraError without the renderer."""
        from ..rays.mitsuba import Occluders
        from ..rays.surfaces import SurfaceScene
        from ..scene.baked import scene_of
        from ..transport.eye import seen_points, vertex_points
        from ..transport.viewed import ViewedTransfer

        scene, layer = scene_of(self._bake), self._layer
        occluders = Occluders(scene.positions, scene.triangles)
        assert layer.eye is not None
        if layer.picture_size is None:
            points = vertex_points(scene, layer.eye.eye)
        else:
            width, height = layer.picture_size
            points = seen_points(occluders, layer.eye, width=width, height=height, samples=layer.samples)
        return ViewedTransfer(occluders, SurfaceScene(scene), points, receivers=self._seen)
