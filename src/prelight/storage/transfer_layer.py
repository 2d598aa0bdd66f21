"""What the manifest says of a transfer layer, checked before anything is read or allocated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .chunks import ArraySpec
from .environment_layer import MOST_MODES, first_problem
from .exitant_part import exitant_problem

MOST_BOUNCES = 3  # by the operator
_GROUP = 32  # as in encoding.sparse_tiles
_NUMBERS = ("gather_rays", "entries", "remaining", "left_out", "error", "worst_error", "held")
_LARGEST = 1 << 40
_DTYPES = {
    "origins": "float32", "modes": "int8", "scales": "float32", "sources": "int8", "source_scales": "float32",
}  # fmt: skip


def transfer_problem(
    name: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec], *, coefficients: int, has_eye: bool
) -> str | None:
    """What is wrong with the arrays of layer ``name``, or with what its record says besides; None if nothing is.

    ``said`` are parameters and statistics. What is in the arrays is checked when they are opened.
    """
    if has_eye:
        return f"layer {name!r} has an eye, which light at vertices has not"
    for number in _NUMBERS:
        value = said.get(number)
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value <= _LARGEST:
            return f"layer {name!r} does not say its {number}"
    if type(said.get("operator_bounces")) is not int or not 1 <= said["operator_bounces"] <= MOST_BOUNCES:
        return f"layer {name!r} does not say its operator_bounces, 1 to {MOST_BOUNCES}"
    at, shapes = f"layers/{name}", {}
    for part, dtype in _DTYPES.items():
        spec = arrays.get(f"{at}/{part}")
        if spec is None or spec.dtype != dtype:
            return f"array {at}/{part} is not there as {dtype}"
        shapes[part] = spec.shape
    vertices, count = arrays["scene/positions"].shape[0], coefficients
    colours = shapes["sources"][0]
    if not 1 <= count <= MOST_MODES or colours not in (1, 3):
        return f"layer {name!r} has {count} modes in {colours} colours, expected 1 to {MOST_MODES} in 1 or 3"
    expected = {
        "origins": [vertices, 3], "modes": [-(-vertices // _GROUP), count, _GROUP], "scales": [count],
        "sources": [colours, vertices, count], "source_scales": [colours, count],
    }  # fmt: skip
    for part, shape in expected.items():
        if shapes[part] != shape:
            return f"array {at}/{part} is {shapes[part]}, expected {shape}"
    if f"{at}/first/order" not in arrays:
        return f"array {at}/first/order is not there"
    problem = first_problem(f"{at}/first", said, arrays, prefix="")
    later = {f"first_{number}": said.get(f"later_{number}") for number in ("entries", "threshold", "error")}
    problem = problem or first_problem(f"{at}/later", later, arrays, prefix="")
    return problem or exitant_problem(f"{at}/glossy", said, arrays)
