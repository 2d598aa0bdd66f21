"""What the manifest says of a layer's caustics (``layers/NAME/bounced/caustics``), checked before anything is read."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .chunks import ArraySpec

_MOST_CELLS = 6 * 256
_LARGEST = 1 << 40
_TYPES = {"counts": "uint16", "cells": "uint16", "codes": "uint8", "scales": "float32"}


def caustic_problem(
    at: str, said: Mapping[str, Any], arrays: Mapping[str, ArraySpec], *, rows: int
) -> str | None:
    """What is wrong with the arrays below ``at``; None if nothing is, or there are none and none are said to be.

    ``said`` are the layer's parameters and statistics, ``rows`` its receivers.
    """
    photons = said.get("photons", 0)
    if type(photons) is not int or photons < 0:
        return f"{at}: photons are {photons!r}, expected a whole number"
    for number in ("photons_traced", "caustic_noise") if photons else ():
        value = said.get(number)
        if not isinstance(value, int | float) or isinstance(value, bool) or not 0 <= value <= _LARGEST:
            return f"{at}: the layer does not say its {number}"
    return sent_on_problem(at, arrays, rows=rows, expected=bool(photons))


def sent_on_problem(at: str, arrays: Mapping[str, ArraySpec], *, rows: int, expected: bool) -> str | None:
    """The same of the arrays alone, whoever found them."""
    found = {name.removeprefix(f"{at}/"): spec for name, spec in arrays.items() if name.startswith(f"{at}/")}
    if not found:
        return f"{at}: its arrays are missing" if expected else None
    if {name: spec.dtype for name, spec in found.items()} != _TYPES:
        return f"arrays of {at} are not {', '.join(_TYPES)} of their types"
    if found["counts"].shape != [rows] or found["scales"].shape != [rows]:
        return f"arrays {at}/counts and scales are not one for each of {rows} receivers"
    entries = found["cells"].shape
    if len(entries) != 1 or entries[0] > rows * _MOST_CELLS:
        return f"array {at}/cells is not one for each entry"
    codes = found["codes"].shape
    if codes[1:] != entries or codes[0] not in (1, 3):
        return f"array {at}/codes is not one or three for each entry"
    return None
