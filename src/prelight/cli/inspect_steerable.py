"""What ``prelight inspect`` says of steerable layers."""

from __future__ import annotations

import json
from typing import Any

from . import printing

PAPER = "the paper kept 12 of 36, 20 of 81, 50 of 400"


def rows_of_steerable(layer: dict[str, Any]) -> list[tuple[str, str]]:
    """Two columns of a table."""
    said, found = layer["parameters"], layer["statistics"]
    size = f"{said['width']}×{said['height']} pixels of camera {layer['camera']!r}"
    took = f", {printing.duration(layer['seconds'])} with all others" if layer["seconds"] is not None else ""
    weights = f"weights of a steered one at most {found['largest_norm']:.2f} long"
    share = f"{found['kept_share']:.0%} of the sum of singular values ({PAPER})"
    rows = [
        ("layer", f"{layer['name']} ({layer['kind']})"),
        ("  receivers", f"{size}, {said['samples']} paths each"),
        ("  lamp", _lamp(said["lamp"])),
        ("  basis", f"{layer['basis_lights']} lights; {weights}"),
        ("  kept", f"{layer['coefficients']} components, {share}"),
        ("  loses", f"{found['components_error']:.2%} RMS of the basis pictures, highlights dimmed"),
    ]
    if "noise" in found:
        rows.append(
            ("  noise", f"{found['noise']:.1%} of a pixel on average, under light alike in all directions")
        )
    if said.get("deep"):
        rows.append(("  first bounce", f"apart, {said['deep']} samples a pixel: exact for every shape"))
    if said["left_out"]:
        rows.append(("  left out", said["left_out"]))
    return [*rows, ("  size", printing.size(layer["bytes"]) + took)]


def _lamp(text: str) -> str:
    """A lamp in a few words."""
    try:
        lamp = json.loads(text)
        if lamp["kind"] == "sky":
            return f"a sky, degree {lamp['degree']}"
        place = lamp["position"] if lamp["kind"] == "spot" else lamp["corner"]
        at = ", ".join(f"{x:g}" for x in place)
    except (ValueError, KeyError, TypeError, RecursionError):
        return "not described"
    if lamp["kind"] == "spot":
        return f"a spot at {at}, degree {lamp.get('degree')}, radius {lamp.get('radius')} m"
    if lamp["kind"] == "box":
        return f"a box of light from {at}, periods {lamp.get('periods')}"
    held = f"terms {lamp['terms']}" if lamp.get("terms") else f"periods {lamp.get('periods')}"
    return f"a panel from {at}, {held}, degree {lamp.get('degree')}"
