"""The live session: a bake, the light that falls on it now, the radiance and the pictures of it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from ..arrays import Float32, Radiance
from ..camera import Camera
from ..drawing.picture import Picture
from ..drawing.pixels import pixel_picture
from ..drawing.surface import Surface
from ..drawing.view import View
from ..errors import InputError
from ..lighting.environment import Environment
from ..storage.bake import Bake
from .environment import MOST_DISCS, EnvironmentRelighter, Update
from .layer import EnvironmentLayer

_PICTURE = (1280, 720)


class Relighter:
    """Change the light of a bake and read the radiance.

    What follows from a state of the light depends on that state alone, not on how it was reached
    (within float32: a local change and a full relight agree to about 1e-6 of the largest radiance).

    Parameters
    ----------
    bake
        A ``Bake`` or the path of one. Needs no renderer.
    layer
        Which of its environment layers; the one of that name if not said, or the first.

    Raises
    ------
    InputError, DamagedBakeError
        There is no bake, it has no such layer, or it is damaged.
    """

    def __init__(self, bake: Bake | str | Path, *, layer: str | None = None) -> None:
        self.bake = bake if isinstance(bake, Bake) else Bake.open(bake)
        self._layer = EnvironmentLayer(self.bake, layer)
        albedo = None if self._layer.picture_size else self.bake.receivers.albedo
        self._live = EnvironmentRelighter(self._layer, albedo)
        self._environment = Environment.constant((0.0, 0.0, 0.0))
        self._view = lru_cache(maxsize=4)(self._new_view)

    @property
    def environment(self) -> Environment:
        """The environment last assigned.

        Edits of texels come on top of its map. One that differs only in its discs costs a local change: the map
        is not sampled again, and edits stay; any other replaces them.
        """
        return self._environment

    @environment.setter
    def environment(self, environment: Environment) -> None:
        if not isinstance(environment, Environment):
            raise InputError("environment", f"{type(environment).__name__}, expected an Environment")
        known, live = self._environment, self._live
        many = max(len(environment.discs), len(known.discs)) > MOST_DISCS
        if many or environment.discs == known.discs or not environment.same_behind_discs(known):
            behind = environment if len(environment.discs) > MOST_DISCS else environment.with_discs(())
            texels = live.set_cube(behind.cube(self.resolution))
            live.last = live.set_discs(() if behind is environment else environment.discs).after(texels)
        else:
            live.set_discs(environment.discs)
        self._environment = environment

    @property
    def resolution(self) -> int:
        """R of the bake's cube map."""
        return self._layer.resolution

    @property
    def radiance(self) -> Radiance:
        """Linear radiance (rows, 3) of the layer's receivers; a copy.

        Of vertices, in their order: albedo times T·l, or T·l itself where they are seen by a fixed eye. Of
        pixels, row by row from the top.
        """
        return self._live.radiance

    @property
    def last(self) -> Update:
        """How the last change was made, and what it took: kind, milliseconds, bytes read."""
        return self._live.last

    def edit(self, face: int, rows: slice, columns: slice, radiance: np.ndarray) -> Update:
        """Replace a rectangle of the texels behind the discs; see ``EnvironmentRelighter.edit``."""
        return self._live.edit(face, rows, columns, radiance)

    def refresh(self) -> Update:
        """Relight in full."""
        return self._live.refresh()

    @property
    def picture_size(self) -> tuple[int, int] | None:
        """(width, height) of the pixels that are the layer's receivers; None where vertices are."""
        return self._layer.picture_size

    def camera(self, camera: Camera | str | None = None) -> Camera:
        """A camera by itself or by its name in the bake; else the layer's eye, or one that frames the scene.

        Raises InputError naming the cameras there are, and for any but its own eye in a layer of pixels.
        """
        cameras, eye = self.bake.cameras, self._layer.eye
        if isinstance(camera, str):
            if camera not in cameras:
                raise InputError(
                    "camera", f"{camera!r} is not in this bake; it has {', '.join(cameras) or 'none'}"
                )
            camera = cameras[camera]
        if self.picture_size and camera not in (None, eye):
            raise InputError("camera", "another one than the pixels of this bake were made for; leave it out")
        chosen = camera or eye or next(iter(cameras.values()), None)
        return chosen or Camera.framing(self.bake.receivers.positions)

    def picture(
        self,
        camera: Camera | str | None = None,
        *,
        width: int | None = None,
        height: int | None = None,
        background: str | tuple[float, float, float] | None = "environment",
    ) -> Picture:
        """The scene as a camera sees it, anti-aliased; 1280×720 unless said otherwise.

        Of a layer of pixels, these as its own camera has them: no other camera and no other size. Where vertices
        are seen by a fixed eye any camera may look at them, but highlights stay where that eye sees them.

        ``background``: ``"environment"`` shows the map behind the scene, a colour or None replaces it.
        """
        if isinstance(background, str) and background != "environment":
            raise InputError("background", f"{background!r}, expected 'environment', three numbers or None")
        behind = self._environment.radiance_along if background == "environment" else background
        eye, own = self.camera(camera), self.picture_size
        width, height = width or (own or _PICTURE)[0], height or (own or _PICTURE)[1]
        if own is None:
            view = self._view(eye, width, height)
            irradiance = self._live.irradiance if self._surface else None
            return view.draw(self.radiance, irradiance=irradiance, background=behind)
        if (width, height) != own:
            raise InputError("size", f"{width}×{height}, but the pixels of this bake are {own[0]}×{own[1]}")
        return pixel_picture(self.radiance, self._coverage, camera=eye, background=behind)

    @cached_property
    def _coverage(self) -> Float32[np.ndarray, "height width"]:
        """The part of each pixel's samples that see the scene: the samples that the layer was made with."""
        samples = self.bake.layers[self._layer.name].parameters.get("samples")
        per_side = math.isqrt(samples) if isinstance(samples, int) and 0 < samples <= 64 else 1
        width, height = self._layer.picture_size or _PICTURE
        receivers = self.bake.receivers
        view = View(
            receivers.positions, self.bake.triangles, camera=self.camera(), width=width, height=height,
            samples_per_side=per_side,
        )  # fmt: skip
        return view.coverage

    @cached_property
    def _surface(self) -> Surface | None:
        """Textures, where what is kept of the vertices is irradiance."""
        bake = self.bake
        if bake.uv is None or not bake.textures:
            return None
        glossy = self._layer.eye is not None
        materials = [
            replace(m, colour_texture=None) if glossy and not m.is_lambertian else m for m in bake.materials
        ]
        return Surface(bake.material_of, materials, uv=bake.uv, tint=bake.tint, textures=bake.textures)

    def _new_view(self, camera: Camera, width: int, height: int) -> View:
        receivers, triangles = self.bake.receivers, self.bake.triangles
        return View(
            receivers.positions, triangles, camera=camera, width=width, height=height, surface=self._surface
        )
