"""Prelight's materials from those of an MTL file.

A highlight of exponent Ns becomes a microfacet roughness: α = √(2/(Ns + 2)), perceptual roughness √α. Ks is
the reflectance at normal incidence: with F₀ the mean of Ks, an index of refraction (1 + √F₀)/(1 − √F₀); more
than a quarter over a darker Kd is a metal of colour Ks. Models without a highlight (illum 0 and 1) are
diffuse. The PBR extension's Pr, Pm, Pc and Pcr go before all that.

References
----------
Walter, Marschner, Li and Torrance, Microfacet Models for Refraction through Rough Surfaces, 2007 (the
exponent 2/α² − 2 of a Beckmann distribution); Wavefront, Advanced Visualizer Manual, appendix B2 (MTL).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from ...arrays import Texture
from ...errors import InputError
from ...files import Resolver
from ...images.textures import LARGEST_FILE, read_texture
from ...material import GREY, Material
from ..mesh import short_name
from .mtl import Entry, MapStatement, parse_map

_MOST_REFLECTED = 0.25  # at normal incidence by a dielectric: an index of refraction of 3
_METAL = 4.0  # Ks over Kd from which a strong reflection is a metal's
_REFRACTING = (6, 7)  # illumination models
_MOST_TEXTURES, _MOST_PIXELS = 1024, 256 << 20  # of a scene
_NAMED = 8
# Statements that change nothing seen here: ambient light, and what `surface_of` reads.
_READ = frozenset(
    ["ka", "kd", "ks", "ke", "ns", "ni", "d", "tr", "tf", "illum", "pr", "pm", "pc", "pcr",
     "map_ka", "map_kd", "map_ke"]
)  # fmt: skip


@dataclass
class TextureShelf:
    """The pictures that materials name, each read once."""

    resolver: Resolver
    textures: list[Texture] = field(default_factory=list)
    indices: dict[str, int | None] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    pixels: int = 0

    def index_of(self, file: str) -> int | None:
        """Which of ``textures`` it is; None where it cannot be read, and ``failures`` says why."""
        name = file.replace("\\", "/")
        if name not in self.indices:
            self.indices[name] = self._read(name)
        return self.indices[name]

    def _read(self, name: str) -> int | None:
        try:
            if len(self.indices) >= _MOST_TEXTURES or self.pixels >= _MOST_PIXELS:
                raise InputError(name, f"more than {_MOST_TEXTURES:,} textures or 256 Mpx in all")
            texture = read_texture(self.resolver.read(name, limit=LARGEST_FILE), name=name)
        except InputError as error:
            self.failures.append(f"texture '{short_name(name)}' not read ({error.reason}): plain colour used")
            return None
        self.pixels += texture.shape[0] * texture.shape[1]
        self.textures.append(texture)
        return len(self.textures) - 1

    @property
    def notes(self) -> list[str]:
        """A line for each of the first few failures, and one for the rest."""
        more = len(self.failures) - _NAMED
        rest = [f"textures not read: {more:,} more, plain colours used"] if more > 0 else []
        return self.failures[:_NAMED] + rest


def surface_of(
    entry: Entry, shelf: TextureShelf, unread: Counter[str]
) -> tuple[Material, MapStatement | None]:
    """The material, and how the coordinates of its textures are to be changed.

    ``unread`` counts what the entry says and the material does not.
    """
    unread.update(keyword for keyword in entry.statements if keyword not in _READ)
    kd, ks = _colour(entry, "kd", unread), _colour(entry, "ks", unread)
    illum = int(_value(entry, "illum", 2.0, 0, 10))
    ni = _value(entry, "ni", 1.5, 1.0, 3.0)
    ns = _value(entry, "ns", 0.0, 0.0, 1e6)
    transmission = 1 - _value(entry, "d", 1 - _value(entry, "tr", 0.0, 0, 1), 0, 1)
    colour, rough, metallic, specular = kd or GREY, (2 / (ns + 2)) ** 0.25, 0.0, 0.0
    reflected = sum(ks or (0, 0, 0)) / 3
    if "pr" in entry.statements or "pm" in entry.statements:
        rough, metallic, specular = _value(entry, "pr", rough, 0, 1), _value(entry, "pm", 0.0, 0, 1), 1.0
    elif illum in _REFRACTING:
        transmission, specular = transmission or 1.0, 1.0
    elif illum >= 2 and reflected > _MOST_REFLECTED and reflected > _METAL * max(colour):
        colour, metallic, specular = ks or GREY, 1.0, 1.0
    elif illum >= 2 and reflected > 0:
        specular = 1.0
        if not transmission:
            unread["Ks beyond a dielectric's 0.25"] += reflected > _MOST_REFLECTED
            root = min(reflected, _MOST_REFLECTED) ** 0.5
            ni = (1 + root) / (1 - root)
    if transmission and kd is not None and "tf" in entry.statements:
        colour = _colour(entry, "tf", unread) or colour
    texture, placed = _texture(entry, "map_kd", shelf, unread)
    glow, _ = _texture(entry, "map_ke", shelf, unread)
    emission = _triple(entry, "ke") or ((1.0, 1.0, 1.0) if glow is not None else (0.0, 0.0, 0.0))
    material = Material(
        short_name(entry.name), colour, texture, roughness=rough, metallic=metallic, specular=specular,
        ior=ni, transmission=transmission, clearcoat=_value(entry, "pc", 0.0, 0, 1),
        clearcoat_roughness=_value(entry, "pcr", 0.0, 0, 1), emission=_clipped(emission, 1e30),
        emission_texture=glow,
    )  # fmt: skip
    return material, placed


def _texture(
    entry: Entry, keyword: str, shelf: TextureShelf, unread: Counter[str]
) -> tuple[int | None, MapStatement | None]:
    if not entry.statements.get(keyword):
        return None, None
    statement = parse_map(entry.statements[keyword])
    unread.update(f"{option} of a map" for option in statement.ignored)
    return shelf.index_of(statement.file), statement


def _triple(entry: Entry, keyword: str) -> tuple[float, float, float] | None:
    """Three numbers, or one for all three."""
    match entry.numbers(keyword):
        case [red, green, blue, *_]:
            return red, green, blue
        case [grey, *_]:
            return grey, grey, grey
    return None


def _clipped(colour: Sequence[float], most: float) -> tuple[float, float, float]:
    red, green, blue = (min(max(value, 0.0), most) for value in colour)
    return red, green, blue


def _colour(entry: Entry, keyword: str, unread: Counter[str]) -> tuple[float, float, float] | None:
    found = _triple(entry, keyword)
    if found is None:
        unread[f"{keyword.title()} without numbers"] += keyword in entry.statements
        return None
    clipped = _clipped(found, 1.0)
    unread[f"{keyword.title()} outside 0 to 1, clipped"] += clipped != found
    return clipped


def _value(entry: Entry, keyword: str, default: float, least: float, most: float) -> float:
    found = entry.numbers(keyword)
    return default if found is None else min(max(found[0], least), most)
