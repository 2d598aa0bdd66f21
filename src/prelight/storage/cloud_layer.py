"""What the manifest says of a cloud layer, checked before anything is read or allocated."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from .chunks import ArraySpec
from .exitant_part import exitant_problem

MOST_LIGHTS, MOST_ZONES, MOST_PATCHES, MOST_CLUSTERS = 1 << 16, 1 << 16, 1 << 16, 1 << 20
_LARGEST = 1 << 40
_NUMBERS = (
    "in_solids", "remaining", "interpolation_error", "merged_error", "components_error", "error", "worst_error",
    "flux_scale", "step",
)  # fmt: skip
_CORNERS = tuple(f"{side}_{axis}" for side in ("low", "high") for axis in "xyz")
_DTYPES = {
    "grid": "float32", "kept_of": "int32", "lights": "float32", "group_of": "uint16", "origins": "float32",
    "order": "int32", "zone_rows": "int32", "clusters": "int32", "bases": "uint16", "base_scales": "float32",
    "code_scales": "float32",
}  # fmt: skip
_PATCHES = {"fluxes": "uint16", "patch_of": "int32", "areas": "float32"}
_MODES = {"fluxes": "uint16", "sources": "int8", "source_scales": "float32", "areas": "float32"}
CODES = {"bytes": "int8", "float16": "uint16"}
INTERPOLATIONS = ("fitted", "kernel")


def cloud_problem(
    name: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec], *, coefficients: int, has_eye: bool
) -> str | None:
    """What is wrong with the arrays of layer ``name``, or with what its record says besides; None if nothing is.

    ``said`` are its parameters and statistics. What is in the arrays is checked when they are opened.
    """
    if has_eye:
        return f"layer {name!r} has an eye, which light at vertices has not"
    for number in _NUMBERS:
        if not _is_number(said.get(number)) or said[number] < 0:
            return f"layer {name!r} does not say its {number}"
    for corner in _CORNERS:
        if not _is_number(said.get(corner)):
            return f"layer {name!r} does not say its {corner}"
    if said.get("interpolation") not in INTERPOLATIONS or said.get("codes") not in CODES:
        return f"layer {name!r} does not say its interpolation and its codes"
    patches = said.get("patches")
    if type(patches) is not int or not 0 <= patches <= MOST_PATCHES:
        return f"layer {name!r} does not say its patches"
    modes = said.get("modes", 0)
    if type(modes) is not int or not 0 <= modes <= MOST_PATCHES or (modes and patches):
        return f"layer {name!r} does not say its modes"
    if not (patches or modes) and said["interpolation"] == "fitted":
        return f"layer {name!r} has neither modes nor patches that its interpolation could be fitted on"
    if said.get("colours", 1) not in (1, 3):
        return f"layer {name!r} does not say its colours"
    at, shapes = f"layers/{name}", {}
    wanted = _DTYPES | {"codes": CODES[said["codes"]]} | (_PATCHES if patches else _MODES if modes else {})
    if f"{at}/zone_modes" in arrays and modes:
        wanted |= {"zone_modes": "int32", "source_order": "int32", "sources": "uint16"}
    for part, dtype in wanted.items():
        spec = arrays.get(f"{at}/{part}")
        if spec is None or spec.dtype != dtype:
            return f"array {at}/{part} is not there as {dtype}"
        shapes[part] = spec.shape
    problem = _shape_problem(at, shapes, arrays["scene/positions"].shape[0], patches or modes, coefficients)
    return problem or exitant_problem(f"{at}/glossy", said, arrays)


def _shape_problem(
    at: str, shapes: Mapping[str, list[int]], vertices: int, more: int, coefficients: int
) -> str | None:
    grid, lights, zones, clusters = (shapes[part][0] for part in ("grid", "lights", "zone_rows", "clusters"))
    if not (lights <= grid <= MOST_LIGHTS and zones <= MOST_ZONES and zones <= clusters <= MOST_CLUSTERS):
        return f"{at} has {grid} lights in {lights}, {zones} zones and {clusters} clusters"
    if len(shapes["clusters"]) != 2 or shapes["clusters"][1] not in (3, 5):
        return f"array {at}/clusters is {shapes['clusters']}, expected 3 or 5 numbers a cluster"
    expected = {
        "grid": [grid, 3], "kept_of": [grid], "lights": [lights, 4], "group_of": [zones, lights],
        "origins": [vertices, 3], "order": [vertices], "zone_rows": [zones],
    }  # fmt: skip
    if more:
        expected |= {"fluxes": [lights, more], "areas": [vertices]}
        expected |= {"patch_of": [vertices], "sources": [vertices, more], "source_scales": [more]}
        if "zone_modes" in shapes:
            blocks = -(-vertices // 64)
            expected |= {
                "source_scales": [blocks, more],
                "source_order": [vertices],
                "zone_modes": [zones, 2],
            }
    for part, shape in expected.items():
        if part in shapes and shapes[part] != shape:
            return f"array {at}/{part} is {shapes[part]}, expected {shape}"
    for part in ("bases", "base_scales", "codes", "code_scales"):
        if len(shapes[part]) != 1:
            return f"array {at}/{part} is not a list of numbers"
    if shapes["codes"][0] != coefficients:
        return f"{at} has {shapes['codes'][0]} coordinates, its record says {coefficients}"
    return None


def _is_number(value: object) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and math.isfinite(value) and abs(value) <= _LARGEST
