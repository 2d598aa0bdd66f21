"""What a wish means: for each layer the command of ``prelight`` that bakes it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass

from .start_protocol import Wish

_TITLES = {
    "environment": "the sky from all around",
    "portals": "the sky through the windows",
    "transfer": "lamps anywhere, live",
    "cloud": "lamps among precomputed ones",
}
# Of each kind what a draft and the last word change; good is what the command does by itself.
_QUALITY: dict[str, dict[str, tuple[str, ...]]] = {
    "environment": {
        "draft": ("--resolution", "64", "--tolerance", "0.03", "--gather-rays", "256"),
        "best": ("--tolerance", "0.007", "--gather-rays", "4096"),
    },
    "portals": {
        "draft": ("--rays", "1024", "--gather-rays", "256", "--cube", "16"),
        "best": ("--rays", "16384", "--gather-rays", "4096"),
    },
    "transfer": {
        "draft": ("--gather-rays", "256", "--entries", "128", "--operator-bounces", "1"),
        "best": ("--gather-rays", "4096", "--entries", "600"),
    },
    "cloud": {
        "draft": ("--lights", "128", "--gather-rays", "256"),
        "best": ("--lights", "1024", "--gather-rays", "4096"),
    },
}


@dataclass(frozen=True)
class Recipe:
    """One layer: ``arguments`` are those of ``prelight bake KIND SCENE``."""

    kind: str
    arguments: tuple[str, ...]

    @property
    def title(self) -> str:
        """What it is for, in words."""
        return _TITLES[self.kind]

    @property
    def key(self) -> str:
        """A name for a bake of these settings: another setting never resumes it."""
        digest = hashlib.sha256(json.dumps(self.arguments).encode()).hexdigest()
        return f"{self.kind}-{digest[:8]}"


def recipes(wish: Wish) -> tuple[Recipe, ...]:
    """The layers of a wish, the sky's first. All are of the same vertices, so that they fit into one bake."""
    kinds = {"open": ("environment",), "windows": ("portals",), "none": ()}[wish.sky]
    kinds += {"none": (), "transfer": ("transfer",), "cloud": ("cloud",)}[wish.lamps]
    return tuple(
        Recipe(kind, (*_QUALITY[kind].get(wish.quality, ()), *mesh_arguments(wish, floor=kind != "portals")))
        for kind in kinds
    )


def mesh_arguments(wish: Wish, *, floor: bool = True) -> tuple[str, ...]:
    """What changes the vertices."""
    wide = ("--floor", f"{wish.floor:g}") if wish.floor is not None and floor else ()
    fine = ("--subdivide", f"{wish.subdivide:g}") if wish.subdivide is not None else ()
    return (*wide, *fine)


def refusal(wish: Wish, *, windows: int) -> str | None:
    """Why a wish cannot be; None if it can."""
    if wish.sky == "none" and wish.lamps == "none":
        return "nothing is chosen: a sky, lamps, or both"
    if wish.sky == "windows" and wish.floor is not None:
        return "a floor under a room is outside its windows; leave it out"
    if wish.sky == "windows" and not windows:
        return "no glass was found in this scene: name its material glass, or bake the open sky"
    return None
