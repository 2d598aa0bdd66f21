"""All layers of a bake under one rig: each takes its share, and what they bring is added."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ..arrays import Radiance
from ..camera import Camera
from ..drawing.picture import Picture
from ..drawing.pixels import pixel_picture
from ..drawing.surface import Surface
from ..drawing.view import View
from ..errors import InputError
from ..lighting.environment import Environment
from ..lighting.panel import Panel
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..lighting.spot import Spot
from ..storage.bake import Bake
from .live_environment import LiveEnvironment
from .live_layer import LiveLayer
from .steerable_bake import SteerableBake
from .stored_steerable import steerable_names

SKIES = (
    "portals",
    "environment",
    "transfer",
)  # which kind of layer takes the environment, first come first served
_PICTURE = (1280, 720)


class LitBake:
    """A bake with layers of several kinds under one rig. What follows depends on the rig alone.

    Layers of vertices add up to irradiance at the vertices; layers of pixels (steerable lamps) add to the picture
    that their own eye sees.

    Parameters
    ----------
    trace_strong
        As of ``Relighter``.

    Raises
    ------
    InputError, MissingExtraError
        No bake, or a layer that does not go with others; a layer that needs the renderer, which is not installed.
    OutputError, DamagedBakeError
        It cannot be read, or is not what was written.
    """

    def __init__(self, bake: Bake | str | Path, *, trace_strong: bool = True) -> None:
        self.bake = bake if isinstance(bake, Bake) else Bake.open(bake)
        self.layers: list[LiveLayer] = []
        self._sky: str | None = None
        self.steered = SteerableBake(self.bake) if steerable_names(self.bake) else None
        for kind in SKIES:
            for name, record in self.bake.layers.items():
                if record.kind == kind:
                    self.layers.append(_opened(self.bake, name, kind, trace_strong=trace_strong))
                    self._sky = self._sky or name
        if not self.layers and self.steered is None:
            raise InputError(self.bake.path, "has no layer that this version can light; bake one")
        self._rig = Rig(Environment.dark())

    def light(self, rig: Rig) -> None:
        """Light the bake with ``rig`` and nothing else.

        Raises InputError for a light that no layer takes, and as the layers do; then nothing has changed that a
        next call would not set right.
        """
        self._refuse_homeless(rig)
        if self.steered is not None:
            self.steered.light(_steered(rig))
        for layer in self.layers:
            own = rig if layer.name == self._sky else replace(rig, environment=_DARK)
            layer.light(own)
        self._rig = rig

    @property
    def irradiance(self) -> Radiance:
        """(V, 3) irradiance / π before albedo, of all layers of vertices; a copy."""
        total = np.zeros((len(self.bake.receivers), 3), np.float32)
        for layer in self.layers:
            total += layer.irradiance
        return total

    def glossy(self, eye: Triple) -> Radiance | None:
        """(V, 3) what glossy surfaces add toward a point; None where no layer has such."""
        parts = [part for layer in self.layers if (part := layer.glossy(eye)) is not None]
        return None if not parts else np.sum(parts, axis=0, dtype=np.float32)

    def radiance(self, eye: Triple | None = None) -> Radiance:
        """(V, 3) linear radiance of the vertices, toward ``eye`` where there are glossy ones; a copy."""
        diffuse = self.bake.receivers.albedo * self.irradiance
        shine = None if eye is None else self.glossy(eye)
        return diffuse if shine is None else diffuse + shine

    @property
    def milliseconds(self) -> float:
        """What the last change took, in all layers."""
        return sum(layer.last.milliseconds for layer in self.layers)

    @property
    def bytes_read(self) -> int:
        """What the last change read, in all layers."""
        return sum(layer.last.bytes_read for layer in self.layers)

    def camera(self, camera: Camera | str | None = None) -> Camera:
        """A camera by itself or by its name in the bake; else the eye of the layers of pixels, or the first there is.

        Raises InputError naming the cameras there are, and for another than the pixels' own.
        """
        cameras = self.bake.cameras
        if isinstance(camera, str):
            if camera not in cameras:
                known = ", ".join(cameras) or "none"
                raise InputError("camera", f"{camera!r} is not in this bake; it has {known}")
            camera = cameras[camera]
        if self.steered is not None:
            if camera not in (None, self.steered.camera):
                raise InputError(
                    "camera", "another one than the steerable lamps were baked for; leave it out"
                )
            return self.steered.camera
        return camera or next(iter(cameras.values()), None) or Camera.framing(self.bake.receivers.positions)

    def picture(
        self,
        camera: Camera | str | None = None,
        *,
        width: int | None = None,
        height: int | None = None,
        background: str | Triple | None = "environment",
    ) -> Picture:
        """The scene as a camera sees it, anti-aliased; of the pixels' size where a layer has pixels, else 1280×720.

        Raises InputError as ``camera``, for another size than the pixels', and for an unknown background.
        """
        if isinstance(background, str) and background != "environment":
            raise InputError("background", f"{background!r}, expected 'environment', three numbers or None")
        eye, size = self.camera(camera), _PICTURE if self.steered is None else self.steered.size
        chosen = width or size[0], height or size[1]
        if self.steered is not None and chosen != size:
            raise InputError(
                "size", f"{chosen[0]}×{chosen[1]}, but the lamps' pixels are {size[0]}×{size[1]}"
            )
        behind = self._rig.environment.radiance_along if background == "environment" else background
        view = View(
            self.bake.receivers.positions, self.bake.triangles, camera=eye, width=chosen[0], height=chosen[1],
            surface=self._surface,
        )  # fmt: skip
        irradiance = self.irradiance
        diffuse = self.bake.receivers.albedo * irradiance
        picture = view.draw(diffuse, irradiance=irradiance if self._surface else None, background=behind)
        shine = self.glossy(eye.eye)
        linear = picture.linear
        if shine is not None:
            linear = linear + View(
                self.bake.receivers.positions, self.bake.triangles, camera=eye, width=chosen[0], height=chosen[1]
            ).draw(shine).linear  # fmt: skip
        if self.steered is not None:
            pixels = pixel_picture(
                np.maximum(self.steered.radiance, 0), np.ones((size[1], size[0]), np.float32)
            )
            linear = linear + pixels.linear
        return replace(picture, linear=linear)

    @cached_property
    def _surface(self) -> Surface | None:
        bake = self.bake
        if bake.uv is None or not bake.textures:
            return None
        return Surface(bake.material_of, bake.materials, uv=bake.uv, tint=bake.tint, textures=bake.textures)

    def _refuse_homeless(self, rig: Rig) -> None:
        """Raises InputError for lights of kinds that no layer takes."""
        kinds = {record.kind for record in self.bake.layers.values()}
        lacking = []
        if self._sky is None and max(rig.environment.total) > 0:
            lacking.append("[environment], [[disc]] or [[paint]] (bake environment)")
        if self.steered is None and _steered(rig):
            lacking.append("[[spot]] or [[panel]] with a layer (bake steerable)")
        if lacking:
            what = f"has {' and '.join(lacking)}, but the layers of this bake are {', '.join(sorted(kinds))}"
            raise InputError("rig", what)


_DARK = Environment.dark()


def _steered(rig: Rig) -> list[Spot | Panel]:
    """The rig's lights that have a place in a steerable layer."""
    return list(rig.lights)


def _opened(bake: Bake, name: str, kind: str, *, trace_strong: bool) -> LiveLayer:
    if kind == "environment":
        return LiveEnvironment(bake, name, trace_strong=trace_strong)
    raise InputError(bake.path, f"layer {name!r} is of kind {kind!r}, which does not add to others yet")
