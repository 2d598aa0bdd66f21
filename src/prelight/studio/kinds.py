"""What the layers of a bake can be lit by, and which of them the page shows."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..arrays import UInt32
from ..camera import Camera
from ..errors import DamagedBakeError, InputError
from ..relighting.takers import LAMPS, SKIES, STEERABLE
from ..storage.bake import Bake
from ..storage.manifest import LayerRecord
from .protocol_values import CameraView, PortalView, SteeredPlace, SteeredView

Taken = Literal["environment", "lamps", "glass", "steered"]
PORTALS = "portals"  # the kind of layer whose glass can be set
QUICK = "environment"  # the kind of layer that ``Light`` lights


def vertex_kinds(bake: Bake) -> set[str]:
    """The kinds of layers of vertices that the page shows. Raises InputError where it shows nothing at all."""
    kinds = {record.kind for record in bake.layers.values()} & {*SKIES, *LAMPS}
    if not kinds and not has_steerable(bake):
        what = "has no layer that the studio shows (environment, transfer, portals, cloud, steerable)"
        raise InputError(bake.path, what)
    return kinds


def has_steerable(bake: Bake) -> bool:
    """Whether there is a layer of steerable lamps."""
    return any(record.kind == STEERABLE for record in bake.layers.values())


def takes_of(bake: Bake) -> tuple[Taken, ...]:
    """What of a rig some layer that is shown takes."""
    kinds = vertex_kinds(bake)
    taken: dict[Taken, bool] = {
        "environment": bool(kinds & set(SKIES)),
        "lamps": bool(kinds & set(LAMPS)),
        "glass": PORTALS in kinds,
        "steered": has_steerable(bake),
    }
    return tuple(what for what, is_taken in taken.items() if is_taken)


def is_sky_alone(bake: Bake) -> bool:
    """Whether it has an environment layer and nothing else."""
    return vertex_kinds(bake) == {QUICK} and not has_steerable(bake)


def quick_layers(bake: Bake) -> tuple[str, ...]:
    """The environment layers, where it is one of them that takes the environment, for any eye."""
    taker = next((kind for kind in SKIES if kind in vertex_kinds(bake)), None)
    records = {name: record for name, record in bake.layers.items() if record.kind == QUICK}
    if taker != QUICK or any(record.camera is not None for record in records.values()):
        return ()
    return tuple(records)


def _of_an_eye(bake: Bake, receivers: str) -> list[LayerRecord]:
    """Environment layers of one eye among other layers, of vertices or of pixels."""
    known = [] if is_sky_alone(bake) else bake.layers.values()
    return [r for r in known if r.kind == QUICK and r.camera and r.parameters.get("receivers") == receivers]


def steered_of(bake: Bake) -> SteeredView | None:
    """What layers of pixels light, among others; None where there are none. Raises DamagedBakeError, InputError."""
    if not has_steerable(bake):
        return next((_pixels_of(bake, record) for record in _of_an_eye(bake, "pixels")), None)
    from ..relighting.stored_steerable import open_steerable, steerable_camera

    name, camera = steerable_camera(bake)
    layers = open_steerable(bake)
    width, height = layers[0].size
    view = CameraView(name, camera.eye, camera.target, camera.up, camera.vertical_fov_deg)
    places = tuple(SteeredPlace(layer.name, layer.place.kind, layer.place.origin) for layer in layers)
    return SteeredView(view, width, height, places)


def _pixels_of(bake: Bake, record: LayerRecord) -> SteeredView:
    width, height = record.parameters.get("width"), record.parameters.get("height")
    if record.camera is None or not isinstance(width, int) or not isinstance(height, int):
        raise DamagedBakeError(bake.path, f"its picture is {width!r} by {height!r} pixels")
    try:
        eye = Camera.from_dict(record.camera.view)
    except InputError as error:
        raise DamagedBakeError(bake.path, f"the eye of its layer is wrong: {error.reason}") from None
    view = CameraView(record.camera.name, eye.eye, eye.target, eye.up, eye.vertical_fov_deg)
    return SteeredView(view, width, height, ())


def glossy(bake: Bake) -> bool:
    """Whether something that is shown shines toward the eye: glossy vertices, or the panes of portals."""
    has_part = any(f"layers/{name}/glossy/rows" in bake.manifest.arrays for name in bake.layers)
    has_part = has_part or bool(_of_an_eye(bake, "vertices"))
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
