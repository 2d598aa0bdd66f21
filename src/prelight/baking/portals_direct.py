"""Direct light through portals, baked some receivers at a time; what is done is kept for a bake that is stopped."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Float32, Int32, Int64, UInt8
from ..bases.harmonic_cells import cell_harmonics
from ..encoding.pulse_or_haar import Choice, RunRows, encoded, slots_for
from ..storage.chunks import ChunkRecord, open_chunk
from ..storage.journal import BakeWriter
from .portals_room import PortalsRoom
from .scene_arrays import whole

LANES = 1 << 22  # rays of a tile, about
_PARTS = ("receiver", "pane", "kind", "scale", "counts", "runs", "data", "figures")

Share = Callable[[float], None]


@dataclass(frozen=True)
class DirectLight:
    """T of direct light: a row over the cells of the cube for every receiver that a pane is seen from.

    Attributes
    ----------
    rows
        Pane after pane, by receiver in each.
    receiver
        ``(n,)`` of each row.
    pane_rows
        ``(panes + 1,)`` where the rows of each pane begin.
    choice
        Of pulses or Haar.
    rays
        That were sent.
    portal_of_pane, pane_tints, pane_caustic
        ``(panes,)``, ``(panes, 3)`` and ``(panes,)``: the portals' panes, then where glass or a mirror in the room
        sends their light on, as many again (or three times as many, a colour each) that hold what it sends, marked 1.
    """

    rows: RunRows
    receiver: Int32[np.ndarray, "n"]
    pane_rows: Int64[np.ndarray, "panes_and_one"]
    choice: Choice
    rays: int
    portal_of_pane: Int32[np.ndarray, "panes"]
    pane_tints: Float32[np.ndarray, "panes 3"]
    pane_caustic: UInt8[np.ndarray, "panes"]

    def harmonics(
        self, room: PortalsRoom, portal: int, bands: slice, *, channels: int, functions: int
    ) -> Float32[np.ndarray, "receivers functions channels"]:
        """Irradiance / π at receivers of the spherical harmonics ``bands`` (of so many), seen through one portal."""
        means, _ = cell_harmonics(round(functions**0.5) - 1, self.rows.resolution)
        columns = np.ascontiguousarray(means[:, bands])
        out = np.zeros((len(room.scene.positions), columns.shape[1], channels), np.float32)
        for pane in np.flatnonzero(self.portal_of_pane == portal):
            first, last = int(self.pane_rows[pane]), int(self.pane_rows[pane + 1])
            found = self.rows.times(columns, first, last)
            out[self.receiver[first:last]] += found[:, :, None] * self.pane_tints[pane, None, None, :channels]
        return out


def bake_direct(room: PortalsRoom, writer: BakeWriter, report: Share) -> DirectLight:
    """Trace what the journal does not have yet."""
    count = len(room.scene.positions)
    step = rows_of_tile(room)
    firsts = range(0, count, step)
    kept = {entry["tile"]: entry for entry in writer.entries if "tile" in entry}
    entries = []
    for k, first in enumerate(firsts):
        if k not in kept:
            began = time.perf_counter()
            parts, sent = _tile(room, k, slice(first, min(first + step, count)))
            kept[k] = _keep(writer, k, parts, {"rays": sent, "began": began})
        entries.append(kept[k])
        report((k + 1) / len(firsts))
    tiles = [_read(writer, entry) for entry in entries]
    return _gathered(tiles, room, rays=sum(entry["rays"] for entry in entries))


def rows_of_tile(room: PortalsRoom) -> int:
    """Receivers of a tile: so many as their rays, and the rows made of them, are given room."""
    return max(16, min(LANES // room.settings.rays, slots_for(room.settings.cube) // room.rays.panes))


def _tile(room: PortalsRoom, number: int, some: slice) -> tuple[dict[str, np.ndarray], int]:
    found, receivers = room.rays.trace(some.start, some.stop - some.start), room.order[some]
    # Pairs that no ray comes through, most of them where there are many panes, make no rows.
    seen = np.add.reduceat(np.append(found.weight, 0), found.starts[:-1]) * (np.diff(found.starts) > 0)
    lit = np.flatnonzero(seen > 0)
    parts = {name: [] for name in _PARTS}
    panes, cube = room.rays.panes, room.settings.cube
    _encode(found, lit, receivers, range(panes), cube, parts)
    if room.caustics is not None:
        sent_on = room.caustics.rows(receivers.astype(np.int64), cube, number=number)
        more = range(panes, panes * (1 + room.caustics.colours))
        _encode(sent_on, np.flatnonzero(np.diff(sent_on.starts)), receivers, more, cube, parts)
    return {name: np.concatenate(values) for name, values in parts.items()}, found.rays


def _encode(
    found: Any, lit: np.ndarray, receivers: np.ndarray, panes: range, cube: int, parts: dict[str, list]
) -> None:
    """Rows of the pairs (receiver, one of these panes) that are lit."""
    step = slots_for(cube)
    for begin in range(0, max(len(lit), 1), step):
        pairs = lit[begin : begin + step]
        lengths = np.diff(found.starts)[pairs]
        starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        lane = np.repeat(found.starts[pairs] - starts[:-1], lengths) + np.arange(starts[-1])
        rows, kept, figures = encoded(starts, found.cell[lane], found.weight[lane], cube)
        receiver, pane = np.divmod(pairs[kept], len(panes))
        for name, values in (
            ("receiver", receivers[receiver]), ("pane", panes.start + pane), ("kind", rows.kind), ("scale", rows.scale),
            ("counts", np.stack([np.diff(rows.row_runs), np.diff(rows.row_bytes)], axis=1).astype(np.int32)),
            ("runs", rows.runs), ("data", rows.data), ("figures", figures[kept]),
        ):  # fmt: skip
            parts[name].append(values)


_TYPES = {
    "receiver": np.int32, "pane": np.int32, "kind": np.uint8, "scale": np.float32, "counts": np.int32,
    "runs": np.uint16, "data": np.uint8, "figures": np.float32,
}  # fmt: skip


def _keep(
    writer: BakeWriter, tile: int, parts: dict[str, np.ndarray], told: dict[str, Any]
) -> dict[str, Any]:
    """Chunks that the finished bake will not have, and the journal's line about them."""
    chunks = {}
    for name, values in parts.items():
        if not len(values):
            continue
        own = np.ascontiguousarray(values, _TYPES[name])
        key, record = writer.write_chunk(f"tracing/{tile:06d}/{name}", (0,) * own.ndim, own, whole(own))
        chunks[key] = record.model_dump()
    shapes = {name: list(values.shape) for name, values in parts.items()}
    seconds = time.perf_counter() - told["began"]
    entry = {"tile": tile, "rays": told["rays"], "shapes": shapes, "chunks": chunks, "seconds": seconds}
    writer.append(entry)
    return entry


