"""The older specular-glossiness model, turned into metal and roughness."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .appearance import SpecularGlossiness

_DIELECTRIC = 0.04  # reflectance at normal incidence of an index of refraction of 1.5


@dataclass(frozen=True)
class MetalAndRoughness:
    """What metallic-roughness says in place of diffuse, specular and glossiness."""

    colour: tuple[float, float, float]
    metallic: float
    roughness: float
    specular: float  # 1: reflects as glass at normal incidence


def converted(given: SpecularGlossiness) -> MetalAndRoughness:
    """Metal so that diffuse and specular reflectance are kept in brightness.

    A surface with metallic m and colour c has the diffuse colour c (1-0.04) (1-m) and the specular colour
    0.04 (1-m) + c m; eliminating c leaves a quadratic equation for m. Where a texture says what is specular it
    is not read, and the surface taken as no metal: most are none, and the factors alone are mostly 1.

    References
    ----------
    Khronos, KHR_materials_pbrSpecularGlossiness, "Converting from specular-glossiness", with its example
    `convert-between-workflows` (three.pbrUtilities.js), 2017.
    """
    diffuse = (_unit(given.diffuseFactor[0]), _unit(given.diffuseFactor[1]), _unit(given.diffuseFactor[2]))
    specular = tuple(_unit(value) for value in given.specularFactor)
    roughness = 1 - _unit(given.glossinessFactor)
    if given.specularGlossinessTexture is not None:
        return MetalAndRoughness(diffuse, 0.0, roughness, 1.0)
    left = 1 - max(specular)  # what is not reflected, and so reaches the diffuse colour
    metallic = _metallic(_brightness(diffuse), _brightness(specular), left)
    # A dielectric that reflects less than glass says so in ``specular``: its colour is then not raised.
    through = max(left, 1 - _DIELECTRIC) if metallic == 0 else 1 - _DIELECTRIC
    dielectric = (left / through / max(1 - metallic, 1e-6) * value for value in diffuse)
    metal = ((value - _DIELECTRIC * (1 - metallic)) / max(metallic, 1e-6) for value in specular)
    share = metallic * metallic
    pairs = zip(dielectric, metal, strict=True)
    red, green, blue = (_unit(d * (1 - share) + m * share) for d, m in pairs)
    reflects = min(1.0, max(specular) / _DIELECTRIC) if metallic == 0 else 1.0
    return MetalAndRoughness((red, green, blue), metallic, roughness, reflects)


def _metallic(diffuse: float, specular: float, left: float) -> float:
    if specular < _DIELECTRIC:
        return 0.0
    b = diffuse * left / (1 - _DIELECTRIC) + specular - 2 * _DIELECTRIC
    discriminant = max(b * b - 4 * _DIELECTRIC * (_DIELECTRIC - specular), 0.0)
    return _unit((math.sqrt(discriminant) - b) / (2 * _DIELECTRIC))


def _brightness(colour: tuple[float, ...]) -> float:
    red, green, blue = colour
    return math.sqrt(0.299 * red * red + 0.587 * green * green + 0.114 * blue * blue)


def _unit(value: float) -> float:
    return min(max(value, 0.0), 1.0)
