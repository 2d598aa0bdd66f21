"""Cameras of a bake by name."""

from __future__ import annotations

from collections.abc import Mapping

from ..camera import Camera
from ..errors import InputError


def named_camera(cameras: Mapping[str, Camera], camera: Camera | str | None) -> Camera | None:
    """The camera of that name; one by itself, or None, as it is. Raises InputError naming those there are."""
    if not isinstance(camera, str):
        return camera
    if camera not in cameras:
        raise InputError("camera", f"{camera!r} is not in this bake; it has {', '.join(cameras) or 'none'}")
    return cameras[camera]
