"""Indirect light of every light of a cloud and of every mode, at all vertices: in parts on disk as they are done.

All share one gathering operator, which is traced when the first part is wanted.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cached_property
from typing import Any, cast

import numpy as np

from ..arrays import Float32, Float64, Int32
from ..encoding.modes import BLOCK
from ..storage.chunks import ArraySpec, ChunkRecord, chunk_key, open_chunk
from ..storage.journal import BakeWriter
from ..transport.bounces import bounced
from ..transport.gathering import Gathering
from ..transport.spreading import Spreading
from .cloud_caustics import CloudCaustics, bouncing
from .cloud_modes import Mixtures, Sources, mixtures, products
from .cloud_plan import COLUMNS, HELD_OUT, CloudPlan, trained
from .cloud_regions import cells_of, modes_there, regions_of, zones_of
from .cloud_trials import direct_of, trial_places
from .scene_arrays import whole

Report = Callable[[float], None]
_BALL_RAYS = 64
_MOST_TAUGHT = 1024  # lights of the grid, beside lamps, that modes are learnt from


class CloudColumns:
    """Columns of a plan's lights, of lamps that modes are learnt from, of the modes, and of lamps to try it on.

    Irradiance / π at all vertices, for lights and lamps of 1 W/sr.

    Attributes
    ----------
    areas
        ``(V,)`` m².
    held, learnt
        Places of lamps that are solved to measure errors on, and to find modes.
    zones
        Vertices of each zone.
    """

    def __init__(self, plan: CloudPlan, writer: BakeWriter, report: Report) -> None:
        self.plan, self.scene, self._writer, self._report = plan, plan.scene, writer, report
        self.areas = plan.ground.areas
        wanted = plan.settings.modes
        self.held = trial_places(plan, seed=1, count=HELD_OUT if wanted else 0)
        self.learnt = trial_places(plan, seed=2, count=trained(wanted))
        self.zones = zones_of(plan.scene.positions, plan.settings.zone)
        self._regions = regions_of(plan.scene.positions, wanted)
        self._cells = cells_of(plan.scene.positions, wanted)
        self._kept = {(e["part"], e["number"]): e for e in writer.entries if "number" in e}
        self._opened: dict[tuple[str, str], list[np.ndarray]] = {}

    def make(self) -> None:
        """Everything that the journal does not have yet."""
        modes = self.plan.settings.modes
        expected = sum(
            -(-n // COLUMNS) for n in (len(self.plan.grid), len(self.learnt), len(self.held), modes)
        )
        done = 0
        for part in ("lights", "learnt", "held", "modes"):
            count = self.modes if part == "modes" else len(self._places(part))
            for number in range(-(-count // COLUMNS)):
                if (part, number) not in self._kept:
                    self._make_part(part, number)
                done += 1
                self._report(min(1.0, done / expected))

    @cached_property
    def _gathering(self) -> Gathering:
        ground, settings = self.plan.ground, self.plan.settings
        return Gathering.trace(
            bouncing(self.plan), ground.occluders, origins=ground.origins, rays=settings.gather_rays,
            memory=self.plan.operator_bytes,
        )  # fmt: skip

    @cached_property
    def _backwards(self) -> Spreading:
        return Spreading(self._gathering, self.scene)

    def _make_part(self, part: str, number: int) -> None:
        began, first = time.perf_counter(), number * COLUMNS
        if part == "modes":
            arrays, remaining = self._modes(slice(first, min(first + COLUMNS, self.modes)))
        else:
            arrays, remaining = self._lamps(part, self._places(part)[first : first + COLUMNS])
        told: dict[str, Any] = {"remaining": min(remaining, 1e9)}
        if part == "lights":
            told["brightest"] = [float(x) for x in arrays["indirect"].max(axis=(0, 2))]
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

    def _lamps(self, part: str, places: np.ndarray) -> tuple[dict[str, np.ndarray], float]:
        """What bounces of lamps, and of the grid's lights what falls directly; modes know nothing of caustics."""
        radius = self.plan.settings.radius if part == "lights" else 0.0
        D = direct_of(self.plan.ground, places, radius=radius, rays=_BALL_RAYS if radius else 1)[:, :, None]
        light, sent_on = np.repeat(D, self.colours, axis=2), None
        if self._caustics is not None and part != "learnt":
            sent_on = self._caustics.of(places)
            light = np.ascontiguousarray(light + sent_on)
        solved = bounced(self._gathering, light)
        kept = solved.indirect if sent_on is None else solved.indirect + sent_on
        arrays = {"indirect": np.ascontiguousarray(kept, np.float32)}
        if part == "lights":
            arrays["direct"] = np.ascontiguousarray(D[:, :, 0], np.float32)
        return arrays, solved.remaining

    def _modes(self, which: slice) -> tuple[dict[str, np.ndarray], float]:
        """Modes, and how much of them light at each vertex brings: all colours of one answer to it together."""
        shares, squares = self._mixtures.shares[:, which], self._mixtures.squares[which]
        L = np.zeros((len(self.areas), shares.shape[1], self.colours), np.float32)
        for region in np.unique(self._mixtures.region[which]):
            rows, own = self._regions[region], np.flatnonzero(self._mixtures.region[which] == region)
            learnt = self._taught(rows)
            L[np.ix_(rows, own)] = np.einsum("lvc,lk->vkc", learnt, shares[:, own], optimize=True)
        backwards = cast(Gathering, self._backwards)  # of one, solving needs no more than ``bounce``
        found = bounced(backwards, L)
        sources = found.indirect.sum(axis=2) / squares.astype(np.float32)
        return {"indirect": L, "sources": np.ascontiguousarray(sources, np.float32)}, found.remaining

    @cached_property
    def _mixtures(self) -> Mixtures:
        if not len(self.learnt):
            return Mixtures(np.zeros((0, 0)), np.zeros(0), np.zeros(0, np.int32))
        grams = [products(self._taught(rows), self.areas[rows]) for rows in self._regions]
        return mixtures(grams, self.plan.settings.modes, fixed=len(self._cells))

    def _taught(self, vertices: Int32[np.ndarray, "some"]) -> Float32[np.ndarray, "lamps some colours"]:
        """What modes are learnt from: lamps here and there; lights of the grid, unless they have caustics; and, so that
        the mean light of each cell is known, an even light on it."""
        known = [self.rows("learnt", vertices)]
        if self._caustics is None:
            every = -(-len(self.plan.grid) // _MOST_TAUGHT)
            known.append(self.rows("lights", vertices)[::every])
        even = np.stack([np.isin(vertices, cell) for cell in self._cells]).astype(np.float32)
        return np.concatenate([*known, np.repeat(even[:, :, None], self.colours, axis=2)])

    @property
    def modes(self) -> int:
        """How many modes there are, once lamps are learnt from."""
        return len(self._mixtures)

    def modes_of(self, zone: Int32[np.ndarray, "some"]) -> slice:
        """Which modes a zone has anything of."""
        region_of = np.empty(len(self.areas), np.int32)
        for number, rows in enumerate(self._regions):
            region_of[rows] = number
        return modes_there(self._mixtures.region, region_of, zone)

    @property
    def squares(self) -> Float64[np.ndarray, "modes"]:
        """How much light each mode is: area · irradiance², over all surfaces and colours."""
        return self._mixtures.squares

    @property
    def colours(self) -> int:
        """1 where every albedo is grey."""
        return 1 if self._gathering.is_grey and self._caustics is None else 3

    @cached_property
    def _caustics(self) -> CloudCaustics | None:
        return CloudCaustics(self.plan) if self.plan.photons else None

    def _places(self, part: str) -> np.ndarray:
        return {"lights": self.plan.grid.positions, "learnt": self.learnt, "held": self.held}[part]

    def _open(self, part: str, name: str) -> list[np.ndarray]:
        """What was kept of all parts, on disk."""
        count = sum(kind == part for kind, _ in self._kept)
        if len(self._opened.get((part, name), ())) == count:
            return self._opened[part, name]
        found = []
        for number in range(count):
            entry, at = self._kept[part, number], f"making/{part}/{name}/{number:05d}"
            spec = ArraySpec(**entry["arrays"][at])
            key = chunk_key(at, (0,) * len(spec.shape))
            found.append(open_chunk(self._writer.partial, key, spec, ChunkRecord(**entry["chunks"][key])))
        self._opened[part, name] = found
        return found

    @cached_property
    def sources(self) -> Sources | None:
        """How much light at each vertex brings of each mode; None without modes."""
        if not self.modes:
            return None
        values = np.concatenate(self._open("modes", "sources"), axis=1)
        return Sources.of(values, self.areas, np.concatenate(zones_of(self.scene.positions, BLOCK)))

    @cached_property
    def brought(self) -> Float32[np.ndarray, "lights modes"] | None:
        """How much of each mode the grid's lights bring; None without modes."""
        if self.sources is None:
            return None
        parts = [self.sources.brought(direct) for direct in self._open("lights", "direct")]
        return np.concatenate(parts).astype(np.float32)

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
        """What some vertices answer to all ``lights``, to lamps ``learnt`` from or ``held``, or have of ``modes``."""
        found = [np.moveaxis(block[vertices], 1, 0) for block in self._open(part, "indirect")]
        return np.concatenate(found)
