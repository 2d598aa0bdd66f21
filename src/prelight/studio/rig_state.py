"""The rig that all visitors share: how messages change it. A state never changes; a message makes a new one."""

from __future__ import annotations

from dataclasses import replace

from ..errors import InputError
from ..lighting.disc import Disc
from ..lighting.environment import Environment
from ..lighting.painting import pointing
from ..lighting.regions import Cap
from .environments import DAYLIGHT, daylight_id, daylight_of
from .fields import MOST_DABS
from .placed import layered_tracks, placed_light
from .protocol import (
    MOST_DISCS,
    MOST_LAMPS,
    MOST_PORTALS,
    ClearPaint,
    RemoveDisc,
    RemoveLamp,
    RemovePaint,
    SetDisc,
    SetEnvironment,
    SetGlass,
    SetLamp,
    SetPaint,
    SetSun,
    SetWorld,
    State,
)
from .protocol_values import DiscLight, PaintStroke, Sun

Step = (
    SetEnvironment
    | SetSun
    | SetDisc
    | RemoveDisc
    | SetPaint
    | RemovePaint
    | ClearPaint
    | SetLamp
    | RemoveLamp
    | SetGlass
    | SetWorld
)  # what changes the light by itself
WHITE = (1.0, 1.0, 1.0)
FIRST_SUN = Sun(43.74, 15.89, "2026-06-21", 15.0, None, 2.5)
LIGHT = (
    "environment",
    "rotation_deg",
    "scale",
    "tint",
    "sun",
    "discs",
    "paint",
    "lamps",
    "glass",
    "world",
    "seconds",
)  # fields of a state that are light


def initial(environment: str) -> State:
    """A map as it is, no discs, no lamps."""
    return State(0, None, environment, 0.0, 1.0, WHITE, FIRST_SUN, (), (), (), None)


def changed(state: State, change: Step, *, author: int | None) -> State:
    """The state after a message. Raises InputError for a light that is not there, cannot be, or is one too many."""
    new = replace(state, sequence=(state.sequence + 1) % 2**32, author=author)
    if isinstance(change, SetEnvironment):
        return _with_environment(new, change)
    if isinstance(change, SetSun):
        daylight_of(daylight_id(change.sun))  # says what is wrong with it
        if state.environment == DAYLIGHT:
            return replace(new, sun=change.sun)
        return replace(new, sun=change.sun, environment=DAYLIGHT, tint=WHITE, stops=None)
    if isinstance(change, SetDisc | RemoveDisc):
        return _with_disc(new, change)
    if isinstance(change, SetPaint | RemovePaint | ClearPaint):
        return _with_paint(new, change)
    if isinstance(change, SetGlass):
        return _with_glass(new, change)
    if isinstance(change, SetWorld):
        return replace(new, world=change.world, seconds=0.0 if change.world is None else change.seconds)
    return _with_lamp(new, change)


def _with_environment(new: State, change: SetEnvironment) -> State:
    given = {
        name: getattr(change, name)
        for name in ("environment", "rotation_deg", "scale", "tint")
        if getattr(change, name) is not None
    }
    if "rotation_deg" in given:
        given["rotation_deg"] %= 360.0
    environment = given.get("environment", new.environment)
    if environment != new.environment:
        given["stops"] = None
    if environment == DAYLIGHT:
        if given.get("tint", WHITE) != WHITE:
            raise InputError(
                "SetEnvironment.tint", "daylight has the colour of its hour; choose a map to tint it"
            )
        given["tint"] = WHITE
    return replace(new, **given)


def _with_disc(new: State, change: SetDisc | RemoveDisc) -> State:
    others = tuple(disc for disc in new.discs if disc.id != change.id)
    if isinstance(change, RemoveDisc):
        if len(others) == len(new.discs):
            raise InputError("RemoveDisc.id", f"{change.id!r} is not alight")
        return replace(new, discs=others)
    if len(others) >= MOST_DISCS:
        raise InputError(
            "SetDisc.id", f"{change.id!r} would be disc {MOST_DISCS + 1}, at most {MOST_DISCS} shine"
        )
    disc = DiscLight(
        change.id,
        change.azimuth_deg,
        change.elevation_deg,
        change.radius_deg,
        change.radiance,
        change.softness,
    )
    # By name: what is seen must not depend on the order in which they were lit.
    return replace(new, discs=tuple(sorted((*others, disc), key=lambda d: d.id)))


