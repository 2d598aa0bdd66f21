"""``prelight layers``: put the layers of several bakes of one scene into one, and take them out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import cyclopts
from cyclopts import Parameter

from . import printing

app = cyclopts.App(help="Put layers of other bakes of the same scene into a bake, or take one out.")


@app.command
def add(
    bake: Path,
    other: Path,
    /,
    *,
    name: str | None = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Put the layers of one bake into another of the same scene: one rig then drives all of them.

    The other bake stays, and may be removed. Nothing is traced, and where the disk can link files nothing is copied.

    Parameters
    ----------
    bake
        NAME.prelight, which gets them.
    other
        Another bake of the same file, with the same --floor, --subdivide and --albedo.
    name
        What the layer is called there, if the other bake has one layer.
    force
        Replace layers of the same name.
    json
        Print one JSON object on standard output.
    """
    from ..storage.joining import add_layers

    _say(add_layers(bake, other, name=name, force=force), json=json)


@app.command
def remove(bake: Path, layer: str, /, *, json: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Take a layer out of a bake, for good.

    Parameters
    ----------
    bake
        NAME.prelight.
    layer
        Its name, as `prelight inspect` tells it.
    json
        Print one JSON object on standard output.
    """
    from ..storage.joining import remove_layer

    _say(remove_layer(bake, layer), json=json)


def _say(bake: Any, *, json: bool) -> None:
    summary = bake.summary()
    if json:
        printing.say_json(summary)
        return
    rows = [
        f"  {layer['name']} ({layer['kind']}), {printing.size(layer['bytes'])}" for layer in summary["layers"]
    ]
    printing.say("\n".join([f"{bake.path}: {printing.size(summary['bytes'])}", *rows]))
