"""The bounced part of a layer as arrays on disk."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..encoding.modes import grouped, in_bytes
from ..storage.chunks import ArraySpec
from ..storage.journal import BakeWriter
from .bounced import HELD, BouncedPart
from .first_bounce import FirstBounce
from .scene_arrays import not_empty
from .zones import Zone

FIRST = ("order", "left", "colours", "sums", "scales", "counts", "steps", "codes")


def write_bounced(writer: BakeWriter, at: str, part: BouncedPart, zones: list[Zone]) -> dict[str, Any]:
    """Chunks below ``at``, and the line of the journal that says they are whole.

    Where every receiver is a Lambertian vertex, what light at a vertex brings of each mode is kept too: with it the
    bounced light of a light that is traced when relighting follows from its own shadows, not from its cell.
    """
    stored = np.concatenate([zone.stored_rows() for zone in zones])
    modes, scales = in_bytes(part.modes)
    parts = {
        "cells": part.cells,
        "modes": grouped(np.where(stored[:, None] >= 0, modes[stored], np.int8(0))),
        "scales": scales,
        "weights": part.weights.astype(np.float32),
    }
    if all(zone.channels == 1 for zone in zones):
        found = [in_bytes(of_colour) for of_colour in part.sources]
        parts["sources"] = np.stack([values for values, _ in found])
        parts["source_scales"] = np.stack([scale for _, scale in found])
    first = part.first
    if first is not None:
        parts |= {f"first/{name}": not_empty(getattr(first, name)) for name in FIRST}
    caustics = part.caustics
    for name, sent_on in (("caustics", caustics), ("metal", part.metal)):
        if sent_on is not None:
            parts |= {f"{name}/{of}": values for of, values in sent_on.in_bytes().items()}
    chunks, arrays = {}, {}
    for name, values in parts.items():
        shape = list(values.shape)
        spec = ArraySpec(shape=shape, dtype=values.dtype.name, chunk_shape=shape)
        key, record = writer.write_chunk(f"{at}/{name}", (0,) * values.ndim, values, spec)
        chunks[key], arrays[f"{at}/{name}"] = record.model_dump(), spec.model_dump()
    return {
        "bounced": {
            "bounced_modes": len(scales),
            "bounced_cells": len(part.cells),
            "bounced_products": part.bounces,
            "bounced_remaining": min(part.remaining, 1e9),
            "bounced_left_out": part.left_out,
            "bounced_rays": part.rays,
            "bounced_entries": part.entries,
            "bounced_held": part.held,
            **({"bounced_edge": part.edge} if part.held < HELD else {}),
            **({} if first is None else _said_of(first)),
            **(
                {}
                if caustics is None
                else {"caustic_noise": caustics.noise, "photons_traced": caustics.photons}
            ),
            **({} if part.metal is None else {"metal_rays": part.metal.photons}),
        },
        "rays": part.rays,
        "arrays": arrays,
        "chunks": chunks,
    }


def _said_of(first: FirstBounce) -> dict[str, int | float]:
    return {
        "bounced_first_entries": int(first.counts.sum(dtype=np.int64)),
        "bounced_first_threshold": first.threshold,
        "bounced_first_error": first.error,
    }
