"""What ``prelight bake`` and ``prelight inspect`` say of the gloss of a layer, of whatever kind it is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import printing

if TYPE_CHECKING:
    from ..baking.exitant import ExitantPlan


def said_of_gloss(plan: ExitantPlan) -> str:
    """Of a plan, one line."""
    if not plan.rows:
        return "no vertex is of a glossy material: --glossy-order has nothing to do"
    return (
        f"gloss of {plan.rows:,} vertices: {printing.count(plan.rays)} rays, {printing.duration(plan.seconds)}, "
        f"{printing.size(plan.bytes)}; a change of light takes about {plan.milliseconds:.0f} ms more"
    )


def rows_of_gloss(layer: dict[str, Any]) -> list[tuple[str, str]]:
    """Of a layer's summary, in two columns; nothing where it keeps no gloss."""
    settings, found = layer["parameters"], layer["statistics"]
    if not (order := settings.get("glossy_order")):
        return []
    from ..bases.exitant import milliseconds

    rows, fit = found.get("glossy_rows", 0), found.get("glossy_fit_error", 0.0)
    kept = f"{rows:,} vertices for any eye, in harmonics of order {order}; {printing.size(layer['glossy_bytes'])}"
    rays, took = printing.count(found.get("glossy_rays", 0)), milliseconds(rows, order)
    cost = f"{rays} rays; about {took:.0f} ms a change of light"
    said = [("  gloss", kept), ("", f"{cost}; of the sharpest lobe {fit:.0%} (RMS) is beyond that order")]
    if metal := found.get("metal_rays"):
        said.append(
            ("", f"rough metal lights what is around it, {printing.count(metal)} rays of it from the sky")
        )
    return said
