"""A cloud layer read from a bake: every number checked that a kernel or an address follows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32, Float64, Int32, Int64, Positions
from ..encoding.modes import BLOCK
from ..errors import DamagedBakeError, InputError
from ..storage.bake import Bake

KIND = "cloud"
_LARGEST = 1e12


@dataclass(frozen=True)
class CloudLayer:
    """Lights, zones and clusters.

    Attributes
    ----------
    lights
        ``(S, 3)`` metres; of each, how many of the grid it stands for in ``counts``.
    slot_of
        ``(Z, S)`` where a light's weight goes, among the weights of all zones one after the other.
    extras_of
        ``(Z, 2)`` the first mode (or patch) of each zone and how many it has, that make up for what no lights bring:
        their weights follow those of its groups.
    slots
        How many weights there are.
    fluxes, areas
        ``(S, extras)``: how much of each mode (or patch) lights bring; ``(V,)`` m²; None without.
    sources, source_scales
        ``(V, extras)`` 16 bits each: how much of each mode light at a vertex brings, in ``source_order`` if not None;
        ``(blocks, extras)`` for each 64 of them. None with patches.
    patch_of
        ``(V,)`` in bakes with patches.
    places, bases, codes, scales, order
        As of ``cloud_kernels.cloud_light``.
    grid, kept_of
        ``(L, 3)`` the lights as they were laid out, and which of ``lights`` each became.
    zone_rows
        ``(Z,)`` vertices of each zone, in ``order``.
    low, high
        The cloud's box.
    """

    name: str
    parameters: dict[str, Any]
    origins: Positions
    lights: Float64[np.ndarray, "kept 3"]
    counts: Float64[np.ndarray, "kept"]
    slot_of: Int64[np.ndarray, "zones kept"]
    extras_of: Int64[np.ndarray, "zones 2"]
    slots: int
    fluxes: Float32[np.ndarray, "kept extras"] | None
    areas: Float32[np.ndarray, "vertices"] | None
    sources: np.ndarray | None
    source_scales: Float32[np.ndarray, "blocks extras"] | None
    source_order: Int32[np.ndarray, "vertices"] | None
    patch_of: Int32[np.ndarray, "vertices"] | None
    places: Int64[np.ndarray, "clusters n"]
    bases: Float32[np.ndarray, "n"]
    codes: np.ndarray
    scales: Float32[np.ndarray, "n"]
    order: Int32[np.ndarray, "vertices"]
    grid: Float64[np.ndarray, "lights 3"]
    kept_of: Int32[np.ndarray, "lights"]
    zone_rows: Int32[np.ndarray, "zones"]
    low: Float64[np.ndarray, "3"]
    high: Float64[np.ndarray, "3"]

    @property
    def extras(self) -> int:
        """How many modes there are, or patches."""
        return 0 if self.fluxes is None else self.fluxes.shape[1]

    @property
    def bytes(self) -> int:
        """Of what a change of light reads."""
        return self.bases.nbytes + self.codes.nbytes + self.scales.nbytes

    def brought_by_groups(self) -> list[tuple[slice, Float64[np.ndarray, "groups modes"]]]:
        """Zone by zone which modes (or patches) it has, and how much of each its groups of lights bring."""
        assert self.fluxes is not None
        found = []
        for slots, (first, count) in zip(self.slot_of, self.extras_of, strict=True):
            modes, own = slice(first, first + count), slots - slots.min()
            sums = np.zeros((own.max() + 1, count))
            np.add.at(sums, own, self.counts[:, None] * self.fluxes[:, modes])
            found.append((modes, sums / np.bincount(own, self.counts)[:, None]))
        return found

    def group_lights(self, zone: int) -> Float64[np.ndarray, "groups 3"]:
        """Where a zone's groups of lights are: the mean of the grid's lights in each."""
        own = self.slot_of[zone] - self.slot_of[zone].min()
        sums = np.stack([np.bincount(own, self.counts * x) for x in self.lights.T], axis=1)
        return sums / np.bincount(own, self.counts)[:, None]


def cloud_names(bake: Bake) -> tuple[str, ...]:
    """The cloud layers of a bake, by name."""
    return tuple(name for name, layer in bake.layers.items() if layer.kind == KIND)


def open_cloud(bake: Bake, name: str | None = None) -> CloudLayer:
    """A cloud layer, the first if not named. Raises InputError, DamagedBakeError."""
    names = cloud_names(bake)
    name = names[0] if name is None and names else name
    if name not in names:
        there = ", ".join(f"{n} ({layer.kind})" for n, layer in bake.layers.items()) or "none"
        wanted = "a cloud layer" if name is None else f"the cloud layer {name!r:.60}"
        raise InputError(
            bake.path, f"has not {wanted}; its layers are: {there}; prelight bake cloud makes one"
        )
    return _Reading(bake, name).layer()


class _Reading:
    """One layer, array by array."""

    def __init__(self, bake: Bake, name: str) -> None:
        self.bake, self.name, self.at = bake, name, f"layers/{name}"
        self.said: dict[str, Any] = bake.layers[name].parameters | bake.layers[name].statistics

    def wrong(self, what: str) -> DamagedBakeError:
        return DamagedBakeError(self.bake.path, f"{self.at}: {what}")

    def numbers(self, part: str) -> np.ndarray:
        values = self.bake.array(f"{self.at}/{part}")
        if values.dtype == np.uint16:
            values = values.view(np.float16).astype(np.float32)
        if not (np.abs(values) <= _LARGEST).all():
            raise self.wrong(f"{part} has values that are no numbers, or too large")
        return values

    def indices(self, part: str, count: int) -> np.ndarray:
        values = self.bake.array(f"{self.at}/{part}")
        if values.min() < 0 or values.max() >= count:
            raise self.wrong(f"{part} names what does not exist")
        return values

    def layer(self) -> CloudLayer:
        bake, V = self.bake, len(self.bake.receivers)
        lights = self.numbers("lights").astype(np.float64)
        if not (lights[:, 3] >= 1).all():
            raise self.wrong("lights stand for none of the grid")
        order = self.vertices_once("order", V)
        groups = bake.array(f"{self.at}/group_of").astype(np.int64)
        sizes = groups.max(axis=1) + 1
        if not all(len(np.unique(of)) == size for of, size in zip(groups, sizes, strict=True)):
            raise self.wrong("group_of has groups without lights")
        patches, modes = int(self.said["patches"]), int(self.said.get("modes", 0))
        firsts, counts = self._extras_of_zones(len(sizes), patches + modes)
        widths = sizes + counts
        starts = np.cumsum(widths) - widths
        places, zone_rows, ends = self._places(starts, widths, V)
        bases = self._scaled_bases(places, ends[0])
        codes = self.numbers("codes") if self.said["codes"] == "float16" else bake.array(f"{self.at}/codes")
        scales = self.numbers("code_scales")
        if len(codes) != max(1, ends[1]) or len(scales) != max(1, ends[2]):
            raise self.wrong("codes and their scales are not those of its clusters")
        has_extras = patches + modes > 0
        fluxes = self.numbers("fluxes") * np.float32(self.said["flux_scale"]) if has_extras else None
        corners = [
            np.array([float(self.said[f"{side}_{axis}"]) for axis in "xyz"]) for side in ("low", "high")
        ]
        return CloudLayer(
            self.name, bake.layers[self.name].parameters, self.numbers("origins"), np.ascontiguousarray(lights[:, :3]),
            lights[:, 3].copy(), groups + starts[:, None],
            np.stack([firsts, counts], axis=1), int(widths.sum()), fluxes,
            self.numbers("areas") if has_extras else None,
            self._sources() if modes else None,
            *self._sources_scaled(V) if modes else (None, None),
            self.indices("patch_of", patches) if patches else None, places, bases, codes, scales, order,
            self.numbers("grid").astype(np.float64), self.indices("kept_of", len(lights)), zone_rows, *corners,
        )  # fmt: skip

    def _extras_of_zones(self, zones: int, extras: int) -> tuple[np.ndarray, np.ndarray]:
        """The first mode of each zone and how many it has: all, in bakes whose modes are of the whole scene."""
        if f"{self.at}/zone_modes" not in self.bake.manifest.arrays:
            return np.zeros(zones, np.int64), np.full(zones, extras)
        firsts, counts = self.bake.array(f"{self.at}/zone_modes").astype(np.int64).T
        if firsts.min() < 0 or counts.min() < 0 or (firsts + counts).max() > extras:
            raise self.wrong("zone_modes names what does not exist")
        return firsts, counts

    def _sources(self) -> np.ndarray:
        """16 bits each; bakes with one scale for all vertices have bytes."""
        values = self.bake.array(f"{self.at}/sources")
        return values.view(np.int16) if values.dtype == np.uint16 else values.astype(np.int16)

    def _sources_scaled(
        self, vertices: int
    ) -> tuple[Float32[np.ndarray, "blocks extras"], Int32[np.ndarray, "vertices"] | None]:
        """Scales of the sources by blocks, and the order they are in: that of the vertices in bakes with one scale."""
        scales = self.numbers("source_scales")
        if scales.ndim == 1:
            blocks = -(-vertices // BLOCK)
            return np.ascontiguousarray(np.broadcast_to(scales, (blocks, len(scales)))), None
        return scales, self.vertices_once("source_order", vertices)

    def vertices_once(self, part: str, vertices: int) -> Int32[np.ndarray, "vertices"]:
        order = self.indices(part, vertices)
        if not (np.bincount(order, minlength=vertices) == 1).all():
            raise self.wrong(f"{part} has not every vertex once")
        return order

    def _places(
        self, starts: np.ndarray, widths: np.ndarray, vertices: int
    ) -> tuple[np.ndarray, np.ndarray, tuple[int, int, int]]:
        """The kernel's table, and how many bases, codes and scales follow from it."""
        table = self.bake.array(f"{self.at}/clusters").astype(np.int64)
        zone_rows = self.indices("zone_rows", vertices + 1)
        zone, rows, components = table[:, 0], table[:, 1], table[:, 2:]
        if zone.min() < 0 or zone.max() >= len(zone_rows) or rows.min() < 1 or rows.max() > vertices:
            raise self.wrong("clusters are of zones that do not exist, or of no vertices")
        if components.min() < 0 or (components > 4096).any() or (np.diff(zone) < 0).any():
            raise self.wrong("clusters have components that cannot be, or are not in order")
        if not (np.bincount(zone, rows, len(zone_rows)) == zone_rows).all() or zone_rows.sum() != vertices:
            raise self.wrong("clusters do not have all vertices of their zones")
        if int(self.said.get("colours", 1)) == 3 and components.shape[1] == 1:
            components = np.repeat(components, 3, axis=1)  # of one basis
        channels, width = components.shape[1], widths[zone][:, None]
        is_shared = table.shape[1] == 3
        places = np.empty((len(table), 4 + 4 * channels), np.int64)
        places[:, 0], places[:, 1] = np.cumsum(rows) - rows, rows
        places[:, 2], places[:, 3] = starts[zone], widths[zone]
        places[:, 4::4] = components
        sizes = [(1 + components) * width, components * rows[:, None], components]
        if is_shared:
            sizes[0][:, 1:] = 0
        for k, size in enumerate(sizes):
            begin = np.cumsum(size.ravel()) - size.ravel()
            places[:, 5 + k :: 4] = begin.reshape(size.shape)
        if is_shared:
            places[:, 5::4] = places[:, 5:6]
        return places, zone_rows, (int(sizes[0].sum()), int(sizes[1].sum()), int(sizes[2].sum()))

    def _scaled_bases(self, places: np.ndarray, count: int) -> Float32[np.ndarray, "n"]:
        bases, scales = self.numbers("bases").copy(), self.numbers("base_scales")
        channels = (places.shape[1] - 4) // 4
        own = 1 if channels == 1 or (places[:, 5] == places[:, 9]).all() else channels
        rows: np.ndarray = places[:, 4 : 4 + 4 * own : 4].ravel() + 1
        if len(bases) != count or len(scales) != rows.sum():
            raise self.wrong("bases and their scales are not those of its clusters")
        lengths: np.ndarray = np.repeat(np.repeat(places[:, 3], own), rows)
        bases *= np.repeat(scales, lengths)
        return bases
