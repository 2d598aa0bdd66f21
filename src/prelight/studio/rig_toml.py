"""The page's light as a rig file (docs/rig.md), which ``prelight relight`` shows the same; and such a file as light."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np

from ..errors import InputError
from ..lighting.moment import Site, moment_of
from ..lighting.rig_file import DiscTable, PaintTable, RigTables, checked_tables
from ..lighting.rig_sky import SunTable
from .environments import DAYLIGHT, Environments, clock
from .fields import MOST_DABS
from .placed import glass_of, glass_table, lamp_table, lamps_of
from .protocol import MOST_DISCS, MOST_LAMPS, State
from .protocol_values import DiscLight, PaintStroke, Sun
from .rig_state import WHITE

_GROUND = (0.25, 0.25, 0.25)
_LEAST = 1e-12


def rig_tables(state: State, environments: Environments, *, takes: tuple[str, ...]) -> dict[str, Any]:
    """The tables of a state, for a bake whose layers take what is named. Raises InputError for what no file can say."""
    tables: dict[str, Any] = {}
    if "environment" in takes:
        if state.environment == DAYLIGHT:
            tables["sun"] = _sun_table(state)
        elif state.scale > 0:
            tables["environment"] = {
                "map": environments.source(state.environment), "rotate_deg": state.rotation_deg,
                "scale": state.scale, "tint": state.tint,
            }  # fmt: skip
        tables["disc"] = [
            {"name": d.id, "azimuth_deg": d.azimuth_deg, "elevation_deg": d.elevation_deg,
             "radius_deg": d.radius_deg, "radiance": d.radiance, "softness": d.softness}
            for d in state.discs
        ]  # fmt: skip
        tables["paint"] = [
            {"name": s.id, "azimuth_deg": azimuth, "elevation_deg": elevation, "radius_deg": s.radius_deg,
             "softness": s.softness, "radiance": s.radiance, "opacity": s.opacity}
            for s in state.paint for azimuth, elevation in s.points
        ]  # fmt: skip
    for lamp in state.lamps:
        if ("lamps" if lamp.layer is None else "steered") in takes:
            tables.setdefault(lamp.kind, []).append(lamp_table(lamp))
    if "glass" in takes:
        tables["portal"] = [glass_table(glass) for glass in state.glass]
        if state.world is not None:
            tables["outside"] = environments.worlds.table(state.world)
    return {name: table for name, table in tables.items() if table}


def _sun_table(state: State) -> dict[str, Any]:
    sun = state.sun
    said = {"place": (sun.latitude_deg, sun.longitude_deg), "time": clock(sun.date, sun.hour)}
    said |= {} if sun.zone is None else {"zone": sun.zone}
    north = (180.0 - state.rotation_deg) % 360.0 - 180.0
    return {**said, "turbidity": sun.turbidity, "north_deg": north + 0.0, "scale": state.scale}


def rig_text(state: State, environments: Environments, *, takes: tuple[str, ...], title: str) -> str:
    """A rig file. Raises InputError for what no file can say, and where nothing shines."""
    tables = rig_tables(state, environments, takes=takes)
    if not tables:
        raise InputError("rig", "nothing shines: there is no light to write down")
    head = f"# The light of {' '.join(title.split())}, set in prelight studio. docs/rig.md tells every key.\n"
    return head + toml_text(tables)


def toml_text(tables: Mapping[str, Any]) -> str:
    """Tables, and lists of tables, of plain values as TOML."""
    parts = []
    for name, table in tables.items():
        for rows in table if isinstance(table, list) else [table]:
            opening = f"[[{name}]]" if isinstance(table, list) else f"[{name}]"
            parts.append(
                f"\n{opening}\n" + "".join(f"{key} = {_value(value)}\n" for key, value in rows.items())
            )
    return "".join(parts)


def _value(value: object) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, tuple | list):
        return "[" + ", ".join(_value(part) for part in value) + "]"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(part)}" for key, part in value.items()) + " }"
    if isinstance(value, bool | int):
        return json.dumps(value)
    return repr(float(value))  # ty: ignore[invalid-argument-type]


# ---- From a file ---------------------------------------------------------------------------------------------------


def opened_rig(text: str, start: State, environments: Environments) -> State:
    """The state of a rig file's text; the map stays that of ``start``, dark, where it has none.

    Raises InputError, naming the table, for what is wrong and for what the page cannot show yet.
    """
    try:
        document = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, ValueError, RecursionError) as error:
        raise InputError("rig", f"not a TOML rig: {str(error)[:120]}") from None
    tables = checked_tables(document, "rig")
    paint = _strokes(tables.paint)
    lamps = lamps_of(tables)
    if len(tables.disc) > MOST_DISCS or len(lamps) > MOST_LAMPS:
        raise InputError("rig", f"at most {MOST_DISCS} discs and {MOST_LAMPS} lamps can be shown")
    state = _with_sky(tables, start, environments)
    discs = tuple(_disc(d, f"d{n}") for n, d in enumerate(tables.disc))
    world = None if tables.outside is None else environments.worlds.key_of(document["outside"])
    seconds = state.seconds if world == state.world else 0.0
    return replace(
        state, discs=discs, paint=paint, lamps=lamps, glass=glass_of(tables), world=world, seconds=seconds
    )


def _with_sky(tables: RigTables, start: State, environments: Environments) -> State:
    if tables.sun is not None:
        return _with_sun(tables.sun, start)
    table = tables.environment
    if table is None:
        return replace(start, scale=0.0, tint=WHITE)
    if table.blend is not None or table.layout is not None:
        raise InputError("rig", "/environment has blend or layout, which the page cannot show yet")
    name = environments.key_of(table.map)
    stops = start.stops if name == start.environment else None
    return replace(
        start, environment=name, rotation_deg=table.rotate_deg % 360.0, scale=table.scale, tint=table.tint,
        stops=stops,
    )  # fmt: skip


def _with_sun(table: SunTable, start: State) -> State:
    if any(abs(a - b) > 1e-9 for a, b in zip(table.ground_albedo, _GROUND, strict=True)):
        raise InputError("rig", "/sun has ground_albedo, which the page cannot show yet")
    place = Site(*table.place)
    when = moment_of("time", table.time, place=place, zone=table.zone)
    if datetime.fromisoformat(table.time).tzinfo is not None:
        when = when.astimezone(place.mean_solar_time)
    hour = when.hour + when.minute / 60 + when.second / 3600
    sun = Sun(*table.place, when.date().isoformat(), hour, table.zone, table.turbidity)
    stops = start.stops if start.environment == DAYLIGHT else None
    return replace(
        start, environment=DAYLIGHT, sun=sun, rotation_deg=-table.north_deg % 360.0, scale=table.scale,
        tint=WHITE, stops=stops,
    )  # fmt: skip


def _disc(table: DiscTable, identity: str) -> DiscLight:
    return DiscLight(identity, *_angles(table), table.radius_deg, table.radiance, table.softness)


def _strokes(tables: Sequence[PaintTable]) -> tuple[PaintStroke, ...]:
    """Round regions as strokes: those that follow each other alike and have one name are one."""
    if any(table.radius_deg is None for table in tables):
        raise InputError("rig", "has [[paint]] with ranges of angles, which the page cannot show yet")
    if len(tables) > MOST_DABS:
        raise InputError("rig", f"at most {MOST_DABS} tables [[paint]] can be shown, {len(tables)} are there")
    strokes: list[PaintStroke] = []
    name = None
    for n, table in enumerate(tables):
        assert table.radius_deg is not None  # checked above
        point, softness = _angles(table), table.softness or 0.0
        one = PaintStroke(f"p{n}", table.radius_deg, table.radiance, softness, table.opacity, (point,))
        last = strokes[-1] if strokes and name is not None and name == table.name else None
        if last is not None and replace(one, id=last.id, points=last.points) == last:
            strokes[-1] = replace(last, points=(*last.points, point))
        else:
            strokes.append(one)
        name = table.name
    return tuple(strokes)


def _angles(table: DiscTable | PaintTable) -> tuple[float, float]:
    azimuth, elevation = table.azimuth_deg, table.elevation_deg
    if table.direction is not None:
        x, y, z = np.array(table.direction) / max(float(np.linalg.norm(table.direction)), _LEAST)
        azimuth, elevation = math.degrees(math.atan2(x, -z)), math.degrees(math.asin(max(-1.0, min(1.0, y))))
    assert azimuth is not None  # one or the other: rig_file
    assert elevation is not None
    return azimuth, elevation
