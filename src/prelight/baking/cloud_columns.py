"""Indirect light of every light of a cloud and of every patch, at all vertices: in parts on disk as they are done.

All share one gathering operator, which is traced when the first part is wanted.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from ..arrays import Float32, Int32
from ..encoding.light_fit import patch_flux
from ..encoding.vertex_tree import vertex_order
from ..scene.geometry import Scene
from ..storage.chunks import ArraySpec, ChunkRecord, chunk_key, open_chunk
from ..storage.journal import BakeWriter
from ..transport.bounces import bounced
from ..transport.gathering import Gathering
from .cloud_plan import COLUMNS, CloudPlan
from .cloud_trials import HELD_OUT, direct_of, trial_places
from .scene_arrays import whole

Report = Callable[[float], None]
_BALL_RAYS = 64


def patches_of(scene: Scene, count: int) -> Int32[np.ndarray, "vertices"]:
    """The patch of each vertex: neighbours of like normals, alike many."""
    order = vertex_order(scene.positions, scene.normals)
    of = np.empty(len(order), np.int32)
    of[order] = np.arange(len(order), dtype=np.int64) * min(count, len(order)) // len(order)
    return of


class CloudColumns:
    """Columns of a plan's lights, its patches, and lamps to try it on.

    Irradiance / π at all vertices for lights and lamps of 1 W/sr, for even light of flux 1 on a patch.

    Attributes
    ----------
    patch_of, areas
        ``(V,)``; areas in m².
    held
        Places of lamps that are solved to measure errors on.
    rays
        Traced by this process.
    """

    def __init__(self, plan: CloudPlan, writer: BakeWriter, report: Report) -> None:
        self.plan, self.scene, self._writer, self._report = plan, plan.scene, writer, report
        self.areas = plan.ground.areas
        self.patches = min(plan.settings.patches, len(plan.scene.positions))
        self.patch_of = patches_of(plan.scene, self.patches) if self.patches else None
        held = HELD_OUT if self.patches else 0
        self.held = trial_places(plan, seed=1, count=held) if held else np.zeros((0, 3))
        self._kept = {(e["part"], e["number"]): e for e in writer.entries if "number" in e}

    def make(self) -> None:
        """Everything that the journal does not have yet."""
        parts = [
            (part, number)
            for part, count in (
                ("lights", len(self.plan.grid)),
                ("patches", self.patches),
                ("held", len(self.held)),
            )
            for number in range(-(-count // COLUMNS))
        ]
        for k, (part, number) in enumerate(parts):
            if (part, number) not in self._kept:
                self._make_part(part, number)
            self._report((k + 1) / len(parts))

    @cached_property
    def _gathering(self) -> Gathering:
        ground, settings = self.plan.ground, self.plan.settings
        return Gathering.trace(
            self.scene, ground.occluders, origins=ground.origins, rays=settings.gather_rays,
            memory=self.plan.operator_bytes,
        )  # fmt: skip

    def _make_part(self, part: str, number: int) -> None:
        began, first = time.perf_counter(), number * COLUMNS
        if part == "patches":
            D = self._patches(first)
        else:
            D = self._lights(
                (self.plan.grid.positions if part == "lights" else self.held)[first : first + COLUMNS]
            )
        light = D if self._gathering.is_grey else np.repeat(D, 3, axis=2)
        solved = bounced(self._gathering, light)
        arrays = {"indirect": np.ascontiguousarray(solved.indirect, np.float32)}
        told: dict[str, Any] = {"remaining": min(solved.remaining, 1e9)}
        if part == "lights":
            arrays["fluxes"] = self._fluxes(D[:, :, 0])
            told["brightest"] = [float(x) for x in solved.indirect.max(axis=(0, 2))]
        chunks, specs = {}, {}
        for name, values in arrays.items():
            at = f"making/{part}/{name}/{number:05d}"
            specs[at] = whole(values)
            key, record = self._writer.write_chunk(at, (0,) * values.ndim, values, specs[at])
            chunks[key] = record.model_dump()
        entry = {
            "part": part, "number": number, "told": told, "chunks": chunks, "rays": self._gathering.rays,
            "arrays": {name: spec.model_dump() for name, spec in specs.items()},
            "seconds": time.perf_counter() - began,
        }  # fmt: skip
        self._writer.append(entry)
        self._kept[part, number] = entry

    def _lights(self, places: np.ndarray) -> Float32[np.ndarray, "vertices columns 1"]:
        radius = self.plan.settings.radius
        rays = _BALL_RAYS if radius else 1
        return direct_of(self.plan.ground, places, radius=radius, rays=rays)[:, :, None]

    def _patches(self, first: int) -> Float32[np.ndarray, "vertices columns 1"]:
        """Even light on each patch, of flux 1."""
        assert self.patch_of is not None
        last = min(first + COLUMNS, self.patches)
        sizes = np.bincount(self.patch_of, weights=self.areas, minlength=self.patches)
        own = (self.patch_of >= first) & (self.patch_of < last)
        D = np.zeros((len(self.patch_of), last - first, 1), np.float32)
        D[own, self.patch_of[own] - first, 0] = 1 / sizes[self.patch_of[own]]
        return D

    def _fluxes(self, D: np.ndarray) -> Float32[np.ndarray, "columns patches"]:
        if self.patch_of is None:
            return np.zeros((D.shape[1], 1), np.float32)
        found = [patch_flux(d, self.areas, self.patch_of, self.patches) for d in D.T]
        return np.stack(found).astype(np.float32)

    def _open(self, part: str, name: str) -> list[np.ndarray]:
        """What was kept of all parts, on disk."""
        found = []
        for number in range(sum(kind == part for kind, _ in self._kept)):
            entry, at = self._kept[part, number], f"making/{part}/{name}/{number:05d}"
            spec = ArraySpec(**entry["arrays"][at])
            key = chunk_key(at, (0,) * len(spec.shape))
            found.append(open_chunk(self._writer.partial, key, spec, ChunkRecord(**entry["chunks"][key])))
        return found

    @property
    def fluxes(self) -> Float32[np.ndarray, "lights patches"]:
        """Σ area · irradiance / π of every light on every patch."""
        return np.concatenate(self._open("lights", "fluxes"))

    @property
    def brightest(self) -> float:
        """What the brightest vertex answers to a usual light."""
        parts = [e["told"]["brightest"] for (part, _), e in sorted(self._kept.items()) if part == "lights"]
        return float(np.median(np.concatenate(parts)))

    @property
    def remaining(self) -> float:
        """The largest bound on bounces that are missing, a share of the indirect light's RMS."""
        return max(e["told"]["remaining"] for e in self._kept.values())

    @property
    def rays(self) -> int:
        """Of gathering, and of shadows."""
        shadows = len(self.scene.positions) * len(self.plan.grid)
        return max(e["rays"] for e in self._kept.values()) + shadows * (
            _BALL_RAYS if self.plan.settings.radius else 1
        )

    def rows(
        self, part: str, vertices: Int32[np.ndarray, "some"]
    ) -> Float32[np.ndarray, "columns some colours"]:
        """What some vertices answer to all ``lights``, ``patches``, or ``held`` lamps."""
        found = [np.moveaxis(block[vertices], 1, 0) for block in self._open(part, "indirect")]
        return np.concatenate(found)
