"""The live session: a bake, the light that falls on it now, the radiance and the pictures of it."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from ..arrays import Radiance
from ..camera import Camera
from ..drawing.picture import Picture
from ..drawing.view import View
from ..errors import InputError
from ..lighting.environment import Environment
from ..storage.bake import Bake
from .environment import EnvironmentLayer, EnvironmentRelighter, Update


class Relighter:
    """Change the light of a bake and read the radiance.

    What follows from a state of the light depends on that state alone, not on how it was reached
    (within float32: a local change and a full relight agree to about 1e-6 of the largest radiance).

    Parameters
    ----------
    bake
        A ``Bake`` or the path of one. Needs no renderer.

    Raises
    ------
    InputError, DamagedBakeError
        There is no bake, it has no environment layer, or it is damaged.
    """

    def __init__(self, bake: Bake | str | Path) -> None:
        self.bake = bake if isinstance(bake, Bake) else Bake.open(bake)
        self._live = EnvironmentRelighter(EnvironmentLayer(self.bake), self.bake.receivers.albedo)
        self._environment = Environment.constant((0.0, 0.0, 0.0))
        self._view = lru_cache(maxsize=4)(self._new_view)

    @property
    def environment(self) -> Environment:
        """The environment last assigned; edits of texels come on top of it."""
        return self._environment

    @environment.setter
    def environment(self, environment: Environment) -> None:
        if not isinstance(environment, Environment):
            raise InputError("environment", f"{type(environment).__name__}, expected an Environment")
        self._live.set_cube(environment.cube(self.resolution))
        self._environment = environment

    @property
    def resolution(self) -> int:
        """R of the bake's cube map."""
        return self._live.layer.resolution

    @property
    def radiance(self) -> Radiance:
        """Linear radiance (R, 3) of the receivers, in receiver order: albedo times T·l; a copy."""
        return self._live.radiance

    @property
    def last(self) -> Update:
        """How the last change was made, and what it took: kind, milliseconds, bytes read."""
        return self._live.last

    def edit(self, face: int, rows: slice, columns: slice, radiance: np.ndarray) -> Update:
        """Replace a rectangle of the environment's texels; see ``EnvironmentRelighter.edit``."""
        return self._live.edit(face, rows, columns, radiance)

    def refresh(self) -> Update:
        """Relight in full."""
        return self._live.refresh()

    def camera(self, camera: Camera | str | None = None) -> Camera:
        """A camera by itself, by its name in the bake, or one that frames the scene.

        Raises InputError naming the cameras there are.
        """
        if isinstance(camera, Camera):
            return camera
        cameras = self.bake.cameras
        if camera is None:
            return next(iter(cameras.values()), None) or Camera.framing(self.bake.receivers.positions)
        if camera not in cameras:
            raise InputError(
                "camera", f"{camera!r} is not in this bake; it has {', '.join(cameras) or 'none'}"
            )
        return cameras[camera]

    def picture(
        self,
        camera: Camera | str | None = None,
        *,
        width: int = 1280,
        height: int = 720,
        background: str | tuple[float, float, float] | None = "environment",
    ) -> Picture:
        """The scene as a camera sees it, anti-aliased.

        ``background``: ``"environment"`` shows the map behind the scene, a colour or None replaces it.
        """
        if isinstance(background, str) and background != "environment":
            raise InputError("background", f"{background!r}, expected 'environment', three numbers or None")
        behind = self._environment.radiance_along if background == "environment" else background
        return self._view(self.camera(camera), width, height).draw(self.radiance, background=behind)

    def _new_view(self, camera: Camera, width: int, height: int) -> View:
        return View(
            self.bake.receivers.positions, self.bake.triangles, camera=camera, width=width, height=height
        )