def _read(writer: BakeWriter, entry: dict[str, Any]) -> dict[str, np.ndarray]:
    out = {}
    for name, shape in entry["shapes"].items():
        empty = np.zeros(shape, _TYPES[name])
        key = f"tracing/{entry['tile']:06d}/{name}/c/" + "/".join(["0"] * len(shape))
        out[name] = empty
        if shape[0]:
            out[name] = open_chunk(writer.partial, key, whole(empty), ChunkRecord(**entry["chunks"][key]))
    return out


def _gathered(tiles: list[dict[str, np.ndarray]], room: PortalsRoom, *, rays: int) -> DirectLight:
    """All tiles' rows, by pane and receiver."""
    whole_ = {name: np.concatenate([tile[name] for tile in tiles]) for name in _PARTS}
    row_runs = np.concatenate([[0], np.cumsum(whole_["counts"][:, 0], dtype=np.int64)])
    rows = RunRows(
        room.settings.cube, whole_["kind"], whole_["scale"], row_runs, whole_["runs"], whole_["data"]
    )
    order = np.lexsort((whole_["receiver"], whole_["pane"]))
    panes = _panes(room)
    pane_rows = np.searchsorted(whole_["pane"][order], np.arange(len(panes[0]) + 1)).astype(np.int64)
    choice = Choice.of(whole_["figures"].astype(np.float64))
    return DirectLight(rows.chosen(order), whole_["receiver"][order], pane_rows, choice, rays, *panes)


def _panes(room: PortalsRoom) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The portal of each pane, its tint, and whether it holds what glass and mirrors send on."""
    of, tints = room.portals.portal_of_pane, np.asarray(room.portals.pane_tints, np.float32)
    colours = 0 if room.caustics is None else room.caustics.colours
    shown = np.eye(3, dtype=np.float32) if colours == 3 else np.ones((colours, 3), np.float32)
    return (
        np.concatenate([of, np.repeat(of, colours)]).astype(np.int32),
        np.concatenate([tints, (tints[:, None] * shown).reshape(-1, 3)]),
        np.repeat(np.array([0, 1], np.uint8), [len(of), len(of) * colours]),
    )
