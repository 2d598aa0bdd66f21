"""``prelight inspect``: what is in a bake, what it cost, what it loses."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from . import printing


def inspect(bake: Path, /, *, json: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Say what is in a bake, what it cost and what it loses.

    Parameters
    ----------
    bake
        NAME.prelight.
    json
        Print one JSON object on standard output.
    """
    from ..storage.bake import Bake

    summary = Bake.open(bake).summary()
    if json:
        printing.say_json(summary)
        return
    rows = [
        ("bake", f"{summary['path']}, {printing.size(summary['bytes'])}"),
        (
            "scene",
            f"{summary['scene']}: {summary['receivers']:,} receivers, {summary['triangles']:,} triangles",
        ),
        ("cameras", ", ".join(summary["cameras"]) or "none; pictures frame the whole scene"),
        *(("note", note) for note in summary["notes"]),
    ]
    for layer in summary["layers"]:
        settings, seconds = layer["parameters"], layer["seconds"]
        lights = (
            f"{layer['basis_lights']:,} (6×{settings['resolution']}²) in {layer['coefficients']:,} clusters"
        )
        threshold = f"{settings['tolerance']:.4g} (epsilon {settings['epsilon']:.4g}), "
        samples = f"{settings['samples_per_side']}² samples a cluster"
        nonzero = f"{layer['statistics']['nonzero_share']:.0%} of the elements are not zero"
        took = f", {printing.duration(seconds)}" if seconds is not None else ""
        rows += [
            ("layer", f"{layer['name']} ({layer['kind']})"),
            ("  lights", lights),
            ("  tolerance", threshold + samples),
            ("  size", f"{printing.size(layer['bytes'])}, {nonzero}"),
            ("  cost", f"{layer['rays'] / 1e9:.3g} G rays{took}"),
            ("  loses", "bounced light, gloss and textures; within the tolerance, the edges of shadows"),
        ]
    rows.append(
        ("made with", ", ".join(f"{name} {version}" for name, version in summary["software"].items()))
    )
    printing.table(rows)
