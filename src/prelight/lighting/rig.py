"""A rig: everything a designer sets. Its environment, with discs and paint, spots and panels; a TOML file or a map."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..files import read_regular
from .disc import Disc
from .environment import STOCK_PREFIX, Environment
from .keyframes import Track
from .painting import pointing
from .panel import Panel
from .quantities import Triple
from .regions import Cap, Region, Window
from .rig_file import DiscTable, EnvironmentTable, MapTable, PaintTable, RigTables, checked_tables
from .rig_lights import track_of
from .sky import STOCK_SKIES
from .spot import Spot

_LARGEST_FILE = 1_000_000


@dataclass(frozen=True)
class Rig:
    """What lights a bake: an environment, and the lights that steerable layers have places for."""

    environment: Environment
    tracks: tuple[Track, ...] = ()

    @property
    def surroundings(self) -> Environment:
        """The environment, for a bake with nothing else. Raises InputError if the rig has spots or panels."""
        if self.tracks:
            what = "but no layer of this bake has a place for them; leave them out, or light a steerable bake"
            raise InputError("rig", f"has [[spot]] or [[panel]] ({len(self.tracks)}), {what}")
        return self.environment

    @property
    def lights(self) -> tuple[Spot | Panel, ...]:
        """Spots and panels, as they are at the beginning."""
        return self.lights_at(0.0)

    def lights_at(self, seconds: float) -> tuple[Spot | Panel, ...]:
        """Spots and panels at a time."""
        return tuple(track.at(seconds) for track in self.tracks)

    @property
    def duration(self) -> float:
        """When the last light stops changing, seconds; 0 where nothing moves."""
        return max((track.duration for track in self.tracks), default=0.0)

    @classmethod
    def open(cls, source: str, *, layout: str | None = None) -> Rig:
        """A rig file (.toml), an environment map, or ``stock:NAME``; ``layout`` is the map's, if not recognised.

        A rig file has tables ``[environment]``, ``[[disc]]``, ``[[paint]]``, ``[[spot]]`` and ``[[panel]]``
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
        if tables.environment is not None:
            environment = _environment(tables.environment, path, layout=layout)
        try:
            for paint in tables.paint:
                environment = environment.painted(_region(paint), paint.radiance, opacity=paint.opacity)
            environment = environment.with_discs([_disc(disc) for disc in tables.disc])
        except InputError as error:  # such as radiance beyond float32
            raise InputError(path, error.reason) from None
        return cls(environment, _tracks(tables, path))


def _tracks(tables: RigTables, path: Path) -> tuple[Track, ...]:
    made: list[Track] = []
    for kind, rows in (("spot", tables.spot), ("panel", tables.panel)):
        for n, table in enumerate(rows):
            try:
                made.append(track_of(table, path.parent))
            except InputError as error:
                pointer = f"{path.name} /{kind}/{n}"
                raise InputError(
                    error.path, error.reason, f"{error.where}, {pointer}" if error.where else pointer
                ) from None
    return tuple(made)


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