def _with_paint(new: State, change: SetPaint | RemovePaint | ClearPaint) -> State:
    if isinstance(change, ClearPaint):
        if not new.paint:
            raise InputError("ClearPaint", "nothing is painted")
        return replace(new, paint=())
    name = change.stroke.id if isinstance(change, SetPaint) else change.id
    at = next((n for n, stroke in enumerate(new.paint) if stroke.id == name), None)
    if isinstance(change, RemovePaint):
        if at is None:
            raise InputError("RemovePaint.id", f"{name!r} is not painted")
        return replace(new, paint=new.paint[:at] + new.paint[at + 1 :])
    at = len(new.paint) if at is None else at  # one that is known stays above and below the same strokes
    paint = (*new.paint[:at], change.stroke, *new.paint[at + 1 :])
    dabs = sum(len(stroke.points) for stroke in paint)
    if dabs > MOST_DABS:
        raise InputError(
            "SetPaint.points",
            f"{dabs} dabs of paint in all, at most {MOST_DABS}; erase some, or take a larger brush",
        )
    return replace(new, paint=paint)


def _with_lamp(new: State, change: SetLamp | RemoveLamp) -> State:
    name = change.lamp.id if isinstance(change, SetLamp) else change.id
    others = tuple(lamp for lamp in new.lamps if lamp.id != name)
    if isinstance(change, RemoveLamp):
        if len(others) == len(new.lamps):
            raise InputError("RemoveLamp.id", f"{name!r} is not there")
        return replace(new, lamps=others)
    if len(others) >= MOST_LAMPS:
        raise InputError("SetLamp.id", f"{name!r} would be lamp {MOST_LAMPS + 1}, at most {MOST_LAMPS} shine")
    if change.lamp.layer is None:
        placed_light(change.lamp)  # says what is wrong with it
    else:
        layered_tracks((replace(change.lamp, on=True, dim=1.0),))
    return replace(new, lamps=tuple(sorted((*others, change.lamp), key=lambda lamp: lamp.id)))


def _with_glass(new: State, change: SetGlass) -> State:
    others = tuple(glass for glass in new.glass if glass.portal != change.glass.portal)
    if len(others) >= MOST_PORTALS:
        raise InputError("SetGlass.portal", f"more than {MOST_PORTALS} portals cannot be set")
    return replace(new, glass=tuple(sorted((*others, change.glass), key=lambda glass: glass.portal)))


def lit_discs(state: State) -> tuple[Disc, ...]:
    """The discs of a state as light; those without radiance are left out."""
    return tuple(
        Disc.at(
            d.azimuth_deg, d.elevation_deg, radius_deg=d.radius_deg, radiance=d.radiance, softness=d.softness
        )
        for d in state.discs
        if any(d.radiance)
    )


def painted(environment: Environment, paint: tuple[PaintStroke, ...]) -> Environment:
    """An environment as turned, scaled and tinted, with strokes over it, as ``[[paint]]`` of a rig file."""
    for stroke in paint:
        for azimuth, elevation in stroke.points:
            x, y, z = pointing(azimuth, elevation).tolist()
            region = Cap((x, y, z), stroke.radius_deg, stroke.softness)
            environment = environment.painted(region, stroke.radiance, opacity=stroke.opacity)
    return environment


def sky_id(state: State) -> str:
    """The id among ``Environments`` of what is around the scene."""
    return daylight_id(state.sun) if state.environment == DAYLIGHT else state.environment


def lit_as(state: State, other: State) -> State:
    """``state`` with the light of ``other``."""
    stops = state.stops if state.environment == other.environment else other.stops
    return replace(state, stops=stops, **{name: getattr(other, name) for name in LIGHT})
