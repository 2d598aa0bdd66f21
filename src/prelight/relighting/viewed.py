"""What a fixed eye sees of any material, by the renderer: the one place where relighting asks for it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import numpy as np

from ..arrays import Int32
from ..encoding.octahedral import encoded_directions, encoded_places
from ..errors import DamagedBakeError, InputError
from ..rays.mitsuba import Occluders
from ..rays.surfaces import SurfaceScene
from ..scene.baked import scene_of
from ..storage.bake import Bake
from ..transport.basis_images import ImageSettings
from ..transport.deep_buffer import deep_samples
from ..transport.eye import seen_points, vertex_points
from ..transport.steered_lamps import SteeredBox, SteeredPanel, lamp_from_dict
from ..transport.viewed import ViewedTransfer
from .deep_buffer import DeepBuffer
from .layer import EnvironmentLayer
from .stored_steerable import basis_of, degree_of, keeps_first_bounces, steerable_camera, steerable_names

MOST_SAMPLES = 256  # of a pixel, of narrow parts


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


def narrow_parts(
    bake: Bake, samples: int, *, report: Callable[[float], None] | None = None
) -> dict[str, DeepBuffer]:
    """First bounces of steerable layers that hold every bounce, traced anew from the bake's own scene.

    With them ``SteerableBake`` lights what of a light is too narrow for its layer.

    Parameters
    ----------
    bake
        With steerable layers.
    samples
        Of each pixel, 1 to 256; a narrow light on a panel needs many. A box of light has none.
    report
        Hears the share done.

    Raises
    ------
    InputError
        Another number of samples, or a bake that keeps first bounces apart already.
    MissingExtraError
        Mitsuba is not installed.
    DamagedBakeError
        The bake is not what was written.
    """
    if not 1 <= samples <= MOST_SAMPLES:
        raise InputError("narrow", f"{samples}, expected 1 to {MOST_SAMPLES} samples a pixel")
    if keeps_first_bounces(bake):
        raise InputError(
            "narrow", "this bake keeps first bounces apart (--deep): narrow lights are exact in it"
        )
    surfaces, camera = SurfaceScene(scene_of(bake)), steerable_camera(bake)[1]
    found, names = {}, steerable_names(bake)
    for n, name in enumerate(names):
        said = bake.layers[name].parameters
        try:
            lamp, degree = (
                lamp_from_dict(json.loads(str(said["lamp"]))),
                degree_of(basis_of(str(said["basis"]))),
            )
            settings = ImageSettings(int(said["width"]), int(said["height"]), seed=int(said["seed"]))  # ty: ignore
        except (InputError, KeyError, TypeError, ValueError, RecursionError) as error:
            raise DamagedBakeError(
                bake.path, f"the lamp of layer {name!r} is not described: {error}"
            ) from None
        if not isinstance(lamp, SteeredBox):
            traced = deep_samples(surfaces, lamp, camera, settings=settings, samples=samples)
            places = encoded_places(traced.places, traced.aimed) if isinstance(lamp, SteeredPanel) else None
            directions = encoded_directions(traced.directions)
            found[name] = DeepBuffer(
                traced.starts, traced.colours, directions, degree, places, parts=math.isqrt(samples)
            )
        if report is not None:
            report((n + 1) / len(names))
    return found
