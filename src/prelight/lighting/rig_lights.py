"""The tables [[spot]] and [[panel]] of a rig: lights with a place in the bake, aimed and moved."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator

from ..errors import InputError
from ..files import read_regular
from ..images.chromaticities import convert
from ..images.formats import read_radiance_map
from ..images.openexr import decode_exr
from ..images.textures import read_texture
from ..images.tonemap import srgb_decode
from .distributions import Distribution, Gobo, Polynomial, Power
from .ies import Photometry
from .keyframes import Ease, Track
from .painting import pointing
from .panel import Panel
from .quantities import Triple
from .rig_fields import Colour, Direction, Number, PlacedTable, Positive, Text
from .spot import Spot

_LARGEST_PICTURE = 200_000_000
Power_ = Annotated[Number, Field(ge=0, le=10_000)]
Width = Annotated[Number, Field(ge=1, le=350)]
Spread = Annotated[Number, Field(ge=1, le=170)]
PanelWidth = Annotated[Number, Field(ge=0.01, le=1)]
Coefficients = Annotated[list[Number], Field(min_length=1, max_length=41)]


_AIMS = ("direction", "azimuth_deg", "elevation_deg", "target")
_POWERS = ("power", "width_deg")
_STRENGTHS = ("intensity", "radiance", "power_w", "lumens")
_COLOURS = ("color", "kelvin")
Time = Annotated[Number, Field(gt=0, le=86_400)]
_MOST_KEYS = 1_000


class BeamKey(PlacedTable):
    """What may change in time; ``at`` is in seconds."""

    at: Time
    target: Direction | None = None
    roll_deg: Number | None = None
    power: Power_ | None = None
    width_deg: Width | None = None
    scale: Positive | None = None


class SpotKey(BeamKey):
    """A spot at a time; what is left out stays as before."""

    intensity: Colour | None = None


class PanelKey(BeamKey):
    """A panel at a time; what is left out stays as before."""

    position: Annotated[list[Number], Field(min_length=2, max_length=3)] | None = None
    width: Annotated[list[PanelWidth], Field(min_length=1, max_length=3)] | None = None
    radiance: Colour | None = None

    @field_validator("width", mode="before")
    @classmethod
    def _one_for_all(cls, value: object) -> object:
        return [value] if isinstance(value, int | float) else value


class BeamTable(PlacedTable):
    """Where a light points, and its shape over the directions."""

    layer: Text | None = None
    name: Text | None = None
    target: Direction | None = None
    roll_deg: Number = 0.0
    power: Power_ | None = None
    width_deg: Width | None = None
    polynomial: Coefficients | None = None
    ies: Text | None = None
    picture: Text | None = None
    spread_deg: Spread | None = None
    ease: Ease = "smooth"

    def check_beam(self) -> None:
        """Raises ValueError for two directions or two shapes."""
        if self.target is None:
            self.check_direction()
        elif self.has_direction:
            raise ValueError("expected either a direction or a target, not both")
        shapes = ("power", "width_deg", "polynomial", "ies", "picture")
        given = [name for name in shapes if getattr(self, name) is not None]
        if len(given) > 1:
            raise ValueError(f"expected one of {' and '.join(given)}: each is a shape of its own")
        if (self.picture is None) != (self.spread_deg is None):
            raise ValueError("picture and spread_deg belong together")
        for name in (self.ies, self.picture):
            if name is not None and "\x00" in name:
                raise ValueError("the file's name has a NUL character")


class SpotTable(BeamTable):
    """A spot; ``name`` is for people."""

    intensity: Colour | None = None
    scale: Positive = 1.0
    keys: list[SpotKey] = Field(default_factory=list, max_length=_MOST_KEYS)

    @model_validator(mode="after")
    def _check(self) -> SpotTable:
        self.check_beam()
        if self.intensity is None and self.ies is None:
            raise ValueError("intensity is missing: red, green, blue in W/sr along the beam")
        return self


class PanelTable(BeamTable):
    """A panel; ``name`` is for people. What is said of a direction needs a layer that can be turned."""

    position: Annotated[list[Number], Field(min_length=2, max_length=3)]
    width: Annotated[list[PanelWidth], Field(min_length=1, max_length=3)]
    radiance: Colour
    scale: Positive = 1.0
    shape: Literal["raised-cosine", "soft"] = "raised-cosine"
    keys: list[PanelKey] = Field(default_factory=list, max_length=_MOST_KEYS)

    @field_validator("width", mode="before")
    @classmethod
    def _one_for_all(cls, value: object) -> object:
        return [value] if isinstance(value, int | float) else value

    @property
    def turns(self) -> bool:
        """Whether a beam is described."""
        beam = (self.target, self.power, self.width_deg, self.polynomial, self.ies, self.picture)
        return self.has_direction or any(value is not None for value in beam)

    @model_validator(mode="after")
    def _check(self) -> PanelTable:
        if self.turns:
            self.check_beam()
        if len(self.width) not in (1, len(self.position)):
            raise ValueError(f"width has {len(self.width)} numbers, position {len(self.position)}")
        if any(not -1.0 <= part <= 2.0 for part in self.position):
            raise ValueError("position is in parts of the panel, 0 to 1 along each edge")
        return self


def track_of(table: Any, folder: Path, *, made: Callable[[Any, Distribution | None], Any]) -> Track:
    """The light that is ``made`` of a table, at 0 as the table has it and then as its keys say. Raises InputError."""
    values = {name: getattr(table, name) for name in table.model_fields_set - {"keys"}}
    times, tables = [0.0], [table]
    for key in table.keys:
        given = {name: getattr(key, name) for name in key.model_fields_set - {"at"}}
        for group in (_AIMS, _POWERS, _STRENGTHS, _COLOURS):  # one of a group replaces the others
            if any(name in given for name in group):
                values = {name: value for name, value in values.items() if name not in group}
        values |= given
        try:
            tables.append(type(table)(**values))
        except ValidationError as error:
            said = error.errors(include_url=False, include_context=False)[0]["msg"]
            raise InputError("keys", f"at {key.at:g} s: {said.removeprefix('Value error, ')}") from None
        times.append(key.at)
    files: dict[tuple, Distribution | None] = {}
    lights = []
    for one in tables:
        named = (one.power, one.width_deg, str(one.polynomial), one.ies, one.picture, one.spread_deg)
        if named not in files:  # the same file is the same distribution at all times
            files[named] = _distribution(one, folder)
        lights.append(made(one, files[named]))
    return Track(tuple(times), tuple(lights), table.ease)


def layered_track(table: SpotTable | PanelTable, folder: Path) -> Track:
    """The light of a table whose place is in a layer, as ``track_of``."""
    return track_of(table, folder, made=spot_of if isinstance(table, SpotTable) else panel_of)


def spot_of(table: SpotTable, distribution: Distribution | None) -> Spot:
    """The light of a table, in the shape that its keys or files describe. Raises InputError."""
    intensity = table.intensity
    if intensity is None:
        assert isinstance(distribution, Photometry)  # else there is an intensity: SpotTable
        peak = distribution.watts[0]
        intensity = (peak, peak, peak)
    return beam_of(table, distribution, _scaled(intensity, table.scale))


def panel_of(table: PanelTable, distribution: Distribution | None) -> Panel:
    """The light of a table, with a beam in the shape that its keys or files describe. Raises InputError."""
    width = table.width * len(table.position) if len(table.width) == 1 else table.width
    beam = beam_of(table, distribution, (1.0, 1.0, 1.0)) if table.turns else None
    return Panel(
        tuple(table.position), tuple(width), _scaled(table.radiance, table.scale),
        shape=table.shape, beam=beam, layer=table.layer,
    )  # fmt: skip


def _scaled(colour: Triple, scale: float) -> Triple:
    red, green, blue = colour
    return red * scale, green * scale, blue * scale


def beam_of(table: BeamTable, distribution: Distribution | None, intensity: Triple) -> Spot:
    """Where a table's light points, and its shape. Raises InputError."""
    direction = table.direction
    if table.azimuth_deg is not None and table.elevation_deg is not None:
        x, y, z = pointing(table.azimuth_deg, table.elevation_deg).tolist()
        direction = (x, y, z)
    return Spot(
        intensity, direction=direction, target=table.target, distribution=distribution,
        roll_deg=table.roll_deg, layer=table.layer,
    )  # fmt: skip


