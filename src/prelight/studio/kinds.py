"""What the layers of a bake can be lit by, and which of them the page shows."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..arrays import UInt32
from ..errors import InputError
from ..relighting.lit_bake import LAMPS, SKIES
from ..storage.bake import Bake
from .protocol import PortalView

Taken = Literal["environment", "lamps", "glass"]
PORTALS = "portals"  # the kind of layer whose glass can be set
QUICK = "environment"  # the kind of layer that ``Light`` lights


def vertex_kinds(bake: Bake) -> set[str]:
    """The kinds of layers that the page shows. Raises InputError where there are none."""
    kinds = {record.kind for record in bake.layers.values()} & {*SKIES, *LAMPS}
    if not kinds:
        what = "has no layer that the studio shows (environment, transfer, …); light its lamps with prelight relight"
        raise InputError(bake.path, what)
    return kinds


def takes_of(bake: Bake) -> tuple[Taken, ...]:
    """What of a rig some layer that is shown takes."""
    kinds = vertex_kinds(bake)
    taken: dict[Taken, bool] = {
        "environment": bool(kinds & set(SKIES)),
        "lamps": bool(kinds & set(LAMPS)),
        "glass": PORTALS in kinds,
    }
    return tuple(what for what, is_taken in taken.items() if is_taken)


def quick_layers(bake: Bake) -> tuple[str, ...]:
    """The environment layers, where it is one of them that takes the environment."""
    taker = next((kind for kind in SKIES if kind in vertex_kinds(bake)), None)
    if taker != QUICK:
        return ()
    return tuple(name for name, record in bake.layers.items() if record.kind == QUICK)


def panes_of(bake: Bake) -> tuple[tuple[PortalView, ...], UInt32[np.ndarray, "vertices"]]:
    """The portals whose glass can be set, and for each vertex of glass its portal's number from 1; 0 elsewhere.

    Raises DamagedBakeError.
    """
    pane = np.zeros(len(bake.receivers), np.uint32)
    if PORTALS not in vertex_kinds(bake):
        return (), pane
    from ..relighting.portals_layer import read_portals

    layer = read_portals(bake, None)
    pane[layer.glass] = layer.glass_portal + 1
    tints: list[list[float]] = layer.tints.astype(float).tolist()
    return tuple(
        PortalView(name, (r, g, b)) for name, (r, g, b) in zip(layer.names, tints, strict=True)
    ), pane
