"""A bake under a rig that changes in time, a picture at a time, for ``prelight animate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from ..errors import InputError
from . import arguments
from .relight_steerable import check_lamps_alone

if TYPE_CHECKING:
    from ..drawing.picture import Picture
    from ..lighting.rig import Rig


class Frames(Protocol):
    """Pictures of one bake under one rig."""

    size: tuple[int, int]

    def picture(self, seconds: float) -> Picture:
        """The rig as it is at a time."""
        ...


def frames_of(bake: Path, rig: Rig, path: Path, *, camera: str | None, size: str | None) -> Frames:
    """Raises InputError for what goes wrong with bake, rig (a file at ``path``), camera or size."""
    from ..relighting.stored_steerable import steerable_names
    from ..storage.bake import Bake

    opened = Bake.open(bake)
    if opened.layers and len(steerable_names(opened)) == len(opened.layers):
        if camera is not None or size is not None:
            what = "steerable lamps are baked for one eye and size; leave them out"
            raise InputError("--camera, --size", what)
        check_lamps_alone(rig, path)
        return _SteeredFrames(opened, rig)
    return _LitFrames(opened, rig, camera, size)


class _SteeredFrames:
    def __init__(self, bake, rig: Rig) -> None:
        from ..relighting.steerable_bake import SteerableBake

        self._light, self._rig = SteerableBake(bake), rig
        self.size = self._light.size

    def picture(self, seconds: float) -> Picture:
        self._light.light(self._rig.lights_at(seconds))
        return self._light.picture()


class _LitFrames:
    def __init__(self, bake, rig: Rig, camera: str | None, size: str | None) -> None:
        from ..relighting.lit_bake import LitBake

        self._light, self._rig = LitBake(bake), rig
        self._eye = arguments.camera_of(self._light, camera)
        self.size = self._light.size if size is None else arguments.picture_size(size)

    def picture(self, seconds: float) -> Picture:
        self._light.light(self._rig.at(seconds))
        return self._light.picture(self._eye, width=self.size[0], height=self.size[1])
