"""Prelight: trace a static scene once, then change its light in milliseconds. B = T·l.

The public names, loaded when first used; nothing inside the package imports this file.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

_HOME = {
    "Bake": "storage.bake",
    "Camera": "camera",
    "DamagedBakeError": "errors",
    "Disc": "lighting.disc",
    "Environment": "lighting.environment",
    "InputError": "errors",
    "OutputError": "errors",
    "Panel": "lighting.panel",
    "Picture": "drawing.picture",
    "PrelightError": "errors",
    "Receivers": "receivers",
    "Relighter": "relighting.relighter",
    "Rig": "lighting.rig",
    "Scene": "scene.geometry",
    "Spot": "lighting.spot",
    "SteerableBake": "relighting.steerable_bake",
    "SteerableSettings": "baking.steerable_settings",
    "bake_environment": "baking.environment",
    "bake_steerable": "baking.steerable",
    "load_scene": "scene.loading",
}

__all__ = [*_HOME, "__version__"]  # noqa: PLE0604  (names resolved by __getattr__)

if TYPE_CHECKING:
    from .baking.environment import bake_environment
    from .baking.steerable import bake_steerable
    from .baking.steerable_settings import SteerableSettings
    from .camera import Camera
    from .drawing.picture import Picture
    from .errors import DamagedBakeError, InputError, OutputError, PrelightError
    from .lighting.disc import Disc
    from .lighting.environment import Environment
    from .lighting.panel import Panel
    from .lighting.rig import Rig
    from .lighting.spot import Spot
    from .receivers import Receivers
    from .relighting.relighter import Relighter
    from .relighting.steerable_bake import SteerableBake
    from .scene.geometry import Scene
    from .scene.loading import load_scene
    from .storage.bake import Bake


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'prelight' has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
