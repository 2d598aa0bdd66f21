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
    for text in ("basis", "place", "lamp", "left_out"):
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
    if problem := _bright_problem(
        f"layers/{name}", arrays, coefficients=coefficients, pixels=_BLOCK * blocks
    ):
        return problem
    pixels = said["width"] * said["height"]
    if problem := _deep_problem(f"layers/{name}", arrays, pixels=pixels):
        return problem
    mixing = shapes["mixing"]
    if len(mixing) != 2 or mixing[0] != coefficients or mixing[1] > MOST_PLANES:
        return f"array layers/{name}/mixing is {mixing}, expected {coefficients} rows"
    if len(shapes["singular_values"]) != 1:
        return f"array layers/{name}/singular_values is not a list of numbers"
    return None


def _bright_problem(
    at: str, arrays: Mapping[str, ArraySpec], *, coefficients: int, pixels: int
) -> str | None:
    """Of the pixels that are kept apart; both arrays are absent where no pixel is that bright."""
    bright, values = (arrays.get(f"{at}/{part}") for part in ("bright", "bright_values"))
    if bright is None and values is None:
        return None
    if bright is None or values is None or (bright.dtype, values.dtype) != ("int32", "float32"):
        return f"arrays {at}/bright and bright_values are not int32 and float32"
    if len(bright.shape) != 1 or bright.shape[0] > pixels:
        return f"array {at}/bright is {bright.shape}, expected one number for each bright pixel"
    if values.shape != [3, coefficients, bright.shape[0]]:
        return f"array {at}/bright_values is {values.shape}, expected [3, {coefficients}, {bright.shape[0]}]"
    return None


def _deep_problem(at: str, arrays: Mapping[str, ArraySpec], *, pixels: int) -> str | None:
    """Of the first bounce that is kept apart; absent where none is, or where no light arrives."""
    found = [arrays.get(f"{at}/deep_{part}") for part in ("starts", "colours", "directions")]
    places = arrays.get(f"{at}/deep_places")
    specs = [spec for spec in (*found, places) if spec is not None]
    if not specs:
        return None
    types = [spec.dtype for spec in specs]
    if None in found or types != ["int64", "float32", "uint16", "uint16"][: len(specs)]:
        return (
            f"arrays {at}/deep_starts, deep_colours, deep_directions and deep_places are not of their types"
        )
    starts, colours, *pairs = (spec.shape for spec in specs)
    if starts != [pixels + 1] or colours[1:] != [3] or any(pair != [colours[0], 2] for pair in pairs):
        return f"arrays {at}/deep_starts, deep_colours, deep_directions and deep_places do not fit"
    return None
