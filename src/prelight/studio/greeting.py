"""What every visitor is told first: what is shown, and what can be chosen."""

from __future__ import annotations

from .environments import Environments
from .protocol import MOST_DISCS, MOST_LAMPS, PROTOCOL_VERSION, State, Welcome
from .shown import Shown


def greeting(shown: Shown, environments: Environments, *, state: State, no_tracer: str | None) -> Welcome:
    """The welcome of a visitor without a number. Reads the bake the first time: not for the event loop."""
    return Welcome(
        version=PROTOCOL_VERSION,
        visitor=0,
        name=shown.bake.manifest.scene.name,
        bake=shown.digest,
        receivers=shown.rows,
        vertices=shown.vertices,
        triangles=shown.triangles,
        textures=shown.textures,
        resolution=shown.resolution,
        pixels=shown.pixels,
        eye=shown.eye,
        cameras=shown.cameras,
        environments=environments.choices,
        takes=shown.takes,
        portals=shown.portals,
        steered=shown.steered,
        worlds=environments.worlds.views if "glass" in shown.takes else (),
        glossy=shown.glossy,
        no_tracer=no_tracer,
        most_discs=MOST_DISCS,
        most_lamps=MOST_LAMPS,
        state=state,
    )
