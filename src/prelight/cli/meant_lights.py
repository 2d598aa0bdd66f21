"""How well the lamps of a bake that is still to be made will hold a rig's lights."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError

if TYPE_CHECKING:
    from ..baking.steerable_settings import BakedLamp


def said_of_lights(path: Path, lamps: Sequence[BakedLamp]) -> list[str]:
    """A line for each light of a rig: the error of its shape, or that there is none to speak of.

    Raises InputError for a rig without such lights, and for one that no lamp is for.
    """
    from ..lighting.places import Place
    from ..lighting.rig import Rig

    lights = Rig.open(str(path)).lights
    if not lights:
        raise InputError(
            path, "has no [[spot]] and no [[panel]]; expected the lights that the bake is meant for"
        )
    by_name, found = {lamp.name: lamp for lamp in lamps}, []
    for n, light in enumerate(lights):
        name = lamps[0].name if light.layer is None and len(lamps) == 1 else light.layer
        if name not in by_name:
            given = "names no layer" if name is None else f"is for layer {name[:40]!r}"
            raise InputError(path, f"light {n + 1} {given}; this bake will have {', '.join(by_name)[:120]}")
        lamp = by_name[name]
        said = lamp.place()
        place = Place(said["kind"], tuple(said["origin"]), tuple(tuple(edge) for edge in said["edges"]))
        light.coefficients(lamp.basis, place)  # says what does not fit
        notes = light.notes(lamp.basis, place) or ["its shape is held to 3 % and better"]
        found += [f"light {n + 1}, lamp {name}: {note}" for note in notes]
    return found
