"""What a fixed eye sees of any material, by the renderer: the one place where relighting asks for it."""

from __future__ import annotations

import numpy as np

from ..arrays import Int32
from ..errors import DamagedBakeError
from ..rays.mitsuba import Occluders
from ..rays.surfaces import SurfaceScene
from ..scene.baked import scene_of
from ..storage.bake import Bake
from ..transport.eye import seen_points, vertex_points
from ..transport.viewed import ViewedTransfer
from .layer import EnvironmentLayer


def viewed_transfer(bake: Bake, layer: EnvironmentLayer, rows: Int32[np.ndarray, "some"]) -> ViewedTransfer:
    """The transfer of some rows of a layer toward its eye, as it was baked. Raises MissingExtraError."""
    if layer.eye is None:
        raise DamagedBakeError(bake.path, f"layer {layer.name} has rows of three channels and no eye")
    scene = scene_of(bake)
    occluders = Occluders(scene.positions, scene.triangles)
    if layer.picture_size is None:
        points = vertex_points(scene, layer.eye.eye)
    else:
        width, height = layer.picture_size
        samples = bake.layers[layer.name].parameters.get("samples")
        points = seen_points(
            occluders,
            layer.eye,
            width=width,
            height=height,
            samples=samples if isinstance(samples, int) else 1,
        )
    return ViewedTransfer(occluders, SurfaceScene(scene, resolution=layer.resolution), points, receivers=rows)
