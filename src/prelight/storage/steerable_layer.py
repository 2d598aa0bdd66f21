"""What the manifest says of a steerable layer, checked before anything is read or allocated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .chunks import ArraySpec

MOST_PIXELS = 2048  # a side
MOST_PLANES = 4096
_BLOCK = 64  # as in encoding.byte_planes
_MOST_TEXT = 100_000
_DTYPES = {
    "bytes": "int8", "scales": "float32", "image_of": "int32", "salience": "float32", "mixing": "float32",
    "singular_values": "float32",
}  # fmt: skip


def steerable_problem(
    name: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec], *, coefficients: int, has_eye: bool
) -> str | None:
    """What is wrong with the arrays of layer ``name``, or with what its record says besides; None if nothing is.

    ``said`` are its parameters. What is in the arrays and texts is checked when they are opened.
    """
    if not has_eye:
        return f"layer {name!r} has no eye"
    for side in ("width", "height"):
        if type(said.get(side)) is not int or not 1 <= said[side] <= MOST_PIXELS:
            return f"layer {name!r} does not say its {side}"
    for text in ("basis", "place", "lamp"):
        if not isinstance(said.get(text), str) or len(said[text]) > _MOST_TEXT:
            return f"layer {name!r} does not say its {text}"
    shapes = {}
    for part, dtype in _DTYPES.items():
        spec = arrays.get(f"layers/{name}/{part}")
        if spec is None or spec.dtype != dtype:
            return f"array layers/{name}/{part} is not of {dtype}"
        shapes[part] = spec.shape
    blocks = -(-said["width"] * said["height"] // _BLOCK)
    planes = shapes["image_of"][0]
    expected = {
        "bytes": [blocks, 3, planes, _BLOCK], "scales": [blocks, 3, planes], "image_of": [planes],
        "salience": [planes, 3],
    }  # fmt: skip
    for part, shape in expected.items():
        if shapes[part] != shape:
            return f"array layers/{name}/{part} is {shapes[part]}, expected {shape}"
    if planes > MOST_PLANES or not coefficients <= planes <= 2 * coefficients:
        return f"layer {name!r} has {planes} planes for {coefficients} components"
    bright, values = (arrays.get(f"layers/{name}/{part}") for part in ("bright", "bright_values"))
    if bright is not None or values is not None:  # neither where no pixel is that bright
        both = bright is not None and values is not None
        if not both or (bright.dtype, values.dtype) != ("int32", "float32") or len(bright.shape) != 1:
            return f"arrays layers/{name}/bright and bright_values are not int32 and float32"
        if bright.shape[0] > 64 * blocks or values.shape != [3, coefficients, bright.shape[0]]:
            return f"array layers/{name}/bright_values is {values.shape}, expected [3, {coefficients}, {bright.shape[0]}]"
    mixing = shapes["mixing"]
    if len(mixing) != 2 or mixing[0] != coefficients or mixing[1] > MOST_PLANES:
        return f"array layers/{name}/mixing is {mixing}, expected {coefficients} rows"
    if len(shapes["singular_values"]) != 1:
        return f"array layers/{name}/singular_values is not a list of numbers"
    return None
