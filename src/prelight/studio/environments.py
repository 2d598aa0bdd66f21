"""The environments a visitor can choose: our own skies and the maps named when the studio was started.

A visitor names them by an id of this list, never by a path.
"""

from __future__ import annotations

import io
import math
import os
import threading
from collections import OrderedDict
from collections.abc import Sequence
from datetime import timedelta
from pathlib import Path

import numpy as np

from ..arrays import Directions, Float32, Picture, Radiance, UInt32
from ..bases import cube_map
from ..errors import InputError
from ..files import Resolver
from ..images.tonemap import tonemap
from ..lighting.daylight import Daylight
from ..lighting.environment import STOCK_PREFIX, Environment
from ..lighting.moment import Site, date_of, moment_of
from ..lighting.rig import Rig
from ..lighting.sky import STOCK_SKIES
from .protocol_values import EnvironmentChoice, Sun
from .worlds import Worlds

MAP_SUFFIXES = (".hdr", ".exr")
_FIRST = STOCK_PREFIX + "sunset"
DAYLIGHT = "daylight"  # the choice; of a place, a day and an hour it is ``daylight_id``
_DAYLIGHT_TITLE = "Daylight: sun and clear sky of a place and an hour"
_KEPT_HOURS = 8
_MOST_MAPS = 200
_KEPT_BYTES = 1_000_000_000  # of opened maps
_SKY = (256, 512)  # rows and columns of what is shown behind the scene
_PREVIEW = (128, 256)
_MOST_ROWS = 256  # of the map that is turned while it is dragged
_METERED_CUBE = 32
_ROUGH_SKY = 48  # rows of the sky of an hour while it is dragged


class Environments:
    """Choices by their id, opened when first asked for; safe to use from several threads.

    Parameters
    ----------
    maps
        Maps, rig files or folders of six faces, as ``prelight relight`` takes them.
    folder
        Whose .hdr and .exr files can be chosen too; no links that lead out of it.

    Raises InputError for a folder that is none, or holds more than 200 maps.
    """

    def __init__(self, maps: Sequence[str] = (), *, folder: Path | None = None) -> None:
        self._sources: dict[str, str] = {}
        self._titles: dict[str, str] = {}
        for source in (*maps, *(_maps_in(folder) if folder else ())):
            if source.removeprefix(STOCK_PREFIX) in STOCK_SKIES and source.startswith(STOCK_PREFIX):
                continue  # listed below anyway
            self._add(_id_of(source, self._sources), source, title=Path(source).name)
        for name, sky in STOCK_SKIES.items():
            self._add(STOCK_PREFIX + name, STOCK_PREFIX + name, title=f"{name.capitalize()}: {sky.title}")
        self._titles[DAYLIGHT] = _DAYLIGHT_TITLE
        self.worlds = Worlds([source for source in maps if source.lower().endswith(".toml")])
        self._opened: OrderedDict[str, Environment] = OrderedDict()
        self._hours: OrderedDict[str, Environment] = OrderedDict()
        self._stops: dict[str, float] = {}
        self._previews: dict[str, bytes] = {}
        self._opening = threading.Lock()  # one at a time: each may be hundreds of megabytes

    def _add(self, key: str, source: str, *, title: str) -> None:
        self._sources[key], self._titles[key] = source, title

    def __contains__(self, key: object) -> bool:
        return key in self._titles or is_daylight(key)

    @property
    def first(self) -> str:
        """The id of the one to begin with: the first that was named, or the sky that shows shadows best."""
        first = next(iter(self._sources))
        return _FIRST if first.startswith(STOCK_PREFIX) else first

    @property
    def choices(self) -> tuple[EnvironmentChoice, ...]:
        """All, those named first in front."""
        return tuple(EnvironmentChoice(key, title) for key, title in self._titles.items())

    def source(self, key: str) -> str:
        """What a rig file calls a map: its file, from the root, or a name of our own. Raises InputError for no map."""
        if key not in self._sources:
            raise InputError("environment", f"{key[:80]!r} is not a map")
        source = self._sources[key]
        if source.lower().endswith(".toml"):
            raise InputError(
                "environment", f"{key[:80]!r} is a rig file itself; choose the map that it names"
            )
        return source if source.startswith(STOCK_PREFIX) else str(Path(source).resolve())

    def key_of(self, source: str) -> str:
        """The id of what a rig file calls so, by its name. Raises InputError if it is not among the choices."""
        named = [key for key, known in self._sources.items() if known == source]
        named += [key for key, known in self._sources.items() if Path(known).name == Path(source).name]
        if not named:
            reason = "is not among the maps of this studio; name it on the command line when you start it"
            raise InputError("environment", f"{source[:80]!r} {reason}")
        return named[0]

    def open(self, key: str, *, roughly: bool = False) -> Environment:
        """The environment of an id. Raises InputError if there is none, or its file cannot be read.

        ``roughly``: of an hour, with a sky of few pixels, if it is not there already.
        """
        if is_daylight(key):
            return self._daylight(key, roughly=roughly)
        if (known := self._opened.get(key)) is not None:
            return known  # without waiting for another map that is being read
        with self._opening:
            environment = self._read(key)
            self._opened[key] = environment
            while len(self._opened) > 1 and sum(map(_bytes_of, self._opened.values())) > _KEPT_BYTES:
                self._opened.popitem(last=False)
            return environment

    def _daylight(self, key: str, *, roughly: bool) -> Environment:
        if roughly and key not in self._hours:
            return daylight_of(key).environment(_ROUGH_SKY)
        with self._opening:
            if key not in self._hours:
                self._hours[key] = daylight_of(key).environment()
                while len(self._hours) > _KEPT_HOURS:
                    self._hours.popitem(last=False)
            return self._hours[key]

    def _read(self, key: str) -> Environment:
        if is_daylight(key):
            return daylight_of(key).environment()
        if key not in self._sources:
            raise InputError("environment", f"{key[:80]!r}, expected one of {', '.join(self._sources)}")
        return self._opened.get(key) or Rig.open(self._sources[key]).environment

    def stops(self, key: str) -> float:
        """The exposure that suits a map by itself: a white surface that faces its light best shows as one."""
        if is_daylight(key):
            return suitable_stops(self.open(key))  # an hour passes: none is kept
        if key not in self._stops:
            # Our own are painted for it.
            self._stops[key] = 0.0 if key.startswith(STOCK_PREFIX) else suitable_stops(self.open(key))
        return self._stops[key]

    def preview(self, key: str) -> bytes:
        """A small picture of a map, PNG. It is read for that, one map at a time, and not kept open."""
        if is_daylight(key):
            return preview_png(self.open(key), self.stops(key))
        with self._opening:
            if key not in self._previews:
                environment = self._read(key)
                stops = 0.0 if key.startswith(STOCK_PREFIX) else suitable_stops(environment)
                self._previews[key] = preview_png(environment, stops)
            return self._previews[key]


