"""Which lights of a cloud, and which modes, stand for a lamp: a weight for each group of lights of every zone."""

from __future__ import annotations

import numpy as np

from ..arrays import Float32, Float64
from ..encoding.light_fit import (
    FITTED,
    NEAREST,
    bounded,
    fitted,
    kernel,
    nearest,
    normalised,
    patch_flux,
    prior,
)
from ..lighting.placed_lights import Lamp, PlacedLight
from ..rays.segments import PlainSegments
from .cloud_kernels import STRIP, brought_of_modes
from .stored_cloud import CloudLayer

_FEW = 6  # of the nearest lights that must be seen; else all are looked at
_BEFORE = 1e-3  # of the scene: how far before a panel it is looked from

Weights = Float32[np.ndarray, "3 slots"]


class CloudWeights:
    """Weights of lamps in a layer.

    Parameters
    ----------
    layer, segments
        The cloud, and what stands between its lights and a lamp.
    interpolation
        ``fitted``, or the paper's ``kernel``.
    """

    def __init__(self, layer: CloudLayer, segments: PlainSegments, *, interpolation: str) -> None:
        self._layer, self._segments, self.interpolation = layer, segments, interpolation
        self._extent = float((layer.high - layer.low).max())
        self._brought_by_groups = layer.brought_by_groups() if interpolation == "fitted" else []
        if interpolation == "kernel":
            zones = range(len(layer.slot_of))
            self._groups = [layer.group_lights(zone) for zone in zones]

    def place(self, light: PlacedLight) -> Float64[np.ndarray, "3"]:
        """Where a lamp is in the cloud: the nearest point of its box."""
        at = np.array(light.position)
        if not isinstance(light, Lamp):
            at = at + light.normal * (_BEFORE * self._extent)
        return np.clip(at, self._layer.low, self._layer.high)

    def of(self, light: PlacedLight, direct: Float32[np.ndarray, "vertices 3"]) -> Weights:
        """Weights of a light of colour 1 whose direct irradiance / π at the vertices is ``direct``."""
        out = np.zeros((3, self._layer.slots), np.float32)
        if not direct.any():
            return out  # nothing falls anywhere, so nothing bounces
        if self.interpolation == "kernel":
            out[:] = self._by_kernel(self.place(light))
            return out
        if isinstance(light, Lamp) and light.beam.distribution is None and self._layer.areas is not None:
            direct = bounded(direct, self._layer.areas)
        is_grey = bool((direct[:, :1] == direct).all())
        lights, distances = self._seen(self.place(light))
        for c, target in enumerate(self._brought(direct, is_grey=is_grey)):
            out[c] = self._fitted(target, lights, distances)
        if is_grey:
            out[1:] = out[0]
        return out

    def _brought(
        self, direct: Float32[np.ndarray, "vertices 3"], *, is_grey: bool
    ) -> Float64[np.ndarray, "n extras"]:
        """How much direct light brings of each mode or patch, channel by channel; one channel stands for three."""
        layer, count = self._layer, 1 if is_grey else 3
        areas = layer.areas
        assert areas is not None
        if layer.sources is None or layer.source_scales is None:
            assert layer.patch_of is not None
            return np.stack([patch_flux(d, areas, layer.patch_of, layer.extras) for d in direct.T[:count]])
        light = direct[:, :count] * areas[:, None]
        if layer.source_order is not None:
            light = light[layer.source_order]
        found = np.zeros((-(-len(light) // STRIP), count, layer.extras), np.float32)
        brought_of_modes(layer.sources, layer.source_scales, np.ascontiguousarray(light), found)
        return found.sum(axis=0, dtype=np.float64)

    def _seen(self, place: np.ndarray) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
        """Neighbours that the lamp sees, how far they are, and their part of the paper's kernel."""
        layer = self._layer
        found, far = nearest(layer.lights, place, FITTED + 1)
        reach = float(far[-1]) if len(far) > 1 else 2 * float(far[-1]) + 1.0
        free = self._sees(place, layer.lights[found])
        if np.count_nonzero(free) < min(_FEW, len(found)):
            every = np.flatnonzero(self._sees(place, layer.lights))
            if len(every):
                near, far = nearest(layer.lights[every], place, FITTED + 1)
                found, reach = every[near], 1.001 * float(far[-1]) + 1e-9
                return found, (far, kernel(far, reach))
        return found[free], (far[free], kernel(far[free], reach))

    def _fitted(
        self, target: np.ndarray, lights: np.ndarray, distances: tuple[np.ndarray, np.ndarray]
    ) -> Float32[np.ndarray, "slots"]:
        layer = self._layer
        assert layer.fluxes is not None
        brought, (far, shape) = layer.fluxes[lights], distances
        w = fitted(target, brought, prior(far, shape), np.sqrt(shape))
        out = np.bincount(layer.slot_of[:, lights].ravel(), np.tile(w, len(layer.slot_of)), layer.slots)
        out = out.astype(np.float64)  # of no lights it counts in integers
        starts = np.append(layer.slot_of.min(axis=1), layer.slots)
        for zone, (modes, of_groups) in enumerate(self._brought_by_groups):
            slots = slice(starts[zone] + len(of_groups), starts[zone + 1])
            which = layer.slot_of[zone, lights] - starts[zone]
            out[slots] = target[modes] - w @ of_groups[which]
        return out.astype(np.float32)

    def _by_kernel(self, place: np.ndarray) -> Float32[np.ndarray, "slots"]:
        """The paper's, zone by zone: the nearest groups of lights that the lamp sees."""
        out = np.zeros(self._layer.slots, np.float32)
        for zone, groups in enumerate(self._groups):
            found, far = nearest(groups, place, NEAREST)
            free = self._sees(place, groups[found])
            if not free.any():
                every = np.flatnonzero(self._sees(place, groups))
                if not len(every):
                    continue
                near, far = nearest(groups[every], place, NEAREST)
                found, free = every[near], np.ones(len(near), bool)
            shape = kernel(far, float(far[-1]) if len(far) > 1 else np.inf) * free
            if not shape.any():
                shape = free.astype(np.float64)
            out[int(self._layer.slot_of[zone].min()) + found] = normalised(shape)
        return out

    def are_seen(self, light: PlacedLight) -> bool:
        """Whether a lamp sees any light of the cloud."""
        place = self.place(light)
        near = nearest(self._layer.lights, place, FITTED + 1)[0]
        lights = self._layer.lights
        return bool(self._sees(place, lights[near]).any() or self._sees(place, lights).any())

    def _sees(self, place: np.ndarray, lights: np.ndarray) -> np.ndarray:
        return self._segments.are_free(np.broadcast_to(place, lights.shape), lights)
