"""What the manifest says of a layer of portals, checked before anything is read or allocated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .chunks import ArraySpec
from .environment_layer import first_problem
from .exitant_part import exitant_problem

MOST_PORTALS = 1024
MOST_PANES = 16384
CUBES = (4, 8, 16, 32, 64)
MOST_ORDER = 12
MOST_MODES = 512
_GROUP = 32  # as in encoding.sparse_tiles
_MOST_TEXT = 300_000
_DTYPES = {
    "centres": "float32", "areas": "float32", "extents": "float32", "outward": "float32", "tints": "float32",
    "portal_of_pane": "int32", "pane_tints": "float32", "pane_rows": "int64", "receiver": "int32", "kind": "uint8",
    "scale": "float32", "row_runs": "int64", "runs": "uint16", "data": "uint8",
}  # fmt: skip


def portals_problem(
    name: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec], *, coefficients: int, has_eye: bool
) -> str | None:
    """What is wrong with the arrays of layer ``name``, or with what its record says besides; None if nothing is.

    ``said`` are its parameters. What is in the arrays and texts is checked when they are opened.
    """
    at = f"layers/{name}"
    if has_eye:
        return f"layer {name!r} has an eye, which portals have not"
    if said.get("cube") not in CUBES or type(said.get("cube")) is not int:
        return f"layer {name!r} does not say its cube"
    if not isinstance(said.get("names"), str) or len(said["names"]) > _MOST_TEXT:
        return f"layer {name!r} does not say its names"
    shapes = {}
    for part, dtype in _DTYPES.items():
        spec = arrays.get(f"{at}/{part}")
        if spec is None or spec.dtype != dtype:
            return f"array {at}/{part} is not of {dtype}"
        shapes[part] = spec.shape
    P, N, n = shapes["areas"][0], shapes["portal_of_pane"][0], shapes["kind"][0]
    if P > MOST_PORTALS or not P <= N <= MOST_PANES:
        return f"layer {name!r} has {P} portals and {N} panes"
    expected = {
        "centres": [P, 3], "areas": [P], "extents": [P], "outward": [P, 3], "tints": [P, 3], "portal_of_pane": [N],
        "pane_tints": [N, 3], "pane_rows": [N + 1], "receiver": [n], "kind": [n], "scale": [n], "row_runs": [n + 1],
    }  # fmt: skip
    for part, shape in expected.items():
        if shapes[part] != shape:
            return f"array {at}/{part} is {shapes[part]}, expected {shape}"
    if len(shapes["runs"]) != 2 or shapes["runs"][1] != 2 or len(shapes["data"]) != 1:
        return f"arrays {at}/runs and data are not pairs, and bytes"
    caustic = arrays.get(f"{at}/pane_caustic")
    if caustic is not None and (caustic.dtype != "uint8" or caustic.shape != [N]):
        return f"array {at}/pane_caustic is not uint8, one for each of {N} panes"
    vertices = arrays["scene/positions"].shape[0]
    return (
        _glass_problem(at, arrays, vertices=vertices)
        or _openings_problem(f"{at}/openings", arrays, vertices=vertices)
        or _indirect_problem(f"{at}/bounced", said, arrays, portals=P, vertices=vertices)
        or exitant_problem(f"{at}/glossy", said, arrays)
    )


def _glass_problem(at: str, arrays: Mapping[str, ArraySpec], *, vertices: int) -> str | None:
    """Vertices of glass; absent where portals are polygons."""
    found = [spec for part in ("glass", "glass_portal") if (spec := arrays.get(f"{at}/{part}")) is not None]
    if not found:
        return None
    shapes = [spec.shape for spec in found]
    fits = len(found) == 2 and shapes[0] == shapes[1] and all(spec.dtype == "int32" for spec in found)
    if not fits or len(shapes[0]) != 1 or shapes[0][0] > vertices:
        return f"arrays {at}/glass and glass_portal are not int32 each, at most one a vertex"
    return None


def _openings_problem(at: str, arrays: Mapping[str, ArraySpec], *, vertices: int) -> str | None:
    """The portals' triangles and where vertices look from; absent in bakes of earlier versions."""
    corners, pane_of, origins, glass = (
        arrays.get(f"{at}/{part}") for part in ("corners", "pane_of", "origins", "glass_triangles")
    )
    if corners is None and pane_of is None and origins is None and glass is None:
        return None
    if corners is None or pane_of is None or origins is None:
        return f"of {at} corners, pane_of or origins are missing"
    if corners.dtype != "float32" or len(corners.shape) != 3 or corners.shape[1:] != [3, 3]:
        return f"array {at}/corners is not of float32, three corners of three each"
    if pane_of.dtype != "int32" or pane_of.shape != corners.shape[:1]:
        return f"array {at}/pane_of is not int32, one for each of the corners"
    if origins.dtype != "float32" or origins.shape != [vertices, 3]:
        return f"array {at}/origins is not float32, three for each vertex"
    beyond = arrays.get(f"{at}/beyond")
    if beyond is not None and (beyond.dtype != "int32" or beyond.shape != [vertices]):
        return f"array {at}/beyond is not int32, one for each vertex"
    if glass is not None:
        most = arrays["scene/triangles"].shape[0]
        if glass.dtype != "int32" or len(glass.shape) != 1 or glass.shape[0] >= most:
            return f"array {at}/glass_triangles is not of int32, fewer than the triangles"
    return None


def _indirect_problem(
    at: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec], *, portals: int, vertices: int
) -> str | None:
    """Modes, scales and weights that fit each other; absent without bounces."""
    bounces = said.get("bounces")
    if not (bounces == "all" or (type(bounces) is int and bounces >= 0)):
        return f"{at}: bounces are {bounces!r}, expected all or a whole number"
    if bounces == 0:
        return None
    order = said.get("order")
    if type(order) is not int or not 0 <= order <= MOST_ORDER:
        return f"{at}: the order is {order!r}, expected 0 to {MOST_ORDER}"
    shapes = {}
    for part, dtype in (
        ("modes", "int8"),
        ("scales", "float32"),
        ("weights", "float32"),
        ("energy", "float32"),
    ):
        spec = arrays.get(f"{at}/{part}")
        if spec is None or spec.dtype != dtype:
            return f"array {at}/{part} is not of {dtype}"
        shapes[part] = spec.shape
    weights = shapes["weights"]
    if len(weights) != 4 or weights[2] not in (1, 3) or not 1 <= weights[3] <= MOST_MODES:
        return f"array {at}/weights is {weights}, expected portals, functions, 1 or 3 colours, modes"
    expected = {
        "weights": [portals, (order + 1) ** 2, weights[2], weights[3]],
        "modes": [-(-vertices // _GROUP), weights[3], _GROUP], "scales": [vertices],
        "energy": [portals, order + 1, weights[2]],
    }  # fmt: skip
    for part, shape in expected.items():
        if shapes[part] != shape:
            return f"array {at}/{part} is {shapes[part]}, expected {shape}"
    return first_problem(f"{at}/first", said, arrays)
