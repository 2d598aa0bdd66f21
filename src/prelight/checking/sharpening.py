"""A scene as it will look, path traced with more and more paths a pixel while it is baked."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..camera import Camera
from ..drawing.pixels import pixel_picture
from ..errors import InputError
from ..lighting.environment import Environment
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from ..scene.portals import find_portals
from ..scene.variant import mitsuba, usable_devices
from ..transport.cube_emitter import cube_emitter
from ..transport.eye_paths import PinholeRays

_SKY = "noon"
_CUBE = 64  # R of the sky
_DEPTH = 8
_FARTHEST = 20.0  # radiance of one path, of a sky of about 1; more would stay as a white dot for long


def facts(scene: Scene) -> dict[str, Any]:
    """What a scene has, for choosing what to bake: counts, cameras, whether windows were found, notes."""
    try:
        windows = len(find_portals(scene).names)
    except InputError:
        windows = 0
    extent = scene.positions.max(axis=0) - scene.positions.min(axis=0)
    return {
        "name": scene.name, "vertices": len(scene.positions), "triangles": len(scene.triangles),
        "cameras": list(scene.cameras), "windows": windows, "extent": [float(x) for x in extent],
        "notes": list(scene.notes), "devices": list(usable_devices()),
    }  # fmt: skip


class SharpeningPicture:
    """The first camera's view under a sky of ours.

    Parameters
    ----------
    scene
        Its materials shine if they emit.
    width, height
        Pixels.
    """

    def __init__(self, scene: Scene, *, width: int, height: int) -> None:
        mi = mitsuba()
        self._mi, self._size, self.passes = mi, (width, height), 0
        sky = cube_emitter(mi, Environment.stock(_SKY).cube(_CUBE))
        self._scene = SurfaceScene(scene, emits=True).lit_by(sky)
        camera = next(iter(scene.cameras.values()), None) or Camera.framing(scene.positions)
        self._view = PinholeRays(mi, camera, width=width, height=height)
        self._integrator = mi.load_dict({"type": "path", "max_depth": _DEPTH, "rr_depth": 5})
        self._sum = np.zeros((width * height, 3))

    def more(self) -> None:
        """One path a pixel more."""
        import drjit as dr

        mi, count = self._mi, self._size[0] * self._size[1]
        numbers = mi.load_dict({"type": "independent"})
        numbers.seed(self.passes, count)
        ray = mi.RayDifferential3f(self._view.through(dr.arange(mi.UInt32, count), numbers.next_2d()))
        radiance, _, _ = self._integrator.sample(self._scene, numbers, ray)
        values = np.nan_to_num(np.array(radiance).reshape(3, count).T, nan=0.0, posinf=_FARTHEST)
        self._sum += np.clip(values, 0.0, _FARTHEST)
        self.passes += 1

    def save(self, path: Path) -> None:
        """Write what there is as a PNG, as exposed as suits it. Raises OutputError."""
        mean = (self._sum / max(self.passes, 1)).astype(np.float32)
        covered = np.ones(self._size[::-1], np.float32)
        pixel_picture(mean, covered).save(path, force=True, exposure="auto")
