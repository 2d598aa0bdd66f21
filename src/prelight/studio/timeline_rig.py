"""The timeline as a rig file whose lamps fade: ``prelight animate`` shows the cross-fade that the page plays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from ..errors import InputError
from .environments import Environments
from .history import Looks
from .placed import lamp_table
from .protocol import State
from .protocol_values import LampLight, LookKey
from .rig_state import LIGHT
from .rig_toml import rig_tables, toml_text

_WORDS = {
    "environment": "skies",
    "rotation_deg": "turns of the sky",
    "scale": "strengths of the sky",
    "tint": "tints of the sky",
    "sun": "hours",
    "discs": "lights in the sky",
    "paint": "paint on the sky",
    "world": "worlds outside",
    "seconds": "moments outside",
}


def timeline_text(
    state: State, looks: Looks, environments: Environments, *, takes: tuple[str, ...], title: str
) -> str:
    """A rig file. Raises InputError for fewer than two keyframes, and where more than lamps is different."""
    keys = state.timeline
    if len(keys) < 2:
        raise InputError("timeline", "expected two keyframes or more")
    known = dict(looks)
    lights = [known[key.look] for key in keys]
    for name in LIGHT:
        if name != "lamps" and any(getattr(light, name) != getattr(lights[0], name) for light in lights):
            what = f"its looks have different {_WORDS.get(name, name)}, and only lamps fade in a rig file"
            raise InputError("timeline", f"{what}; film it instead")
    tables = rig_tables(replace(lights[0], lamps=()), environments, takes=takes)
    for lamp, shares in _lamps(lights):
        tables.setdefault(lamp.kind, []).append(_fading(lamp, keys, shares))
    if not tables:
        raise InputError("timeline", "nothing shines: there is no light to write down")
    head = (
        f"# The timeline of {' '.join(title.split())}, set in prelight studio. docs/rig.md tells every key.\n"
    )
    return head + toml_text(tables)


def _lamps(lights: Sequence[State]) -> list[tuple[LampLight, list[float]]]:
    """Every lamp of any look, at full, and its share at each keyframe."""
    found: dict[LampLight, list[float]] = {}
    for k, light in enumerate(lights):
        for lamp in light.lamps:
            if lamp.on and lamp.dim > 0:
                full = replace(lamp, id="any", on=True, dim=1.0)
                found.setdefault(full, [0.0] * len(lights))[k] += lamp.dim
    return list(found.items())


def _fading(lamp: LampLight, keys: Sequence[LookKey], shares: Sequence[float]) -> dict[str, Any]:
    later = [{"at": key.at, "scale": share} for key, share in zip(keys, shares, strict=True) if key.at > 0]
    return lamp_table(lamp) | {"scale": shares[0], "ease": "linear", "keys": later}
