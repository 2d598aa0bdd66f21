"""A rig: everything a designer sets. Its environment, with discs and paint, spots and panels; a TOML file or a map."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import InputError
from ..files import read_regular
from .daylight import Daylight
from .disc import Disc
from .environment import STOCK_PREFIX, Environment
from .glass import Glass
from .keyframes import Track
from .outside import Outside
from .painting import pointing
from .panel import Panel
from .placed_lights import PlacedLight
from .quantities import Triple
from .regions import Cap, Region, Window
from .rig_file import DiscTable, EnvironmentTable, MapTable, PaintTable, RigTables, checked_tables
from .rig_lights import PanelTable, SpotTable, layered_track
from .rig_outside import outside_of
from .rig_placed import placed_track
from .rig_portals import glass_table
from .rig_sky import daylight_of
from .sky import STOCK_SKIES
from .spot import Spot

_LARGEST_FILE = 1_000_000


@dataclass(frozen=True)
class Rig:
    """What lights a bake: an environment, the lights that steerable layers have places for, and lamps.

    ``tracks`` are of steerable layers; ``lamps`` have a place of their own in the scene. ``daylight`` is what
    ``environment`` was made from, where a sun's place and hour are given; ``outside`` the world before it, which stands
    as it does at ``seconds``; ``portals`` the glass of a room's portals.
    """

    environment: Environment
    tracks: tuple[Track, ...] = ()
    lamps: tuple[Track, ...] = ()
    daylight: Daylight | None = None
    outside: Outside | None = None
    seconds: float = 0.0
    portals: tuple[Glass, ...] = ()

    @property
    def surroundings(self) -> Environment:
        """The environment, for a bake with nothing else. Raises InputError if the rig has lamps, spots or panels."""
        if self.lamps:
            what = "but this bake has no transfer layer, which takes them; leave them out, or prelight bake transfer"
            raise InputError("rig", f"has lights with a place in the scene ({len(self.lamps)}), {what}")
        if self.tracks:
            what = "but no layer of this bake has a place for them; leave them out, or light a steerable bake"
            raise InputError("rig", f"has [[spot]] or [[panel]] ({len(self.tracks)}), {what}")
        if self.outside is not None:
            what = "but this bake has no portals layer, which alone sees it; leave it out, or prelight bake portals"
            raise InputError("rig", f"has [outside], {what}")
        if self.portals:
            what = "but this bake has no portals layer; leave them out, or prelight bake portals"
            raise InputError("rig", f"has [[portal]] ({len(self.portals)}), {what}")
        return self.environment

    @property
    def lights(self) -> tuple[Spot | Panel, ...]:
        """Spots and panels, as they are at the beginning."""
        return self.lights_at(0.0)

    def lights_at(self, seconds: float) -> tuple[Spot | Panel, ...]:
        """Spots and panels at a time."""
        return tuple(track.at(seconds) for track in self.tracks)  # ty: ignore[invalid-explicit-return]

    def lamps_at(self, seconds: float) -> tuple[PlacedLight, ...]:
        """Lights with a place of their own, at a time."""
        return tuple(track.at(seconds) for track in self.lamps)  # ty: ignore[invalid-explicit-return]

    def at(self, seconds: float) -> Rig:
        """Everything at rest, as it is at a time."""
        moved = {
            name: tuple(Track((0.0,), (track.at(seconds),)) for track in getattr(self, name))
            for name in ("tracks", "lamps")
        }
        return replace(self, seconds=seconds, **moved)

    def under(self, daylight: Daylight) -> Rig:
        """With the sky and the sun of another hour in place of its map; discs and paint of its own stay."""
        known = () if self.daylight is None else self.daylight.environment().discs
        own = tuple(disc for disc in self.environment.discs if disc not in known)
        sky = daylight.environment()
        sky = replace(sky, paints=self.environment.paints, discs=(*sky.discs, *own))
        return replace(self, environment=sky, daylight=daylight)

    @property
    def duration(self) -> float:
        """When the last light stops changing, seconds; 0 where nothing moves."""
        world = () if self.outside is None else (self.outside.duration,)
        return max((*(track.duration for track in (*self.tracks, *self.lamps)), *world), default=0.0)

    @classmethod
    def open(cls, source: str, *, layout: str | None = None) -> Rig:
        """A rig file (.toml), an environment map, or ``stock:NAME``; ``layout`` is the map's, if not recognised.

        A rig file has tables ``[environment]``, ``[[disc]]``, ``[[paint]]``, ``[[lamp]]``, ``[[spot]]``, ``[[panel]]``
        (docs/rig.md); a file it names is looked for beside it. Raises InputError, with a JSON pointer for what is
        wrong in the file.
        """
        if source in STOCK_SKIES and not Path(source).exists():
            raise InputError(source, f"no such file; did you mean {STOCK_PREFIX}{source}?")
        if source.startswith(STOCK_PREFIX) or not source.lower().endswith(".toml"):
            return cls(Environment.open(source, layout))
        path = Path(source)
        try:
            document = tomllib.loads(read_regular(path, limit=_LARGEST_FILE).decode())
        except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
            raise InputError(path, f"not a TOML rig: {error}") from None
        except ValueError as error:
            if isinstance(error, InputError):
                raise
            raise InputError(path, "not a TOML rig: a number in it has thousands of digits") from None
        tables = checked_tables(document, path)
        if tables.environment is None and layout is not None:
            raise InputError("--layout", f"{layout!r}, but the rig {path.name} has no map")
        environment = Environment.dark()
        daylight = None if tables.sun is None else daylight_of(tables.sun, path)
        outside = None if tables.outside is None else outside_of(tables.outside, path)
        if tables.environment is not None:
            environment = _environment(tables.environment, path, layout=layout)
        try:
            own = [_disc(disc) for disc in tables.disc]
            if daylight is not None:
                environment = daylight.environment()
            for paint in tables.paint:
                environment = environment.painted(_region(paint), paint.radiance, opacity=paint.opacity)
            environment = environment.with_discs([*environment.discs, *own])
        except InputError as error:  # such as radiance beyond float32
            raise InputError(path, error.reason) from None
        tracks, lamps = _tracks(tables, path)
        glass = tuple(glass_table(table, path, n) for n, table in enumerate(tables.portal))
        return cls(environment, tracks, lamps, daylight, outside, portals=glass)


def _tracks(tables: RigTables, path: Path) -> tuple[tuple[Track, ...], tuple[Track, ...]]:
    """Lights of steerable layers, and those with a place of their own."""
    layered: list[Track] = []
    placed: list[Track] = []
    for kind, rows in (("lamp", tables.lamp), ("spot", tables.spot), ("panel", tables.panel)):
        for n, table in enumerate(rows):
            try:
                if isinstance(table, SpotTable | PanelTable):
                    layered.append(layered_track(table, path.parent))
                else:
                    placed.append(placed_track(table, path.parent))
            except InputError as error:
                pointer = f"{path.name} /{kind}/{n}"
                raise InputError(
                    error.path, error.reason, f"{error.where}, {pointer}" if error.where else pointer
                ) from None
    return tuple(layered), tuple(placed)


def _environment(table: EnvironmentTable, path: Path, *, layout: str | None) -> Environment:
    own = _opened(table, path, layout=layout, pointer="/environment/map")
    if table.blend is None:
        return own
    other = _opened(table.blend, path, layout=None, pointer="/environment/blend/map")
    return own.blended(other, table.blend.share)


def _opened(table: MapTable, rig: Path, *, layout: str | None, pointer: str) -> Environment:
    source = table.map if table.map.startswith(STOCK_PREFIX) else str(rig.parent / table.map)
    try:
        environment = Environment.open(source, layout or table.layout)
        return environment.rotated(table.rotate_deg).scaled(table.scale).tinted(table.tint)
    except InputError as error:
        where = f"{error.where}, {rig.name} {pointer}" if error.where else f"{rig.name} {pointer}"
        raise InputError(error.path, error.reason, where) from None


def _direction(table: DiscTable | PaintTable) -> Triple:
    if table.direction is not None:
        return table.direction
    assert table.azimuth_deg is not None  # one or the other: rig_file
    assert table.elevation_deg is not None
    x, y, z = pointing(table.azimuth_deg, table.elevation_deg).tolist()
    return x, y, z


def _disc(table: DiscTable) -> Disc:
    return Disc(_direction(table), table.radius_deg, table.radiance, table.softness)


def _region(table: PaintTable) -> Region:
    if table.radius_deg is None:
        return Window(table.azimuth_range_deg or (-180.0, 180.0), table.elevation_range_deg or (-90.0, 90.0))
    return Cap(_direction(table), table.radius_deg, table.softness or 0.0)
