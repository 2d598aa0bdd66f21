"""What ``prelight inspect`` says of a layer of portals."""

from __future__ import annotations

import json
from typing import Any

from . import printing
from .gloss_said import rows_of_gloss

_NAMED = 6


def rows_of_portals(layer: dict[str, Any]) -> list[tuple[str, str]]:
    """Lines about portals, direct and bounced light, and the advice."""
    settings, found, seconds = layer["parameters"], layer["statistics"], layer["seconds"]
    names = json.loads(settings["names"])
    shown = ", ".join(names[:_NAMED]) + (f", … {len(names):,} in all" if len(names) > _NAMED else "")
    took = f", {printing.duration(seconds)}" if seconds is not None else ""
    haar = found["haar_rows"] / max(found["rows"], 1)
    rows = [
        ("layer", f"{layer['name']} ({layer['kind']})"),
        ("  portals", f"{shown}; {found['portal_area']:.3g} m²"),
        (
            "  direct",
            f"{found['rows']:,} rows over 6×{settings['cube']}² cells, {haar:.0%} as Haar coefficients; "
            f"{printing.size(found['row_bytes'])}, {found['row_error']:.2%} off (RMS)",
        ),
        (
            "",
            f"all as pulses {printing.size(found['pulse_bytes'])}, all as Haar {printing.size(found['haar_bytes'])}",
        ),
    ]
    if settings.get("photons"):
        traced, noise = printing.count(found["photons_traced"]), found["caustic_noise"]
        rows.append(
            ("  caustics", f"of glass and mirrors, {traced} photons; {noise:.1%} noise under an even sky")
        )
    if settings["bounces"] == 0:
        rows.append(("  bounces", "none: direct light only"))
    else:
        often = (
            "as often as matters" if settings["bounces"] == "all" else f"up to {settings['bounces']} times"
        )
        rows += [
            (
                "  bounces",
                f"{often}; harmonics of order {settings['order']}, at least {found['bounced_held']:.0%} of a portal's "
                f"energy, in {found['bounced_modes']} modes, {printing.size(layer['bounced_bytes'])}",
            ),
            ("", f"the modes leave out {found['bounced_left_out']:.2%}; what is finer outside than order "
                 f"{settings['order']} bounces as if blurred"),
        ]  # fmt: skip
    gloss = "" if settings.get("glossy_order") else "gloss but for the panes; "
    rows += [
        ("  outside", _outside(settings, found)),
        ("", f"nearer than {found['returned_distance']:.2g} m light from the room would come back"),
        *rows_of_gloss(layer),
        ("  size", printing.size(layer["bytes"])),
        ("  cost", f"{printing.count(layer['rays'])} rays{took}"),
        (
            "  loses",
            f"{gloss}light that reaches the outside of the room; parts of a cell of the cube",
        ),
    ]
    return rows


def _outside(settings: dict[str, Any], found: dict[str, Any]) -> str:
    distance = settings["exterior_distance"]
    if distance is None:
        nearest = f"{found['least_distance']:.3g} m"
        return f"far away; with {settings['theta_deg']:g}° of error things may come as near as {nearest}"
    return f"{distance:g} m away at least; the largest portal errs by {found['angle_deg']:.1f}°"
