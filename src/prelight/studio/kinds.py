"""What the layers of a bake can be lit by, and which of them the page shows."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..arrays import UInt32
from ..errors import InputError
from ..relighting.lit_bake import LAMPS, SKIES
from ..relighting.stored_steerable import open_steerable, steerable_camera, steerable_names
from ..storage.bake import Bake
from .protocol_values import CameraView, PortalView, SteeredPlace, SteeredView

Taken = Literal["environment", "lamps", "glass", "steered"]
PORTALS = "portals"  # the kind of layer whose glass can be set
QUICK = "environment"  # the kind of layer that ``Light`` lights


def vertex_kinds(bake: Bake) -> set[str]:
    """The kinds of layers of vertices that the page shows. Raises InputError where it shows nothing at all."""
    kinds = {record.kind for record in bake.layers.values()} & {*SKIES, *LAMPS}
    if not kinds and not steerable_names(bake):
        what = "has no layer that the studio shows (environment, transfer, portals, cloud, steerable)"
        raise InputError(bake.path, what)
    return kinds


def takes_of(bake: Bake) -> tuple[Taken, ...]:
    """What of a rig some layer that is shown takes."""
    kinds = vertex_kinds(bake)
    taken: dict[Taken, bool] = {
        "environment": bool(kinds & set(SKIES)),
        "lamps": bool(kinds & set(LAMPS)),
        "glass": PORTALS in kinds,
        "steered": bool(steerable_names(bake)),
    }
    return tuple(what for what, is_taken in taken.items() if is_taken)


def quick_layers(bake: Bake) -> tuple[str, ...]:
    """The environment layers, where it is one of them that takes the environment."""
    taker = next((kind for kind in SKIES if kind in vertex_kinds(bake)), None)
    if taker != QUICK:
        return ()
    return tuple(name for name, record in bake.layers.items() if record.kind == QUICK)


def steered_of(bake: Bake) -> SteeredView | None:
    """What steerable layers light; None where there are none. Raises DamagedBakeError, InputError."""
    if not steerable_names(bake):
        return None
    name, camera = steerable_camera(bake)
    layers = open_steerable(bake)
    width, height = layers[0].size
    view = CameraView(name, camera.eye, camera.target, camera.up, camera.vertical_fov_deg)
    places = tuple(SteeredPlace(layer.name, layer.place.kind, layer.place.origin) for layer in layers)
    return SteeredView(view, width, height, places)


def glossy(bake: Bake) -> bool:
    """Whether something that is shown shines toward the eye: glossy vertices, or the panes of portals."""
    has_part = any(f"layers/{name}/glossy/rows" in bake.manifest.arrays for name in bake.layers)
    return has_part or PORTALS in vertex_kinds(bake)


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
