"""Relighting a cloud layer: lamps that move, their direct light by shadow rays, what bounces of it from the cloud.

What follows depends on the lamps alone, not on those before. A lamp that moves is made anew; one that changes its
colour is multiplied.
"""

from __future__ import annotations

import time
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Float32, Normals, Positions, Radiance, Triangles
from ..drawing.view import View
from ..errors import InputError
from ..lighting.placed_lights import Lamp, PlacedLight
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..rays.segments import PlainSegments
from ..storage.bake import Bake
from ..storage.cloud_layer import INTERPOLATIONS
from .cloud_fading import Fading
from .cloud_kernels import cloud_light
from .cloud_weights import CloudWeights, Weights
from .environment import Update
from .pixel_light import PointLit
from .placed_direct import SHADOW_RAYS, PlacedDirect, white
from .placed_gloss import PlacedGloss
from .stand_ins import StandIns
from .stored_cloud import CloudLayer, open_cloud

_REMEMBERED = 8  # lamps that were lit, and may come back


@dataclass(frozen=True)
class _Known:
    """What there is to know of one lamp of colour 1."""

    direct: Radiance
    weights: Weights
    notes: tuple[str, ...]


class CloudRelighter:
    """A ``LiveLayer`` of lamps, spots and panels with a place in the scene.

    Parameters
    ----------
    bake
        A ``Bake`` or the path of one.
    name
        Of its cloud layer; the first if not given.
    interpolation
        ``fitted``: weights and modes fitted to the direct light; or ``kernel``, the paper's, for lamps that shine
        alike in all directions. The layer's own if not given.
    shadow_rays
        From each vertex to each lamp that is not a point.
    fading
        For a live session, that lights it again until nothing ``is_settling``: weights follow the lamps in time.

    Raises
    ------
    InputError, DamagedBakeError
        There is no bake, it has no such layer or not this interpolation, or it is damaged.
    """

    def __init__(
        self,
        bake: Bake | str | Path,
        name: str | None = None,
        *,
        interpolation: str | None = None,
        shadow_rays: int = SHADOW_RAYS,
        fading: Fading | None = None,
    ) -> None:
        self._fading = fading
        self.bake = bake if isinstance(bake, Bake) else Bake.open(bake)
        self.layer: CloudLayer = open_cloud(self.bake, name)
        self.name = self.layer.name
        chosen = interpolation or str(self.layer.parameters["interpolation"])
        if chosen not in INTERPOLATIONS or (chosen == "fitted" and not self.layer.extras):
            there = INTERPOLATIONS if self.layer.extras else INTERPOLATIONS[1:]
            raise InputError("interpolation", f"{chosen!r}, expected {' or '.join(there)}")
        receivers = self.bake.receivers
        segments = PlainSegments(receivers.positions, self.bake.triangles, receivers.normals)
        self._placed = PlacedDirect(self.bake, self.layer.origins, shadow_rays=shadow_rays)
        self._weights = CloudWeights(self.layer, segments, interpolation=chosen)
        self._gloss = PlacedGloss.of(self.bake, self.name, self._placed)
        self._known: OrderedDict[PlacedLight, _Known] = OrderedDict()
        self._lit: list[tuple[PlacedLight, Triple]] = []
        self._indirect = np.zeros((len(receivers), 3), np.float32)
        self.last = Update("none", 0.0, 0, 0)

    is_coarse = False

    @property
    def interpolation(self) -> str:
        return self._weights.interpolation

    @property
    def is_settling(self) -> bool:
        """Whether lighting it again, a moment later, would show something else."""
        return self._fading is not None and self._fading.is_settling

    def light(
        self, rig: Rig, *, coarse: StandIns | None = None, check: Callable[[], None] = lambda: None
    ) -> bool:
        """Take the rig's lamps, as they are at its beginning; True if something changed.

        Raises InputError for a spot or a panel, where the interpolation is the paper's.
        """
        del coarse, check
        return self.shine(rig.lamps_at(0.0))

    def shine(self, lights: Iterable[PlacedLight]) -> bool:
        """Be lit by these lights and nothing else; True if that is a change. Lights of colour 0 take no time."""
        began = time.perf_counter()
        lit = [(white(light), light.colour) for light in lights if max(light.colour) > 0]
        if self.interpolation == "kernel":
            _refuse_shaped(lit)
        changed = lit != self._lit or self.is_settling
        new = 0
        for light in dict.fromkeys(light for light, _ in lit):
            if light not in self._known:
                self._known[light] = self._found(light)
                new += 1
        self._lit = lit
        self._forget()
        read = 0
        if changed:
            self._indirect = self._bounced()
            if self._gloss is not None:
                self._gloss.forget()
            read = self.layer.bytes if lit else 0
        took = (time.perf_counter() - began) * 1e3
        self.last = Update("full" if changed else "none", took, read, new)
        return changed

    def _found(self, light: PlacedLight) -> _Known:
        direct = self._placed.of(light)
        notes = [note for note in (self._inside(light), self._outside(light)) if note is not None]
        if not notes and not self._weights.are_seen(light):
            notes = [
                f"{_said(light)} sees no light of the cloud; what bounces of its light is less exact there"
            ]
        return _Known(direct, self._weights.of(light, direct), tuple(notes))

    def _inside(self, light: PlacedLight) -> str | None:
        """That a lamp is in a solid, in a line."""
        if not self._placed.is_inside(light):
            return None
        return f"{_said(light)} is inside a solid, which keeps its light; move it out"

    def _outside(self, light: PlacedLight) -> str | None:
        """That a lamp is outside of the cloud, in a line."""
        at, step = np.array(light.position), float(self.layer.parameters["step"] or 0.0)
        away = float(np.linalg.norm(at - np.clip(at, self.layer.low, self.layer.high)))
        if away <= 0.5 * step:
            return None
        return (
            f"{_said(light)} is {away:.2g} m outside of the cloud of lights; "
            "what bounces of its light is guessed from the nearest, so bake with a larger --box"
        )

    def _bounced(self) -> Radiance:
        out = np.zeros((len(self._indirect), 3), np.float32)
        weights = np.zeros((3, self.layer.slots), np.float32)
        shown = [self._known[light].weights for light, _ in self._lit]
        if self._fading is not None:
            shown = self._fading.toward(shown)
        for own, (_, colour) in zip(shown, self._lit, strict=True):
            weights += own * np.array(colour, np.float32)[:, None]
        if weights.any():
            layer = self.layer
            is_grey = bool((weights[1:] == weights[0]).all())
            cloud_light(
                layer.places, layer.bases, layer.codes, layer.scales, weights, is_grey, layer.order, out
            )
        return out

    def _forget(self) -> None:
        """Keep what is lit, and a few that were."""
        for light, _ in self._lit:
            self._known.move_to_end(light)
        most = len({light for light, _ in self._lit}) + _REMEMBERED
        while len(self._known) > most:
            self._known.popitem(last=False)

    @property
    def irradiance(self) -> Radiance:
        """(V, 3) irradiance / π before albedo, every bounce; a copy. Exactly zero where all lights are off."""
        return self.direct + self._indirect

    @property
    def direct(self) -> Radiance:
        """Of ``irradiance``, what comes from the lamps themselves."""
        out = np.zeros((len(self._indirect), 3), np.float32)
        for light, colour in self._lit:
            out += self._known[light].direct * np.array(colour, np.float32)
        return out

    @property
    def indirect(self) -> Radiance:
        """Of ``irradiance``, what has bounced."""
        return self._indirect.copy()

    @property
    def notes(self) -> list[str]:
        """What somebody who lights with these lamps should know, a line each."""
        return list(dict.fromkeys(note for light, _ in self._lit for note in self._known[light].notes))

    def glossy(self, eye: Triple) -> Radiance | None:
        """(V, 3) what glossy vertices add toward a point; None where the layer was baked without."""
        return None if self._gloss is None else self._gloss.toward(eye, self.irradiance, self._lit)

    def drawn_gloss(
        self, view: View, triangles: Triangles, *, eye: Triple, fine: bool
    ) -> Float32[np.ndarray, "height width 3"] | None:
        """The same as ``view`` sees it of ``triangles``, pixel by pixel."""
        if self._gloss is None:
            return None
        return self._gloss.drawn(view, triangles, self.irradiance, self._lit, eye=eye, fine=fine)

    @property
    def point_lit(self) -> PointLit | None:
        """Its lamps, at any point."""
        return self if self._lit else None

    @property
    def lamp_light(self) -> Radiance:
        """Of ``irradiance``, what comes from the lamps themselves."""
        return self.direct

    def lamp_light_at(self, points: Positions, normals: Normals, *, shadow_rays: int) -> Radiance:
        """``lamp_light`` at other points (n, 3) of surfaces, with unit normals: irradiance / π."""
        there, out = self._placed.elsewhere(points, normals, shadow_rays=shadow_rays), np.zeros_like(points)
        for light, colour in self._lit:
            out += there.of(light) * np.array(colour, np.float32)
        return out


def _said(light: PlacedLight) -> str:
    x, y, z = light.position
    return f"a {'lamp' if isinstance(light, Lamp) else 'panel'} at ({x:g}, {y:g}, {z:g})"


def _refuse_shaped(lit: list[tuple[PlacedLight, Triple]]) -> None:
    for light, _ in lit:
        if not isinstance(light, Lamp) or light.beam.distribution is not None:
            what = "has a direction, which the paper's kernel does not carry; use the fitted interpolation"
            raise InputError(light.name or "light", what)
