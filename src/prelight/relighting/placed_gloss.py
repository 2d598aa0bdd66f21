"""Gloss under lights with a place in the scene and a sky, for the layers whose direct light is found at run time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Float32, Float64, Int32, Normals, Positions, Radiance, Triangles
from ..drawing.view import View
from ..lighting.environment import Environment
from ..lighting.placed_lights import Lamp, PlacedLight
from ..lighting.quantities import Triple
from ..storage.bake import Bake
from .exitant import Lights, on_cells, read_exitant
from .live_gloss import Falling, LiveGloss
from .placed_direct import PlacedDirect
from .sky_direct import divided

_BALL = 24  # parts of a ball's surface, of which half are seen from anywhere
_SIDE = 4  # of a panel, in parts
_SMALL = (
    0.02  # of the scene's extent: a ball of a smaller radius is mirrored as a point, with its soft shadow
)
_AHEAD = 1e-3  # of a panel's shorter side: where shadow rays to it end
_FEW = 4  # rays to a small ball
_LIT = 1e-4  # cosine of a part that shines away

Lit = Sequence[tuple[PlacedLight, Triple]]  # lights of colour 1, and their colours


class PlacedGloss:
    """The glossy vertices of a layer under lamps, panels and an environment."""

    def __init__(self, live: LiveGloss, placed: PlacedDirect) -> None:
        self._live, self._placed = live, placed

    @classmethod
    def of(cls, bake: Bake, layer: str, placed: PlacedDirect) -> PlacedGloss | None:
        """None where the layer keeps no gloss. Raises DamagedBakeError."""
        exitant = read_exitant(bake, f"layers/{layer}/glossy")
        return None if exitant is None else cls(LiveGloss(exitant, bake.receivers), placed)

    def forget(self) -> None:
        """The light has changed."""
        self._live.forget()

    @property
    def milliseconds(self) -> float:
        """That the last change of light took, once somebody had looked."""
        return self._live.milliseconds

    def toward(
        self, eye: Triple, irradiance: Radiance, lit: Lit, environment: Environment | None = None
    ) -> Radiance:
        """(V, 3) to add to albedo × ``irradiance``."""
        return self._live.toward(eye, self._falling(irradiance, lit, environment))

    def drawn(
        self,
        view: View,
        triangles: Triangles,
        irradiance: Radiance,
        lit: Lit,
        environment: Environment | None = None,
        *,
        eye: Triple,
        fine: bool,
    ) -> Float32[np.ndarray, "height width 3"]:
        """The same as a picture to add."""
        falling = self._falling(irradiance, lit, environment)
        return self._live.drawn(view, triangles, eye=eye, falling=falling, fine=fine)

    def _falling(self, irradiance: Radiance, lit: Lit, environment: Environment | None) -> Falling:
        strong, rest = None, None
        if environment is not None and max(environment.total) > 0:
            strong, rest = divided(environment)
        placed = self._placed

        def found(there: PlacedDirect, rows: Int32[np.ndarray, "rows"]) -> Lights:
            parts = [_coloured(shining(there, light, rows), colour) for light, colour in lit]
            if strong is not None:
                parts += [
                    _of_direction(there, rows, d, energy)
                    for d, energy in zip(strong.directions, strong.energy, strict=True)
                ]
            none = np.zeros((len(rows), 0, 3), np.float32)
            ways, energies = ([none, *(part[k] for part in parts)] for k in (0, 1))
            return np.concatenate(ways, axis=1), np.concatenate(energies, axis=1)

        def of_rows(rows: Int32[np.ndarray, "rows"]) -> Lights | None:
            lights = found(placed, rows)
            return lights if lights[0].shape[1] else None

        def at(points: Positions, normals: Normals) -> Lights:
            there = placed.elsewhere(points, normals, shadow_rays=_FEW)
            return found(there, np.arange(len(points), dtype=np.int32))

        return Falling(irradiance, lambda: None if rest is None else on_cells(rest), of_rows, at)


def shining(placed: PlacedDirect, light: PlacedLight, rows: Int32[np.ndarray, "rows"]) -> Lights:
    """Parts of a light of colour 1 as some rows see them: unit directions (rows, parts, 3) toward them, and the
    irradiance (rows, parts, 3) that a surface facing each gets."""
    points = placed.points[rows].astype(np.float64)
    if isinstance(light, Lamp):
        middle = np.array(light.position)
        away = points - middle
        square = np.maximum(np.einsum("ij,ij->i", away, away), 1e-20)
        along = (away / np.sqrt(square)[:, None]) @ light.axes
        shape = np.ones((1, 1))
        if light.beam.distribution is not None:
            shape = np.maximum(light.beam.distribution.along(along), 0.0)
        whole = np.where(square > light.radius**2, 1 / square, 0)[:, None] * shape
        if light.radius <= _SMALL * placed.extent:
            seen = placed.share_of_ball(rows, middle, light.radius, rays=_FEW)
            way = (-away / np.sqrt(square)[:, None])[:, None]
            return way.astype(np.float32), (whole * seen[:, None] * np.ones(3))[:, None].astype(np.float32)
        facing = _spread(_BALL)
        places, areas = middle + light.radius * (1 + _AHEAD) * facing, np.full(_BALL, 1 / _BALL)
    else:
        places, facing, areas = _parts_of_panel(light.corners, light.normal)
        whole = None
    return _of_parts(placed, rows, places, facing=facing, areas=areas, whole=whole)


def _of_parts(
    placed: PlacedDirect,
    rows: Int32[np.ndarray, "rows"],
    places: Float64[np.ndarray, "parts 3"],
    *,
    facing: Float64[np.ndarray, "parts 3"],
    areas: Float64[np.ndarray, "parts"],
    whole: Float64[np.ndarray, "rows 1"] | None,
) -> Lights:
    """Parts that shine alike: of radiance 1, or so that all that face a row bring it ``whole``."""
    way = places - placed.points[rows].astype(np.float64)[:, None]
    square = np.maximum(np.einsum("nki,nki->nk", way, way), 1e-20)
    way /= np.sqrt(square)[:, :, None]
    weight = areas * np.maximum(-np.einsum("nki,ki->nk", way, facing), 0) / square
    weight[weight * square < _LIT * areas.max()] = 0
    energy = weight[:, :, None] * np.ones(3)
    if whole is not None:
        energy = energy / np.maximum(weight.sum(axis=1), 1e-30)[:, None, None] * whole[:, None]
    for k, place in enumerate(places):
        lit = np.flatnonzero(weight[:, k] > 0)
        energy[lit, k] *= placed.share_of_ball(rows[lit], place, 0.0, rays=1)[:, None]
    return way.astype(np.float32), energy.astype(np.float32)


def _parts_of_panel(corners: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middles of equal parts, a little in front; the way they face; their areas."""
    along, up = corners[1] - corners[0], corners[3] - corners[0]
    sides = np.linalg.norm(along), np.linalg.norm(up)
    k = (np.arange(_SIDE) + 0.5) / _SIDE
    s, t = (x.ravel()[:, None] for x in np.meshgrid(k, k, indexing="ij"))
    places = corners[0] + s * along + t * up + _AHEAD * min(sides) * normal
    return places, np.tile(normal, (_SIDE**2, 1)), np.full(_SIDE**2, sides[0] * sides[1] / _SIDE**2)


def _spread(count: int) -> Float64[np.ndarray, "count 3"]:
    """Unit vectors spread evenly, along a spiral."""
    z = 1 - 2 * (np.arange(count) + 0.5) / count
    turn = np.pi * (1 + 5**0.5) * np.arange(count)
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def _coloured(lights: Lights, colour: Triple) -> Lights:
    return lights[0], lights[1] * np.array(colour, np.float32)


def _of_direction(placed: PlacedDirect, rows: np.ndarray, d: np.ndarray, energy: np.ndarray) -> Lights:
    seen = placed.share_of_direction(rows, d)
    way = np.broadcast_to(np.float32(d), (len(rows), 1, 3))
    return way, (seen[:, None, None] * np.float32(energy)).astype(np.float32)
