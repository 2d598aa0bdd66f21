"""The glossy part of a layer, of any kind whose rows are vertices: found, written, and what it will cost."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..arrays import Int32, Positions
from ..bases.exitant import milliseconds
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from ..scene.mesh import short_name
from ..storage.chunks import ArraySpec
from ..storage.exitant_part import MOST_ORDER
from ..storage.journal import BakeWriter
from ..transport.exitant import Lobes, glossy_rows, least_width, lobes_of
from ..transport.seen_cells import CELLS, SUBRAYS, Glazing, Report, Seen, seen_from

_WIDEST = 1.25  # α·R of ``SurfaceScene``: the highlights that it leaves alone
_RAYS_A_SECOND = 8e6  # of two cores, measured
_BYTES_PER_CELL = 6
_BYTES_PER_ROW = 50


@dataclass(frozen=True)
class ExitantPart:
    """Glossy vertices of a scene, what they see and what their materials are."""

    order: int
    rows: Int32[np.ndarray, "rows"]
    seen: Seen
    lobes: Lobes
    notes: tuple[str, ...]
    seconds: float

    @classmethod
    def of(
        cls,
        scene: Scene,
        occluders: Occluders,
        *,
        order: int,
        origins: Positions | None = None,
        glazing: Glazing | None = None,
        seed: int = 0,
        report: Report | None = None,
    ) -> ExitantPart | None:
        """Of all vertices whose material is not Lambertian; None where there are none.

        Parameters
        ----------
        order
            Of the harmonics, 1 to 16. Highlights narrower than they hold are widened, and ``notes`` say so.
        origins
            ``(V, 3)`` where rays begin before they are lifted; the vertices themselves if not given.
        glazing
            What the sky is seen through, if through panes alone.

        Raises InputError for an order out of range.
        """
        check_order(order)
        rows = glossy_rows(scene)
        if not len(rows):
            return None
        began = time.perf_counter()
        surfaces = SurfaceScene(scene, resolution=max(1, round(_WIDEST / least_width(order))))
        lobes = lobes_of(scene, surfaces, rows, order)
        origins = scene.positions if origins is None else origins
        seen = seen_from(
            occluders, scene, origins=origins[rows], normals=scene.normals[rows], glazing=glazing, seed=seed,
            report=report,
        )  # fmt: skip
        notes = lobes.notes
        if wide := surfaces.widened:
            names = ", ".join(short_name(name) for name in wide[:4]) + (", …" if len(wide) > 4 else "")
            notes = (f"highlights narrower than harmonics of order {order} hold widened: {names}", *notes)
        return cls(order, rows, seen, lobes, notes, time.perf_counter() - began)

    def bouncing(self, scene: Scene) -> Scene:
        """The scene with an albedo of glossy vertices by which they send on all the light that they reflect.

        Light bounces as if all surfaces were diffuse; by this albedo at least no energy is lost.
        """
        albedo, tint = scene.albedo.copy(), (scene.albedo if scene.tint is None else scene.tint).copy()
        before = albedo[self.rows]
        ratio = np.divide(self.lobes.reflectance, before, out=np.ones_like(before), where=before > 1e-6)
        albedo[self.rows] = self.lobes.reflectance
        tint[self.rows] *= ratio
        return replace(scene, albedo=albedo, tint=None if scene.tint is None else tint)


@dataclass(frozen=True)
class ExitantPlan:
    """What a glossy part will cost; nothing where there is none."""

    rows: int = 0
    rays: int = 0
    seconds: float = 0.0
    bytes: int = 0
    milliseconds: float = 0.0  # of a change of light


def plan_exitant(scene: Scene, order: int) -> ExitantPlan:
    """Estimate a glossy part; nothing for order 0."""
    if not order:
        return ExitantPlan()
    rows = len(glossy_rows(scene))
    cells = 6 * CELLS * CELLS // 2
    materials = len(scene.materials)
    table = 90 * 3 * 4 * (order + 1) * (order + 2) // 2
    rays = rows * cells * SUBRAYS
    return ExitantPlan(
        rows=rows,
        rays=rays,
        seconds=rays / _RAYS_A_SECOND + 0.5 * materials if rows else 0.0,
        bytes=rows * (cells * _BYTES_PER_CELL + _BYTES_PER_ROW) + (materials * table if rows else 0),
        milliseconds=milliseconds(rows, order),
    )


def check_order(order: object, *, least: int = 1) -> int:
    """Raises InputError unless it is a whole number up to 16."""
    if type(order) is not int or not least <= order <= MOST_ORDER:
        raise InputError("glossy-order", f"{order!r}, expected a whole number from {least} to {MOST_ORDER}")
    return order


def write_exitant(writer: BakeWriter, at: str, part: ExitantPart) -> dict[str, Any]:
    """Chunks below ``at``: ``{"arrays": …, "chunks": …, "statistics": …}`` for a journal's line or a manifest."""
    lobes, seen = part.lobes, part.seen
    parts = {
        "rows": part.rows,
        "counts": seen.counts,
        "texels": seen.texels,
        "codes": seen.codes,
        "lobe_of": lobes.lobe_of,
        "lobes": lobes.tables,
        "highlights": lobes.highlights.reshape(
            *lobes.highlights.shape[:3], -1
        ),  # an array has four axes at most
        "matt": lobes.matt,
        "strength": lobes.strength,
        "reflectance": lobes.reflectance,
    }
    if seen.panes is not None:
        parts["panes"] = seen.panes
    chunks, arrays = {}, {}
    for name, values in parts.items():
        whole = values if values.size else np.zeros(1, values.dtype)  # an array has no empty shape
        shape = list(whole.shape)
        spec = ArraySpec(shape=shape, dtype=whole.dtype.name, chunk_shape=shape)
        key, record = writer.write_chunk(f"{at}/{name}", (0,) * whole.ndim, whole, spec)
        chunks[key], arrays[f"{at}/{name}"] = record.model_dump(), spec.model_dump()
    statistics = {
        "glossy_rows": len(part.rows),
        "glossy_rays": part.seen.rays,
        "glossy_cells": len(part.seen.texels),
        "glossy_fit_error": part.lobes.error,
    }
    return {"arrays": arrays, "chunks": chunks, "statistics": statistics, "rays": part.seen.rays}