def daylight_id(sun: Sun) -> str:
    """The id of the sky of a place, a day and an hour."""
    where = f"{sun.latitude_deg:.6g},{sun.longitude_deg:.6g}"
    return f"{DAYLIGHT}:{where},{sun.date},{sun.hour:.6g},{sun.turbidity:.6g},{sun.zone or ''}"


def is_daylight(key: object) -> bool:
    """Whether it is such an id; it may still be wrong."""
    return isinstance(key, str) and key.startswith(DAYLIGHT + ":")


def daylight_of(key: str, *, north_deg: float = 0.0, scale: float = 1.0) -> Daylight:
    """The sun and the sky of such an id. Raises InputError for what is no place, day or hour."""
    parts = key.removeprefix(DAYLIGHT + ":").split(",")
    if len(parts) != 6 or len(key) > 200:
        raise InputError(
            "daylight", f"{key[:80]!r}, expected latitude, longitude, date, hour, turbidity and zone"
        )
    try:
        latitude, longitude, hour, turbidity = (float(parts[i]) for i in (0, 1, 3, 4))
    except ValueError:
        raise InputError("daylight", f"{key[:80]!r}: expected numbers") from None
    place = Site(latitude, longitude)
    when = moment_of("hour", clock(parts[2], hour), place=place, zone=parts[5] or None)
    return Daylight(place, when, turbidity=turbidity, north_deg=north_deg, scale=scale)


def clock(day: str, hour: float) -> str:
    """``2026-06-21T15:30:00`` of a day and its hours. Raises InputError for no day, no hour."""
    if not 0 <= hour <= 24:
        raise InputError("hour", f"{hour:g}, expected 0 to 24")
    date = date_of("date", day)
    return f"{date.isoformat()}T{timedelta(seconds=min(int(hour * 3600 + 0.5), 86_399))!s:0>8}"


def _id_of(source: str, known: dict[str, str]) -> str:
    name = Path(source).name or "map"
    return name if name not in known else f"{name} ({len(known)})"


def _maps_in(folder: Path) -> list[str]:
    """The maps in a folder by name, those that are links leading out of it left out."""
    resolver = Resolver(folder)
    try:
        names = sorted(n for n in os.listdir(resolver.root) if n.lower().endswith(MAP_SUFFIXES))
    except OSError:
        raise InputError(folder, "expected a folder of environment maps (.hdr or .exr)") from None
    if len(names) > _MOST_MAPS:
        raise InputError(folder, f"{len(names)} maps, at most {_MOST_MAPS} can be chosen from")
    found = []
    for name in names:
        try:
            path = resolver.path(name)
        except InputError:
            continue
        if path.is_file():
            found.append(str(path))
    return found


def _bytes_of(environment: Environment) -> int:
    return environment.pixels.nbytes + sum(map(_bytes_of, environment.parts))


# ---- What is made of one -----------------------------------------------------------------------------------------


