"""The light that is set as a rig, all of it at once: what ``prelight relight`` would be given."""

from __future__ import annotations

from dataclasses import replace

from ..lighting.environment import Environment
from ..lighting.rig import Rig
from .environments import Environments
from .kinds import Taken
from .placed import layered_tracks, placed_track_of, set_glass
from .protocol import State
from .rig_state import lit_discs, painted, sky_id


def rig_of(state: State, environments: Environments, *, takes: tuple[Taken, ...]) -> Rig:
    """What of a state a bake's layers take. Raises InputError for a map that cannot be read."""
    environment = Environment.dark()
    if "environment" in takes:
        whole = environments.open(sky_id(state))
        turned = whole.rotated(state.rotation_deg).scaled(state.scale).tinted(state.tint)
        turned = painted(turned, state.paint)
        environment = turned.with_discs([*turned.discs, *lit_discs(state)])
    lamps = [lamp for lamp in state.lamps if lamp.on and lamp.dim > 0] if "lamps" in takes else []
    steered = [lamp for lamp in state.lamps if lamp.layer is not None] if "steered" in takes else []
    placed = tuple(placed_track_of(lamp) for lamp in lamps if lamp.layer is None)
    rig = Rig(environment, layered_tracks(steered), placed)
    if "glass" not in takes:
        return rig
    rig = replace(rig, portals=tuple(map(set_glass, state.glass)))
    if state.world is None:
        return rig
    return replace(rig, outside=environments.worlds.open(state.world), seconds=state.seconds)
