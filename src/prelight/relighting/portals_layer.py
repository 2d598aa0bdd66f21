"""Reading a layer of portals, every number checked that a kernel follows."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from ..arrays import Float32, Int32, Int64, UInt8
from ..encoding.pulse_or_haar import RunRows
from ..errors import DamagedBakeError, InputError
from ..storage.bake import Bake
from .first_bounce import FirstBounce, read_first_bounce
from .portal_openings import Openings, read_openings

KIND = "portals"
_LARGEST = 1e12


@dataclass(frozen=True)
class PortalsLayer:
    """T of a room through its portals; what its arrays mean is in docs/bake-format.md."""

    name: str
    names: tuple[str, ...]
    centres: Float32[np.ndarray, "portals 3"]
    areas: Float32[np.ndarray, "portals"]
    outward: Float32[np.ndarray, "portals 3"]
    tints: Float32[np.ndarray, "portals 3"]
    portal_of_pane: Int32[np.ndarray, "panes"]
    pane_tints: Float32[np.ndarray, "panes 3"]
    pane_rows: Int64[np.ndarray, "panes_and_one"]
    receiver: Int32[np.ndarray, "rows"]
    rows: RunRows
    glass: Int32[np.ndarray, "some"]  # vertices of glass alone, and which portal's
    glass_portal: Int32[np.ndarray, "some"]
    modes: np.ndarray | None  # (groups, m, 32) int8; None without bounces
    scales: Float32[np.ndarray, "vertices"] | None
    weights: Float32[np.ndarray, "portals functions colours modes"] | None
    energy: Float32[np.ndarray, "portals orders colours"] | None
    first: FirstBounce | None = None  # one bounce of what falls on vertices: for suns
    most: int | None = None  # bounces; all, if not said
    openings: Openings | None = None  # for rays to suns
    pane_caustic: UInt8[np.ndarray, "panes"] | None = (
        None  # 1: holds what glass and mirrors in the room send on
    )

    @property
    def cube(self) -> int:
        """Cells along a face."""
        return self.rows.resolution

    @property
    def has_haar(self) -> bool:
        """Whether any row is of Haar coefficients."""
        return bool(self.rows.kind.any())

    @property
    def order(self) -> int:
        """Of the harmonics that bounced light is kept in; −1 without."""
        return -1 if self.weights is None else round(self.weights.shape[1] ** 0.5) - 1


def portals_layer_name(bake: Bake, name: str | None = None) -> str:
    """The layer of that name, or the first of portals. Raises InputError."""
    for known, record in bake.layers.items():
        if record.kind == KIND and name in (None, known):
            return known
    what = (
        f"has no layer of portals {name!r}"
        if name
        else "has no layer of portals; make one: prelight bake portals"
    )
    raise InputError(bake.path, what)


def read_portals(bake: Bake, name: str | None = None) -> PortalsLayer:
    """Raises InputError if there is none, DamagedBakeError; shapes are checked with the manifest."""
    name = portals_layer_name(bake, name)
    at, record = f"layers/{name}", bake.layers[name]

    def wrong(what: str) -> NoReturn:
        raise DamagedBakeError(bake.path, f"{at}/{what}")

    def array(part: str) -> np.ndarray:
        values = bake.array(f"{at}/{part}")
        if values.dtype == np.float32 and not (np.abs(values) <= _LARGEST).all():
            wrong(f"{part} has values that are no numbers, or too large")
        return values

    floats = {part: array(part) for part in ("centres", "areas", "outward", "tints", "pane_tints")}
    for part in ("areas", "tints", "pane_tints"):
        if (floats[part] < 0).any():
            wrong(f"{part} has values below 0")
    names = _names(record.parameters.get("names"), len(floats["areas"]))
    if names is None:
        wrong("areas are not as many as the layer's names")
    rows = _read_rows(bake, at, record.parameters["cube"])
    of_pane, pane_rows, receiver = (array(part) for part in ("portal_of_pane", "pane_rows", "receiver"))
    caustic = np.zeros(len(of_pane), np.uint8)
    if f"{at}/pane_caustic" in bake.manifest.arrays:
        caustic = array("pane_caustic")
        if not _ascends(caustic, 0, 1) or caustic[0] != 0:
            wrong("pane_caustic is not zeros, then ones")
        plain = int((caustic == 0).sum())
        if len(caustic) - plain not in (plain, 3 * plain):
            wrong("pane_caustic has not one or three panes for each other one")
    if not all(_ascends(of_pane[caustic == k], 0, len(names) - 1) for k in np.unique(caustic)):
        wrong("portal_of_pane names portals that do not exist")
    if pane_rows[0] != 0 or not _ascends(pane_rows, 0, len(receiver)) or pane_rows[-1] != len(receiver):
        wrong("pane_rows do not ascend from 0 to the number of rows")
    vertices = len(bake.receivers)
    if not _within(receiver, vertices):
        wrong("receiver names vertices that do not exist")
    glass = glass_portal = np.zeros(0, np.int32)
    if f"{at}/glass" in bake.manifest.arrays:
        glass, glass_portal = array("glass"), array("glass_portal")
        if not (_ascends(glass, 0, vertices - 1) and _within(glass_portal, len(names))):
            wrong("glass names vertices or portals that do not exist")
    has_bounces = record.parameters.get("bounces") != 0
    bounced = {
        p: array(f"bounced/{p}") if has_bounces else None for p in ("modes", "scales", "weights", "energy")
    }
    return PortalsLayer(
        name, names, floats["centres"], floats["areas"], floats["outward"], floats["tints"], of_pane,
        floats["pane_tints"], pane_rows, receiver, rows,
        glass, glass_portal, **bounced, first=read_first_bounce(bake, f"{at}/bounced/first", weighed=True),
        most=most if type(most := record.parameters.get("bounces")) is int else None,
        openings=read_openings(bake, f"{at}/openings", panes=int((caustic == 0).sum())),
        pane_caustic=caustic,
    )  # fmt: skip


def _read_rows(bake: Bake, at: str, cube: object) -> RunRows:
    """Rows whose runs lie within the cells of the cube."""

    def wrong(what: str) -> NoReturn:
        raise DamagedBakeError(bake.path, f"{at}/{what}")

    assert isinstance(cube, int)  # storage.portals_layer
    kind, scale, row_runs, runs, data = (
        bake.array(f"{at}/{part}") for part in ("kind", "scale", "row_runs", "runs", "data")
    )
    if kind.max() > 1:
        wrong("kind is neither 0 nor 1")
    if not ((scale >= 0) & (scale <= _LARGEST)).all():
        wrong("scale has values that are no numbers, below 0 or too large")
    if row_runs[0] != 0 or not _ascends(row_runs, 0, len(runs)) or row_runs[-1] != len(runs):
        wrong("row_runs do not ascend from 0 to the number of runs")
    if runs.sum(axis=1, dtype=np.int64).max() > 6 * cube * cube:
        wrong("runs reach beyond the cells of the cube")
    if runs[:, 1].sum(dtype=np.int64) != len(data):
        wrong("runs are not as long as data")
    return RunRows(cube, kind, scale, row_runs, runs, data)


def _names(text: object, count: int) -> tuple[str, ...] | None:
    try:
        names = json.loads(text) if isinstance(text, str) else None
    except (ValueError, RecursionError):
        return None
    if not isinstance(names, list) or len(names) != count or not all(isinstance(name, str) for name in names):
        return None
    return tuple(names)


def _ascends(values: np.ndarray, least: int, most: int) -> bool:
    return bool((np.diff(values) >= 0).all() and values[0] >= least and values[-1] <= most)


def _within(values: np.ndarray, count: int) -> bool:
    return bool((values >= 0).all() and (values < count).all())