def latlong(environment: Environment, rows: int, columns: int) -> Float32[np.ndarray, "rows columns 3"]:
    """An environment without its discs as a latitude-longitude map, seen at the middle of each pixel."""
    seen = environment.with_discs(()).radiance_along(map_directions(rows, columns))
    return seen.reshape(rows, columns, 3)


def map_directions(rows: int, columns: int) -> Directions:
    """(rows · columns, 3) unit directions of the middles of a latitude-longitude map's pixels, the top row first."""
    v, u = np.meshgrid((np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns, indexing="ij")
    azimuth, polar = (u - 0.5) * (2 * np.pi), v * np.pi
    d = np.stack([np.sin(polar) * np.sin(azimuth), np.cos(polar), -np.sin(polar) * np.cos(azimuth)], axis=-1)
    return np.ascontiguousarray(d.reshape(-1, 3), np.float32)


def _averaged(environment: Environment, rows: int, columns: int) -> Float32[np.ndarray, "rows columns 3"]:
    """The same from two by two points a pixel, lest a small sun be missed or made large."""
    fine = latlong(environment, 2 * rows, 2 * columns)
    return fine.reshape(rows, 2, columns, 2, 3).mean(axis=(1, 3), dtype=np.float32)


def small(environment: Environment) -> Environment:
    """A latitude-longitude map of at most 256 rows with the same light, quick to turn; discs stay discs."""
    if environment.layout == "latlong" and not (environment.parts or environment.paints):
        height, width = environment.pixels.shape[:2]
        least = -(-height // _MOST_ROWS)
        for size in range(least, 2 * least):
            if height % size == 0 and width % size == 0:
                pixels = environment.pixels
                if size > 1:
                    pixels = pixels.reshape(height // size, size, width // size, size, 3).mean(axis=(1, 3))
                pixels = pixels * environment.gain.astype(np.float32)
                return _of_light(pixels, environment, rotation_deg=environment.rotation_deg)
    whole = Environment.from_cube(environment.with_discs(()).cube(_MOST_ROWS // 2))
    return _of_light(_averaged(whole, _MOST_ROWS, 2 * _MOST_ROWS), environment)


def _of_light(pixels: Picture, environment: Environment, *, rotation_deg: float = 0.0) -> Environment:
    """A map with all the light of an environment, and its discs."""
    wanted, found = environment.with_discs(()).total, Environment(pixels, "latlong").total
    pixels = pixels * np.divide(wanted, found, out=np.ones(3), where=found > 0).astype(np.float32)
    pixels.setflags(write=False)
    return Environment(
        pixels, "latlong", rotation_deg=rotation_deg, name=environment.name, discs=environment.discs
    )


def turned(coarse: Environment, degrees: float) -> Environment:
    """A ``small`` map turned by moving its columns, so that where its pixels fall need not be found again."""
    from ..lighting.remembered_places import (
        turned_columns,
    )  # brings the compiler along: the page need not wait

    if degrees % 360 == 0:
        return coarse
    pixels, rest = turned_columns(coarse.pixels, coarse.rotation_deg + degrees)
    pixels.setflags(write=False)
    discs = tuple(disc.turned(degrees) for disc in coarse.discs)
    return Environment(pixels, "latlong", rotation_deg=rest, name=coarse.name, discs=discs)


def suitable_stops(environment: Environment) -> float:
    """−log₂ of the largest radiance that a white diffuse surface facing one of six ways has; 0 in the dark."""
    R = _METERED_CUBE
    cube = environment.cube(R) @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    d = cube_map.texel_directions(np.arange(6 * R * R, dtype=np.int32), R)
    light = (cube * cube_map.solid_angles(R)).reshape(-1)
    facing = np.maximum(np.concatenate([d, -d], axis=1), 0.0)
    brightest = float((light @ facing).max()) / math.pi
    return round(-math.log2(brightest), 2) if brightest > 0 else 0.0


def preview_png(environment: Environment, stops: float) -> bytes:
    """A picture of 256×128 pixels, as displayed."""
    from PIL import Image

    out = io.BytesIO()
    picture = tonemap(_averaged(environment, *_PREVIEW), exposure=stops)
    Image.fromarray(picture).save(out, "PNG", compress_level=6)
    return out.getvalue()


def sky_words(environment: Environment) -> UInt32[np.ndarray, "texels"]:
    """A map of 512×256 pixels in rgb9e5, the top row first: what is seen behind the scene."""
    return words_of_map(_averaged(environment, *_SKY).reshape(-1, 3))


def words_of_map(radiance: Radiance) -> UInt32[np.ndarray, "texels"]:
    """Radiance (texels, 3) in rgb9e5."""
    from .rgb9e5_kernels import pack_alone

    pixels = np.ascontiguousarray(radiance, np.float32)
    out = np.empty(len(pixels), np.uint32)
    pack_alone(pixels, out)
    return out
