"""What the manifest says of a layer's gloss (``layers/NAME/glossy``), whatever kind the layer is of; checked first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .chunks import ArraySpec

MOST_ORDER = 16
CELLS = 6 * 16 * 16  # that a vertex looks into
INCIDENT = 90  # angles of a lobe table
HIGHLIGHT = (48, 24, 9)  # nodes of a highlight table
_MOST_LOBES = 4096
_TYPES = {
    "rows": "int32", "counts": "uint16", "texels": "uint16", "codes": "int32", "lobe_of": "int32",
    "lobes": "float32", "highlights": "float32", "matt": "float32", "strength": "float32", "reflectance": "float32",
}  # fmt: skip


def exitant_problem(at: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec]) -> str | None:
    """What is wrong with the arrays below ``at``; None if nothing is, or there are none and none are said to be.

    ``said`` are the layer's parameters and statistics. What is in the arrays is checked when they are opened.
    """
    found = {name.removeprefix(f"{at}/"): spec for name, spec in arrays.items() if name.startswith(f"{at}/")}
    order = said.get("glossy_order", 0)
    if type(order) is not int or not 0 <= order <= MOST_ORDER:
        return f"{at}: its order is {order!r}, expected 0 to {MOST_ORDER}"
    if not found:
        return f"{at}: its arrays are missing" if order else None
    panes = found.pop("panes", None)
    texels = found.get("texels")
    if panes is not None and (texels is None or panes.dtype != "uint16" or panes.shape != texels.shape):
        return f"array {at}/panes is not one uint16 for each cell"
    if {name: spec.dtype for name, spec in found.items()} != _TYPES:
        return f"arrays of {at} are not {', '.join(_TYPES)} of their types"
    rows = found["rows"].shape
    if len(rows) != 1 or rows[0] > arrays["scene/positions"].shape[0]:
        return f"array {at}/rows is not one int32 for each glossy vertex"
    for name in ("counts", "lobe_of"):
        if found[name].shape != rows:
            return f"array {at}/{name} is not one for each of {rows[0]} vertices"
    for name in ("matt", "strength", "reflectance"):
        if found[name].shape != [*rows, 3]:
            return f"array {at}/{name} is not three for each of {rows[0]} vertices"
    cells = found["texels"].shape
    if len(cells) != 1 or found["codes"].shape != cells or cells[0] > rows[0] * CELLS:
        return f"arrays {at}/texels and codes are not one for each cell of {rows[0]} vertices"
    lobes, functions = found["lobes"].shape, (order + 1) * (order + 2) // 2
    if len(lobes) != 4 or lobes[1:] != [INCIDENT, 3, functions] or lobes[0] > _MOST_LOBES or not order:
        return f"array {at}/lobes is not {INCIDENT} × 3 × {functions} for each material of order {order}"
    halves, differences, azimuths = HIGHLIGHT
    if found["highlights"].shape != [lobes[0], halves, differences, 3 * azimuths]:
        expected = f"{halves} × {differences} × {3 * azimuths}"
        return f"array {at}/highlights is not {expected} for each of {lobes[0]} materials"
    return None
