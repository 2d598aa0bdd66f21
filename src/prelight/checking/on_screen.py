"""The picture that a camera sees under a rig, by Mitsuba's path tracer, growing sample by sample: for the eye."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import Radiance
from ..camera import Camera
from ..errors import InputError
from ..lighting.glass import FROSTED
from ..lighting.rig import Rig
from ..rays.surfaces import SurfaceScene
from ..storage.bake import Bake
from ..transport.cube_emitter import cube_emitter
from ..transport.eye_paths import PinholeRays
from ..transport.path_tracing import ROULETTE_FROM
from .placed_emitters import emitter_of
from .through_windows import windows_of

_RESOLUTION = 256  # R of the environment's cube
_DEEPEST = 64  # bounces
_DARKEST = 1e-12


class ScreenTracer:
    """A bake's scene with its own materials under a rig's environment and placed lights, any number of bounces.

    The glass of its portals and the world outside are as the rig has them (``through_windows``).

    Parameters
    ----------
    bake, rig
        What is seen under what.
    camera, width, height
        From where, and how many pixels.

    Raises InputError for what Mitsuba's path tracer does not know: frosted glass, steerable lamps, lamps of a shape of
    their own; and where nothing shines. MissingExtraError without the renderer.
    """

    def __init__(self, bake: Bake, rig: Rig, camera: Camera, *, width: int, height: int) -> None:
        _refuse_steerable(rig)
        windows = windows_of(bake, rig)
        self._surfaces = SurfaceScene(windows.room)
        self.mi = self._surfaces.mi
        lights = [emitter_of(self.mi, lamp) for lamp in rig.lamps_at(0.0)]
        if max(windows.environment.total) > _DARKEST:
            lights.append(cube_emitter(self.mi, windows.environment.cube(_RESOLUTION)))
        if not lights:
            raise InputError("light", "nothing shines: there is nothing for the path tracer to see")
        self._scene = self._surfaces.lit_by(*lights, *windows.shapes(self.mi))
        self._kind = "volpath" if windows.sheets else "path"  # looks for light through the sheets
        self._view = PinholeRays(self.mi, camera, width=width, height=height)
        self._pixels = width * height

    def pictures(self, samples: int, *, seed: int = 0) -> Iterator[tuple[int, Radiance]]:
        """So far: how many samples a pixel, and the mean radiance (pixels, 3), row by row from the top."""
        import drjit as dr

        mi = self.mi
        integrator = mi.load_dict({"type": self._kind, "max_depth": _DEEPEST, "rr_depth": ROULETTE_FROM})
        numbers = mi.load_dict({"type": "independent"})
        total = np.zeros((self._pixels, 3))
        for n in range(samples):
            numbers.seed((seed * 1_000_003 + n) & 0x7FFFFFFF, self._pixels)
            ray = self._view.through(dr.arange(mi.UInt32, self._pixels), numbers.next_2d())
            radiance, _, _ = integrator.sample(self._scene, numbers, mi.RayDifferential3f(ray))
            total += np.array(radiance).reshape(3, -1).T
            yield n + 1, (total / (n + 1)).astype(np.float32)


def refuse_unknown(rig: Rig) -> None:
    """Raises InputError for lights and glass that Mitsuba's path tracer does not know."""
    if rig.outside is not None:
        raise InputError(
            "outside", "the path tracer does not know the world outside; take it away to compare"
        )
    _refuse_steerable(rig)
    for glass in rig.portals:
        if glass.kind == FROSTED or glass.blind > 0 or glass.tint is not None or glass.kind == "shut":
            what = (
                f"the path tracer has the glass as built, and {glass.name!r} is set; set it back to compare"
            )
            raise InputError("glass", what)


def _refuse_steerable(rig: Rig) -> None:
    if rig.tracks:
        what = "the path tracer does not know lamps of steerable layers here; switch them off"
        raise InputError("light", what)


def pictures(
    bake: Bake, rig: Rig, camera: Camera, size: tuple[int, int], samples: int
) -> Iterator[tuple[int, Radiance]]:
    """``ScreenTracer.pictures`` of ``size`` (width, height)."""
    width, height = size
    yield from ScreenTracer(bake, rig, camera, width=width, height=height).pictures(samples)