def _distribution(table: BeamTable, folder: Path) -> Distribution | None:
    if table.power is not None:
        return Power(table.power)
    if table.width_deg is not None:
        return Power.of_width(table.width_deg)
    if table.polynomial is not None:
        return Polynomial(tuple(table.polynomial))
    if table.ies is not None:
        return Photometry.open(folder / table.ies)
    if table.picture is not None and table.spread_deg is not None:
        path = folder / table.picture
        return Gobo(read_linear_picture(path), table.spread_deg, str(path))
    return None


def read_linear_picture(path: Path, *, signed: bool = False) -> np.ndarray:
    """A linear picture (height, width, 3), EXR and HDR as they are, PNG and JPEG from sRGB.

    ``signed``: values of an EXR that are a little below 0, as of an approximated light, count as 0. Raises InputError.
    """
    kind = path.suffix.lower()
    if kind == ".exr" and signed:
        picture, matrix = decode_exr(path, read_regular(path, limit=_LARGEST_PICTURE))
        if matrix is not None:
            convert(picture, matrix)
        picture = np.where(picture < 0.0, np.float32(0.0), picture)
    elif kind in (".exr", ".hdr"):
        picture = read_radiance_map(path)
    else:
        data = read_regular(path, limit=_LARGEST_PICTURE)
        picture = srgb_decode(read_texture(data, name=str(path)).astype(np.float32) / np.float32(255.0))
    if not np.isfinite(picture).all() or picture.min() < 0.0 or not picture.max() > 0.0:
        raise InputError(path, "is all black, or has values that are negative or not finite")
    return picture
