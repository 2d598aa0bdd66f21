"""What ``prelight inspect`` says of a transfer layer."""

from __future__ import annotations

from typing import Any

from . import printing
from .gloss_said import rows_of_gloss


def rows_of_transfer(layer: dict[str, Any]) -> list[tuple[str, str]]:
    """Lines of its own, in two columns."""
    settings, told, seconds = layer["parameters"], layer["statistics"], layer["seconds"]
    entries = told["first_entries"] / max(layer["basis_lights"], 1)
    bounces = settings["operator_bounces"]
    by_operator = f"the first by {entries:.0f} entries a vertex"
    if bounces > 1:
        later = told.get("later_entries", told["first_entries"]) / max(layer["basis_lights"], 1)
        by_operator += f", {'the second' if bounces == 2 else 'two more'} by {later:.0f}"
    caustics = settings.get("caustics")
    gloss = "gloss" if not settings.get("glossy_order") else "what is seen through glass"
    took = f", {printing.duration(seconds)}" if seconds is not None else ""
    return [
        ("layer", f"{layer['name']} ({layer['kind']})"),
        ("  receivers", "vertices, seen from anywhere"),
        ("  lights", "any: lamps, spots and panels anywhere, an environment; their shadows by rays"),
        (
            "  bounces",
            f"{by_operator}, the rest by {layer['coefficients']} modes",
        ),
        *(
            [("  caustics", "of lamps, spots and panels, by photons when they are lit or moved")]
            if caustics
            else []
        ),
        (
            "  errors",
            f"of bounced light {told['error']:.1%} RMS in the middle, {told['worst_error']:.0%} at worst, of lights"
            " that keep 3% of the scene's extent from surfaces",
        ),
        ("  mesh", f"holds bounced light on {told['held']:.0%} of its area"),
        ("  size", printing.size(layer["bytes"])),
        ("  cost", f"{printing.count(layer['rays'])} rays{took}"),
        *rows_of_gloss(layer),
        ("  loses", f"{gloss}; but for direct light in pictures, what is finer than the mesh"),
    ]
