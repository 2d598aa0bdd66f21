"""What the manifest says of an environment layer, checked before anything is read or allocated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .caustic_part import caustic_problem, sent_on_problem
from .chunks import ArraySpec
from .exitant_part import exitant_problem

MOST_ZONES = 4096 + 16  # by place, and of each sort at least one
MOST_PARCELS = 10_000
_MOST_PIXELS = 2048  # a side
_GROUP, _TILE, _PANEL = 32, 16, 256  # as in encoding.sparse_tiles
MOST_MODES = 256
MOST_CELLS = 6 * 256
_NUMBERS = ("resolution", "tolerance", "epsilon", "samples_per_side", "nonzero_share")
_BOUNCED_NUMBERS = (
    "gather_rays", "bounced_modes", "bounced_cells", "bounced_rays", "bounced_products", "bounced_remaining",
    "bounced_left_out",
)  # fmt: skip
_FIRST = {
    "order": "int32", "left": "float32", "colours": "float32", "sums": "float32", "scales": "float32",
    "counts": "uint16", "steps": "uint16", "codes": "int8",
}  # fmt: skip
_FIRST_NUMBERS = ("first_entries", "first_threshold", "first_error")
_MOST_ENTRIES = 65_535  # a row of the first bounce
_LARGEST = 1 << 40


def environment_problem(
    name: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec], *, coefficients: int, has_eye: bool
) -> str | None:
    """What is wrong with the arrays of layer ``name``, or with what its record says besides; None if nothing is.

    ``said`` are parameters and statistics. What is in the arrays is checked when they are opened.
    """
    for number in _NUMBERS:
        if not _is_number(said.get(number), _LARGEST):
            return f"layer {name!r} does not say its {number}"
    sun = said.get("sun_paths", "any")
    if sun != "any" and not (_is_number(sun, 90) or (type(sun) is float and _is_number(-sun, 90))):
        return f"layer {name!r} says its sun paths are {sun!r}, expected a latitude or any"
    if (rows := _rows(said, arrays)) is None:
        return f"layer {name!r} does not say what its receivers are"
    order, zones = (arrays.get(f"layers/{name}/{part}") for part in ("order", "zones"))
    if zones is None or zones.dtype != "int32" or zones.shape[1:] != [4] or zones.shape[0] > MOST_ZONES:
        return f"array layers/{name}/zones is not four int32 for each of at most {MOST_ZONES} zones"
    most = rows + (_GROUP - 1) * zones.shape[0]
    if order is None or order.dtype != "int32" or len(order.shape) != 1 or not rows <= order.shape[0] <= most:
        return (
            f"array layers/{name}/order is not one int32 for each of {rows} receivers, in groups of {_GROUP}"
        )
    if order.shape[0] % _GROUP:
        return f"array layers/{name}/order is not whole groups of {_GROUP}"
    problem = _parcel_problem(f"layers/{name}", arrays, coefficients=coefficients, has_eye=has_eye)
    problem = problem or _bounced_problem(
        f"layers/{name}/bounced", said, arrays, groups=order.shape[0] // _GROUP
    )
    problem = problem or caustic_problem(f"layers/{name}/bounced/caustics", said, arrays, rows=rows)
    problem = problem or sent_on_problem(
        f"layers/{name}/bounced/metal", arrays, rows=rows, expected=bool(said.get("metal_rays"))
    )
    return problem or exitant_problem(f"layers/{name}/glossy", said, arrays)


def _bounced_problem(
    at: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec], *, groups: int
) -> str | None:
    """Modes, weights and cells that fit each other, where the layer says that it has bounced light."""
    bounces = said.get("bounces", 0)  # version 2 knew none
    if not (bounces == "all" or (type(bounces) is int and 0 <= bounces <= _LARGEST)):
        return f"{at}: bounces are {bounces!r}, expected all or a whole number"
    if bounces == 0:
        return None
    for number in _BOUNCED_NUMBERS:
        if not _is_number(said.get(number), _LARGEST):
            return f"{at}: the layer does not say its {number}"
    parts = {"cells": "int32", "modes": "int8", "scales": "float32", "weights": "float32"}
    for part, dtype in parts.items():
        if (spec := arrays.get(f"{at}/{part}")) is None or spec.dtype != dtype:
            return f"array {at}/{part} is not there as {dtype}"
    cells, modes, scales, weights = (arrays[f"{at}/{part}"].shape for part in parts)
    count = scales[0]
    if len(scales) != 1 or count > MOST_MODES or modes != [groups, count, _GROUP]:
        return f"array {at}/modes is not {_GROUP} bytes for each of {groups} groups and at most {MOST_MODES} modes"
    if len(cells) != 2 or cells[1] != 5 or cells[0] > MOST_CELLS:
        return f"array {at}/cells is not five int32 for each of at most {MOST_CELLS} cells"
    if weights[1:] != [count, cells[0]] or weights[0] not in (1, 3):
        return f"array {at}/weights does not fit its modes and cells"
    if problem := first_problem(f"{at}/first", said, arrays):
        return problem
    sources, of_source = (arrays.get(f"{at}/{part}") for part in ("sources", "source_scales"))
    if sources is None and of_source is None:
        has_first = f"{at}/first/order" in arrays
        return f"array {at}/first is there without its sources" if has_first else None
    vertices = arrays["scene/positions"].shape[0]
    if (
        sources is None
        or of_source is None
        or (sources.dtype, of_source.dtype) != ("int8", "float32")
        or sources.shape != [weights[0], vertices, count]
        or of_source.shape != [weights[0], count]
    ):
        return f"array {at}/sources does not fit its modes and {vertices} vertices"
    return None


def first_problem(
    at: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec], *, prefix: str = "bounced_"
) -> str | None:
    """Eight arrays of the first bounce that fit each other, or none of them; numbers of it are said with a prefix."""
    found = {name.removeprefix(f"{at}/"): spec for name, spec in arrays.items() if name.startswith(f"{at}/")}
    if not found:
        return None
    if {name: spec.dtype for name, spec in found.items()} != _FIRST:
        return f"arrays of {at} are not {', '.join(_FIRST)} of their types"
    for number in (prefix + name for name in _FIRST_NUMBERS):
        if not _is_number(said.get(number), _LARGEST):
            return f"{at}: the layer does not say its {number}"
    vertices = arrays["scene/positions"].shape[0]
    for name in ("order", "sums", "scales", "counts"):
        if found[name].shape != [vertices]:
            return f"array {at}/{name} is not one for each of {vertices} vertices"
    if found["left"].shape != [tree_size(vertices)]:
        return f"array {at}/left is not one for each node over {vertices} vertices"
    if found["colours"].shape != [vertices, 3]:
        return f"array {at}/colours is not three for each of {vertices} vertices"
    steps, codes = found["steps"].shape, found["codes"].shape
    if steps != codes or len(steps) != 1 or steps[0] != max(1, said[prefix + "first_entries"]):
        return f"arrays {at}/steps and codes are not one for each entry"
    if steps[0] > vertices * _MOST_ENTRIES:
        return f"array {at}/steps has more than {_MOST_ENTRIES:,} entries a row"
    return None


def tree_size(vertices: int) -> int:
    """Leaves of a binary tree over so many: a power of two, at least 2."""
    return 1 << max(vertices - 1, 1).bit_length()


def _rows(said: Mapping[str, Any], arrays: Mapping[str, ArraySpec]) -> int | None:
    if said.get("receivers") == "vertices":
        return arrays["scene/positions"].shape[0]
    if said.get("receivers") != "pixels" or not _is_number(said.get("samples"), 64):
        return None
    width, height = said.get("width"), said.get("height")
    if type(width) is not int or type(height) is not int:
        return None
    return width * height if 1 <= width <= _MOST_PIXELS and 1 <= height <= _MOST_PIXELS else None


def _parcel_problem(
    at: str, arrays: Mapping[str, ArraySpec], *, coefficients: int, has_eye: bool
) -> str | None:
    """Four arrays for every parcel, numbered without a gap, of shapes that fit each other."""
    parcels = sum(array.startswith(f"{at}/rectangles/") for array in arrays)
    if not 1 <= parcels <= MOST_PARCELS:
        return f"{at} has {parcels} parcels, expected 1 to {MOST_PARCELS}"
    clusters = 0
    for q in range(parcels):
        parts = ("rectangles", "scales", "present", "tiles")
        found = [spec for part in parts if (spec := arrays.get(f"{at}/{part}/{q:05d}"))]
        if [spec.dtype for spec in found] != ["int32", "float32", "uint16", "uint8"]:
            return f"parcel {q} of {at} is not rectangles, scales, present and tiles of their types"
        rectangles, scales, present, tiles = (spec.shape for spec in found)
        clusters += rectangles[0]
        if rectangles[1:] != [5] or scales[:1] != rectangles[:1] or scales[1:] not in ([1], [3]):
            return f"rectangles and scales of parcel {q} of {at} do not fit"
        if scales[1] == 3 and not has_eye:
            return f"{at} has colours without an eye"
        if len(present) != 2 or present[0] != -(-rectangles[0] // _PANEL) or present[1] % scales[1]:
            return f"presence of parcel {q} of {at} does not fit"
        if tiles[1:] != [_TILE, _GROUP] or tiles[0] > max(1, present[0] * present[1] * (_PANEL // _TILE)):
            return f"tiles of parcel {q} of {at} do not fit"
    if clusters != coefficients:
        return f"{at} has {clusters} clusters, its record says {coefficients}"
    return None


def _is_number(value: object, most: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 <= value <= most
