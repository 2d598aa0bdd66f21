"""The page's lamps and glass as tables of a rig file, and as the lights that these are; and back."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..lighting.glass import FROSTED, USUAL_FROST_DEG, Glass
from ..lighting.ies import LUMENS_PER_WATT
from ..lighting.keyframes import Track
from ..lighting.painting import LUMINANCE
from ..lighting.placed_lights import Lamp, PlacedLight, PlacedPanel
from ..lighting.quantities import Triple
from ..lighting.rig_file import RigTables, checked_tables
from ..lighting.rig_lights import PanelTable, SpotTable, layered_track
from ..lighting.rig_placed import LampTable, PlacedPanelTable, PlacedSpotTable, placed_track
from ..lighting.rig_portals import glass_table as portal_glass
from .protocol_values import LampLight, PortalGlass

_NOWHERE = Path()
_AHEAD = 1.0  # metres, of a target made from a direction


def lamp_table(lamp: LampLight) -> dict[str, Any]:
    """The keys of its ``[[lamp]]``, ``[[spot]]`` or ``[[panel]]``; ``scale`` is its dimmer, 0 where it is off."""
    if lamp.layer is not None:
        return _layered_table(lamp) | {"scale": lamp.dim if lamp.on else 0.0}
    said: dict[str, Any] = {"name": lamp.name, "position": lamp.position}
    if lamp.kind == "lamp":
        said |= {"radius": lamp.radius, "lumens": lamp.strength, "color": lamp.color}
    elif lamp.kind == "spot":
        intensity = tuple(lamp.strength / LUMENS_PER_WATT * part for part in lamp.color)
        said |= {
            "target": lamp.target,
            "width_deg": lamp.beam_deg,
            "radius": lamp.radius,
            "intensity": intensity,
        }
    else:
        said |= {"size": lamp.size, "target": lamp.target, "lumens": lamp.strength, "color": lamp.color}
    return said | {"scale": lamp.dim if lamp.on else 0.0}


def _layered_table(lamp: LampLight) -> dict[str, Any]:
    """Of a light of a steerable layer; a panel in a box has three numbers for its place."""
    assert lamp.layer is not None
    strength = tuple(lamp.strength / LUMENS_PER_WATT * part for part in lamp.color)
    said: dict[str, Any] = {"layer": lamp.layer, "name": lamp.name}
    if lamp.kind == "spot":
        return said | {"intensity": strength, "target": lamp.target, "width_deg": lamp.beam_deg}
    flat = lamp.position[2] == 0
    width = tuple(min(side, 1.0) for side in (*lamp.size, lamp.size[0]))
    return said | {
        "position": lamp.position[:2] if flat else lamp.position,
        "width": width[:2] if flat else width,
        "radiance": strength,
    }


def layered_tracks(lamps: Sequence[LampLight]) -> tuple[Track, ...]:
    """Lights of steerable layers, those that are lit. Raises InputError for one that cannot be."""
    found = []
    for lamp in lamps:
        if not (lamp.on and lamp.dim > 0):
            continue
        try:
            tables = checked_tables({lamp.kind: [_plain(lamp_table(lamp))]}, "lamp")
            found.append(layered_track(getattr(tables, lamp.kind)[0], _NOWHERE))
        except InputError as error:
            raise InputError(f"lamp {lamp.name!r}", error.reason) from None
    return tuple(found)


def _plain(table: dict[str, Any]) -> dict[str, Any]:
    return {key: list(value) if isinstance(value, tuple) else value for key, value in table.items()}


def placed_light(lamp: LampLight) -> PlacedLight:
    """The light, as ``prelight relight`` has it from the table. Raises InputError for one that cannot be."""
    return _at_rest(placed_track_of(lamp))


def _at_rest(track: Track) -> PlacedLight:
    light = track.at(0.0)
    assert isinstance(light, Lamp | PlacedPanel)  # what rig_placed makes
    return light


def placed_track_of(lamp: LampLight) -> Track:
    """The same at rest, as a rig has it."""
    try:
        tables = checked_tables({lamp.kind: [_plain(lamp_table(lamp))]}, "lamp")
        return placed_track(getattr(tables, lamp.kind)[0], _NOWHERE)
    except InputError as error:
        raise InputError(f"lamp {lamp.name!r}", error.reason) from None


def glass_table(glass: PortalGlass) -> dict[str, Any]:
    """The keys of its ``[[portal]]``."""
    said: dict[str, Any] = {"name": glass.portal, "glass": glass.kind}
    said |= {} if glass.tint is None else {"tint": glass.tint}
    said |= {"frost_deg": glass.frost_deg} if glass.kind == FROSTED else {}
    return said | {"blind": glass.blind}


def set_glass(glass: PortalGlass) -> Glass:
    """The same as a rig has it."""
    frost = glass.frost_deg if glass.kind == FROSTED else USUAL_FROST_DEG
    return Glass(glass.portal, glass.kind, glass.tint, frost, glass.blind)


# ---- From a rig file -----------------------------------------------------------------------------------------------


def lamps_of(tables: RigTables) -> tuple[LampLight, ...]:
    """The lamps of a rig file. Raises InputError, naming the first that no page can show."""
    found: list[LampLight] = []
    for kind, rows in (("lamp", tables.lamp), ("spot", tables.spot), ("panel", tables.panel)):
        for n, table in enumerate(rows):
            what = f"/{kind}/{n}"
            for key in ("ies", "power", "polynomial", "picture", "keys"):
                if getattr(table, key, None):
                    raise InputError("rig", f"{what} has {key}, which the page cannot show yet")
            if table.roll_deg:
                raise InputError("rig", f"{what} has roll_deg, which the page cannot show yet")
            if isinstance(table, SpotTable | PanelTable):
                found.append(_layered_of(table, kind, identity=f"l{len(found)}"))
            else:
                found.append(_lamp_of(table, kind, identity=f"l{len(found)}"))
    return tuple(found)


def _layered_of(table: SpotTable | PanelTable, kind: str, *, identity: str) -> LampLight:
    """A light of a steerable layer. Raises InputError for what the page has no controls for."""
    if table.layer is None:
        raise InputError(
            "rig", f"/{kind} {table.name or identity} is of a steerable layer: the page needs its name"
        )
    if isinstance(table, PanelTable):
        if table.turns or table.shape != "raised-cosine":
            raise InputError(
                "rig", f"/{kind} {table.name or identity} is turned or soft: not on the page yet"
            )
        strength, color = _of_colour(table.radiance)
        x, y, z = (*table.position, 0.0)[:3]
        place, aim = (x, y, z), (x, y, z - 1.0)
        size = (table.width[0], table.width[-1 if len(table.width) < 3 else 1])
    else:
        if table.target is None or table.width_deg is None or table.intensity is None:
            raise InputError(
                "rig", f"/{kind} {table.name or identity}: the page needs its target, width_deg and intensity"
            )
        strength, color = _of_colour(table.intensity)
        place, aim, size = (0.0, 0.0, 0.0), table.target, (0.5, 0.5)
    return LampLight(
        id=identity, name=(table.name or f"{kind.capitalize()} {identity[1:]}")[:60], kind=kind,  # ty: ignore
        on=table.scale > 0, position=place, target=aim,
        strength=strength * LUMENS_PER_WATT * max(table.scale, 1.0), dim=min(table.scale, 1.0) or 1.0,
        color=color, radius=0.0, beam_deg=float(getattr(table, "width_deg", None) or 40.0), size=size,
        layer=table.layer,
    )  # fmt: skip


def glass_of(tables: RigTables) -> tuple[PortalGlass, ...]:
    """The glass of a rig file. Raises InputError for patterns of names."""
    found: dict[str, PortalGlass] = {}
    for n, table in enumerate(tables.portal):
        if "*" in table.name:
            raise InputError(
                "rig", f"/portal/{n} is for {table.name[:40]!r}: the page needs each portal by its name"
            )
        if table.rough is not None:
            raise InputError("rig", f"/portal/{n} has rough, which the page cannot show yet")
        glass = portal_glass(table, _NOWHERE, n)
        found[table.name] = PortalGlass(table.name, glass.kind, glass.tint, glass.frost_deg, glass.blind)  # ty: ignore
    return tuple(found[name] for name in sorted(found))


def _lamp_of(table: LampTable | PlacedSpotTable | PlacedPanelTable, kind: str, *, identity: str) -> LampLight:
    full = _at_rest(placed_track(table.model_copy(update={"scale": 1.0}), _NOWHERE))
    beam = full.beam
    target = beam.target
    if target is None:
        target = tuple((np.array(full.position) + _AHEAD * np.array(beam.direction)).tolist())
    strength, color = _of_colour(beam.intensity)
    if isinstance(full, PlacedPanel):
        strength *= np.pi * full.size[0] * full.size[1]
    elif kind == "lamp":
        strength *= 4 * np.pi
    return LampLight(
        id=identity, name=(table.name or f"{kind.capitalize()} {identity[1:]}")[:60], kind=kind,  # ty: ignore
        on=table.scale > 0, position=full.position, target=target,
        strength=float(strength * LUMENS_PER_WATT * max(table.scale, 1.0)), dim=min(table.scale, 1.0) or 1.0,
        color=color, radius=full.radius if isinstance(full, Lamp) else 0.0,
        beam_deg=float(getattr(table, "width_deg", None) or 40.0),
        size=full.size if isinstance(full, PlacedPanel) else (0.5, 0.5),
    )  # fmt: skip


def _of_colour(intensity: Triple) -> tuple[float, Triple]:
    """A strength, and a colour of luminance one."""
    level = float(np.array(intensity) @ LUMINANCE)
    if not level > 0:
        return 0.0, (1.0, 1.0, 1.0)
    red, green, blue = intensity
    return level, (red / level, green / level, blue / level)
