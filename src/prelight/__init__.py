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
    "CloudSettings": "baking.cloud_settings",
    "DamagedBakeError": "errors",
    "Disc": "lighting.disc",
    "Environment": "lighting.environment",
    "InputError": "errors",
    "Lamp": "lighting.placed_lights",
    "LitBake": "relighting.lit_bake",
    "OutputError": "errors",
    "Panel": "lighting.panel",
    "Picture": "drawing.picture",
    "PlacedPanel": "lighting.placed_lights",
    "PortalsSettings": "baking.portals_settings",
    "PrelightError": "errors",
    "Receivers": "receivers",
    "Relighter": "relighting.relighter",
    "Rig": "lighting.rig",
    "Scene": "scene.geometry",
    "Spot": "lighting.spot",
    "SteerableBake": "relighting.steerable_bake",
    "SteerableSettings": "baking.steerable_settings",
    "TransferSettings": "baking.transfer_settings",
    "add_layers": "storage.joining",
    "bake_cloud": "baking.cloud",
    "bake_environment": "baking.environment",
    "bake_portals": "baking.portals",
    "bake_steerable": "baking.steerable",
    "bake_transfer": "baking.transfer",
    "load_scene": "scene.loading",
}

__all__ = [*_HOME, "__version__"]  # noqa: PLE0604  (names resolved by __getattr__)

if TYPE_CHECKING:
    from .baking.cloud import bake_cloud
    from .baking.cloud_settings import CloudSettings
    from .baking.environment import bake_environment
    from .baking.portals import bake_portals
    from .baking.portals_settings import PortalsSettings
    from .baking.steerable import bake_steerable
    from .baking.steerable_settings import SteerableSettings
    from .baking.transfer import bake_transfer
    from .baking.transfer_settings import TransferSettings
    from .camera import Camera
    from .drawing.picture import Picture
    from .errors import DamagedBakeError, InputError, OutputError, PrelightError
    from .lighting.disc import Disc
    from .lighting.environment import Environment
    from .lighting.panel import Panel
    from .lighting.placed_lights import Lamp, PlacedPanel
    from .lighting.rig import Rig
    from .lighting.spot import Spot
    from .receivers import Receivers
    from .relighting.lit_bake import LitBake
    from .relighting.relighter import Relighter
    from .relighting.steerable_bake import SteerableBake
    from .scene.geometry import Scene
    from .scene.loading import load_scene
    from .storage.bake import Bake
    from .storage.joining import add_layers


def __getattr__(name: str) -> object:
    if name not in _HOME:
        raise AttributeError(f"module 'prelight' has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
