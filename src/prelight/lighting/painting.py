"""Pieces that skies and rooms are painted from: gradations, discs, soft boxes, ground.

All take unit directions ``d`` (H, W, 3) float32 and give radiance, or a share in [0, 1], for each of them.
Colours are linear Rec.709; azimuths are measured from −Z towards +X, so the camera of the stock scenes,
which looks along −Z, has −90° on its left, 90° on its right and 180° in its back.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Float32, Float64, Picture
from .layouts import LatLong

Share = Float32[np.ndarray, "height width"]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def every_direction(height: int, width: int) -> Float32[np.ndarray, "height width 3"]:
    """Unit directions of the pixels of a lat-long map."""
    x, y = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return LatLong().directions(x[None, :], y[:, None]).astype(np.float32)


def pointing(azimuth_deg: float, elevation_deg: float) -> Float64[np.ndarray, "3"]:
    """The unit direction of an azimuth and an elevation above the horizon."""
    return LatLong().directions(
        np.float64(0.5 + azimuth_deg / 360.0), np.float64(0.5 - elevation_deg / 180.0)
    )


def hue(red: float, green: float, blue: float) -> Float32[np.ndarray, "3"]:
    """A colour at luminance one."""
    colour = np.array([red, green, blue])
    return (colour / (colour @ LUMINANCE)).astype(np.float32)


def mixed(first: Float32[np.ndarray, "3"], second: Float32[np.ndarray, "3"], share: Share) -> Picture:
    """From the first colour (share 0) to the second (share 1)."""
    return first + (second - first) * share[..., None]


def by_elevation(height: int, steps: Sequence[tuple[float, tuple[float, float, float]]]) -> Picture:
    """Colours (height, 1, 3) of the rows of a map, between the given ones (elevation in degrees, colour)."""
    elevation = 90.0 - (np.arange(height) + 0.5) * 180.0 / height
    degrees, colours = [step[0] for step in steps], np.array([step[1] for step in steps])
    rows = [np.interp(elevation, degrees, channel) for channel in colours.T]
    return np.stack(rows, axis=-1)[:, None, :].astype(np.float32)


def angle_to(d: Picture, direction: Float64[np.ndarray, "3"]) -> Share:
    """Angle in radians between every direction and one."""
    return np.arccos(np.clip(d @ direction.astype(np.float32), -1.0, 1.0))


def cie_overcast(d: Picture) -> Share:
    """Luminance of the CIE overcast sky, one at the zenith and a third at the horizon. [CIE2003]"""
    return (1.0 + 2.0 * np.maximum(d[..., 1], 0.0)) / 3.0


def cie_clear(d: Picture, sun: Float64[np.ndarray, "3"]) -> Share:
    """Luminance of the CIE standard clear sky (type 12), one at the zenith; the sun itself is not in it.

    Gradation 1 − exp(−0.32 / cos z), indicatrix 1 + 10 (exp(−3χ) − exp(−3π/2)) + 0.45 cos²χ. [CIE2003]
    """

    def indicatrix(chi: Share) -> Share:
        return 1.0 + 10.0 * (np.exp(-3.0 * chi) - np.exp(-1.5 * np.pi)) + 0.45 * np.cos(chi) ** 2

    gradation = 1.0 - np.exp(-0.32 / np.maximum(d[..., 1], 0.01))
    zenith = (1.0 - np.exp(-0.32)) * indicatrix(np.arccos(np.float32(sun[1])))
    return gradation * indicatrix(angle_to(d, sun)) / zenith


def disc(d: Picture, direction: Float64[np.ndarray, "3"], radius_deg: float, edge_deg: float = 0.35) -> Share:
    """One inside a disc, zero outside, with an edge that is a pixel wide or softer."""
    return np.clip((np.radians(radius_deg) - angle_to(d, direction)) / np.radians(edge_deg) + 0.5, 0.0, 1.0)


def soft_box(
    d: Picture,
    direction: Float64[np.ndarray, "3"],
    width_deg: float,
    height_deg: float,
    *,
    edge: float = 0.12,
) -> Share:
    """An upright rectangle facing the scene: one in the middle, falling off gently, then over ``edge``."""
    right = np.cross(-direction, (0.0, 1.0, 0.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, -direction)
    out = np.zeros(d.shape[:2], np.float32)
    # Only a cone around the box is looked at.
    reach = np.hypot(np.tan(np.radians(0.5 * width_deg)), np.tan(np.radians(0.5 * height_deg)))
    near = d @ direction.astype(np.float32)
    there = near > np.cos(np.arctan(reach))
    part = d[there] / near[there][:, None]
    s = np.abs(part @ right.astype(np.float32)) / np.tan(np.radians(0.5 * width_deg))
    t = np.abs(part @ up.astype(np.float32)) / np.tan(np.radians(0.5 * height_deg))
    out[there] = np.clip((1.0 - np.maximum(s, t)) / edge, 0.0, 1.0) * (1.0 - 0.3 * (s * s + t * t) / 2.0)
    return out


def add_light(picture: Picture, share: Share, irradiance: Sequence[float]) -> None:
    """Add a light of this shape that gives a surface facing it the irradiance (red, green, blue), in place.

    So a sun painted as a disc larger than the real one, which no pixel could hold, keeps its energy.
    """
    weights = LatLong().solid_angles(*share.shape)[:, 0]
    whole = float(weights @ share.sum(axis=1, dtype=np.float64))
    lit = share > 0.0
    picture[lit] += share[lit][:, None] * (np.array(irradiance) / whole).astype(np.float32)


def lay_ground(
    picture: Picture, albedo: Sequence[float], *, haze: float = 0.3, reach_deg: float = 3.0
) -> None:
    """Paint the lower half as an endless diffuse plane lit by the upper half, in place.

    Towards the horizon it takes on that share (``haze``) of what stands above it, over ``reach_deg``.
    """
    height, width = picture.shape[:2]
    horizon = height // 2
    weights = LatLong().solid_angles(height, width)[:horizon, 0]
    cosine = np.cos((np.arange(horizon) + 0.5) * np.pi / height)
    irradiance = (weights * cosine) @ picture[:horizon].sum(axis=1, dtype=np.float64)
    ground = (np.array(albedo) * irradiance / np.pi).astype(np.float32)
    depth_deg = (np.arange(height - horizon) + 0.5) * 180.0 / height
    share = (haze * np.exp(-depth_deg / reach_deg)).astype(np.float32)[:, None, None]
    above = np.minimum(
        picture[horizon - 1], 4.0 * np.median(picture[horizon - 1], axis=0)
    )  # no lamp's mirror image
    picture[horizon:] = ground * (1.0 - share) + share * above
