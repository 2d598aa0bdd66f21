"""Photons from a source through a scene, landing on what is diffuse: batch after batch, each the same whenever traced.

A photon flies through clear glass and off mirrors until it lands; there it may be kept, and goes on as a diffuse
surface sends it, with Russian roulette. It keeps in mind where and in what direction it left its light, so that one
map serves any number of basis functions. Evenly spread numbers place it at its start, a hash of (seed, photon, number)
does the rest: batches may be traced in any order, by any number of workers, and more of them at any time.

References
----------
Jensen, Realistic Image Synthesis Using Photon Mapping, 2001. Christensen, Adjoints and importance in rendering, 2003.
Roberts, The unreasonable effectiveness of quasirandom sequences, 2018.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ..arrays import Float32, Int32, UInt8
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from .hemisphere import lit_sides
from .photon_aim import Balls
from .photon_sources import PhotonSource, SceneBall
from .shading_normals import for_smoothed
from .specular import as_photons_see, specular_materials

BATCH = 1 << 17  # photons
DIRECT, BOUNCED, CAUSTIC, BOUNCED_CAUSTIC = 1, 2, 4, 8  # how a photon came to where it landed; may be added
EVERY_WAY = DIRECT | BOUNCED | CAUSTIC | BOUNCED_CAUSTIC
_STAGE = 29  # keeps these random numbers apart from those of other stages
_ROULETTE_FROM = 8  # surfaces of one flight
_SURVIVAL = 0.98
_MOST_LANDINGS = 4096
_MOST_CORRECTION = (
    4.0  # of grazing light on smoothed normals: a thousandth of light is lost, no photon is a spark
)
_INSIDE = 0.95  # of a lamp's light, if it ends on the backs of surfaces the lamp is inside something
_ENOUGH = 500  # photons to say so
_GOLDEN = 1.1347241384015194  # root of x⁶ = x + 1
_HALF_FLOAT = 2.0**-24


@dataclass(frozen=True)
class Photons:
    """Photons where they landed, on the lit side of diffuse triangles, in the order of batches.

    Attributes
    ----------
    power
        Flux, W for each of red, green and blue, to be divided by ``emitted``.
    direction, origin
        In which it left its light, the way light travels; and from where.
    way
        DIRECT, BOUNCED (its last bounce was diffuse), CAUSTIC (mirrors and glass alone since its light) or
        BOUNCED_CAUSTIC (mirrors and glass since its last diffuse bounce).
    """

    position: Float32[np.ndarray, "photons 3"]
    power: Float32[np.ndarray, "photons 3"]
    direction: Float32[np.ndarray, "photons 3"]
    origin: Float32[np.ndarray, "photons 3"]
    triangle: Int32[np.ndarray, "photons"]
    light: Int32[np.ndarray, "photons"]
    way: UInt8[np.ndarray, "photons"]
    emitted: int

    def __len__(self) -> int:
        return len(self.way)

    def of(self, ways: int) -> Photons:
        """Those that came in one of these ways."""
        chosen = np.flatnonzero(self.way & ways)
        if len(chosen) == len(self):
            return self
        return self.taken(chosen)

    def taken(self, chosen: np.ndarray) -> Photons:
        """Those of these numbers, in their order."""
        kept = {f.name: getattr(self, f.name)[chosen] for f in fields(self) if f.name != "emitted"}
        return Photons(**kept, emitted=self.emitted)

    @classmethod
    def together(cls, parts: list[Photons]) -> Photons:
        names = [f.name for f in fields(cls) if f.name != "emitted"]
        joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
        return cls(**joined, emitted=sum(part.emitted for part in parts))


class PhotonTracer:
    """Sends photons; ``batch(b)`` is the same whatever was traced before.

    Parameters
    ----------
    scene, occluders
        Triangles and materials, and the renderer's scene of the same triangles.
    source
        Where photons begin.
    ways
        Which photons are kept. Those for CAUSTIC alone end where they land, and are aimed at glass and mirrors.
    bounces
        Diffuse ones, at most; None for as many as roulette allows.
    seed
        Of all random numbers.

    Attributes
    ----------
    is_dark
        Nothing in the scene can bring photons of these ways: no batch need be traced.

    Raises InputError for materials or lights that cannot be.
    """

    def __init__(
        self,
        scene: Scene,
        occluders: Occluders,
        source: PhotonSource,
        *,
        ways: int = EVERY_WAY,
        bounces: int | None = None,
        seed: int = 0,
    ) -> None:
        import drjit as dr

        mi = self._mi = occluders.mi
        self.ways, self._lights, self._placed = ways, source.lights, source.is_placed
        self._most = (
            0 if ways & ~(DIRECT | CAUSTIC) == 0 else (_MOST_LANDINGS if bounces is None else bounces)
        )
        specular = specular_materials(scene)
        self.is_dark = not specular.any() and ways & (DIRECT | BOUNCED) == 0
        aim = None
        if ways == CAUSTIC and specular.any():
            aim = Balls.around(scene.positions, scene.triangles[specular[scene.material_of]])
        surfaces = SurfaceScene(as_photons_see(scene))
        used = next(mesh for mesh in surfaces.meshes if mesh is not None)  # stands in where there is none
        self._surfaces = surfaces  # keeps its meshes
        self._shapes = mi.ShapePtr([used if mesh is None else mesh for mesh in surfaces.meshes])
        self._specular = mi.Bool(specular)
        self._material = mi.UInt32(scene.material_of.astype(np.uint32))
        self._place = mi.UInt32(_places(scene))
        self._lit = mi.Vector3f(*(mi.Float(np.ascontiguousarray(x)) for x in lit_sides(scene).T))
        self._rays = occluders.scene
        self._aimed = SceneBall.of(scene.positions, occluders.scene), aim
        self._emit = source.ready(mi, *self._aimed)
        words = np.random.SeedSequence([seed, _STAGE, ways]).generate_state(8)
        self._key = [dr.opaque(mi.UInt32, int(w)) for w in words[:2]]
        self._shift = [dr.opaque(mi.UInt32, int(w)) for w in words[2:7]]
        self._fly = dr.syntax(PhotonTracer._flight)

    def sending(self, source: PhotonSource) -> PhotonTracer:
        """The same for another source, which takes no time: of what shines and moves."""
        other = copy(self)
        other._lights, other._placed = source.lights, source.is_placed
        other._emit = source.ready(self._mi, *self._aimed)
        return other

    def batch(self, number: int) -> Photons:
        """Photons number · BATCH and on."""
        import drjit as dr

        mi = self._mi
        index = dr.arange(mi.UInt32, BATCH) + dr.opaque(mi.UInt32, number * BATCH)
        sent = self._emit(self._start_numbers(index))
        ray = mi.Ray3f(mi.Point3f(sent.origin), sent.direction)
        active = dr.isfinite(dr.max(sent.flux)) & (dr.max(sent.flux) > 0)
        state = [ray.o, ray.d, mi.Color3f(sent.flux), index, mi.UInt32(0), active]
        dr.eval(state, sent.origin, sent.direction, sent.light)
        start = {
            "direction": _rows(sent.direction), "origin": _rows(sent.origin),
            "light": np.broadcast_to(sent.light.numpy(), BATCH).astype(np.int32),
        }  # fmt: skip
        lane = np.arange(BATCH)
        found, landing = [], 0
        while len(lane) and landing <= self._most:
            landed = self._fly(self, *state)
            dr.eval(landed)
            if landing == 0 and number == 0 and self._placed:
                self._refuse_inside(start["light"], landed)
            found.append(self._kept(landed, landing, lane, start))
            on = dr.compress(landed[-1])
            state = [dr.gather(type(x), x, on) for x in landed[:5]] + [dr.full(mi.Bool, True, dr.width(on))]
            lane = lane[on.numpy()]
            landing += 1
        return replace(Photons.together(found), emitted=BATCH)

    def _kept(self, landed: tuple, landing: int, lane: np.ndarray, start: dict[str, np.ndarray]) -> Photons:
        """What has landed in a way that is asked for, on a lit side."""
        position, carried, triangle, surfaces, lit = landed[5:10]
        through, plain = (BOUNCED_CAUSTIC, BOUNCED) if landing else (CAUSTIC, DIRECT)
        way = np.where(surfaces.numpy() > 0, through, plain)
        chosen = np.flatnonzero(lit.numpy() & ((way & self.ways) > 0))
        origin = lane[chosen]
        return Photons(
            _rows(position)[chosen], _rows(carried)[chosen], **{k: v[origin] for k, v in start.items()},
            triangle=triangle.numpy()[chosen].astype(np.int32), way=way[chosen].astype(np.uint8), emitted=0,
        )  # fmt: skip

    def _refuse_inside(self, light: np.ndarray, landed: tuple) -> None:
        surfaces, lit, there = landed[8].numpy(), landed[9].numpy(), landed[10].numpy()
        first = there & (surfaces == 0)
        hits = np.bincount(light[first], minlength=self._lights)
        backs = np.bincount(light[first & ~lit], minlength=self._lights)
        wrong = np.flatnonzero((hits >= _ENOUGH) & (backs > _INSIDE * hits))
        if len(wrong):
            share = backs[wrong[0]] / hits[wrong[0]]
            reason = (
                f"{share:.0%} of its light ends on the backs of surfaces: it is inside a solid; move it out"
            )
            raise InputError(f"light {int(wrong[0])}", reason)

    def _start_numbers(self, index: Any) -> tuple:
        mi = self._mi
        words = [
            index * int(2**32 / _GOLDEN ** (k + 1)) + shift for k, shift in enumerate(self._shift)
        ]  # fmt: skip
        first, _ = mi.sample_tea_32(index ^ self._key[0], self._key[1] ^ 0xFFFFFFFF, 8)
        return tuple(mi.Float(word >> 8) * _HALF_FLOAT for word in (*words, first))

    def _flight(
        self, origin: Any, direction: Any, carry: Any, index: Any, drawn: Any, active: Any
    ) -> tuple[Any, ...]:
        """On until it lands on something diffuse.

        How it goes on from there (origin, direction, carried, index, numbers drawn), where and with what it landed
        (position, carried, triangle, specular surfaces met, whether on the lit side), whether it did, whether it
        goes on.
        """
        import drjit as dr

        mi = self._mi
        ctx = mi.BSDFContext(mi.TransportMode.Importance)
        ray = mi.Ray3f(origin, direction)
        carry, drawn, active = mi.Color3f(carry), mi.UInt32(drawn), mi.Bool(active)
        start = dr.max(carry)
        position, landed_with = mi.Point3f(origin), mi.Color3f(0)
        triangle, met = dr.zeros(mi.UInt32, dr.width(index)), dr.zeros(mi.UInt32, dr.width(index))
        lit, landed, on = (dr.full(mi.Bool, False, dr.width(index)) for _ in range(3))
        while active:
            hit = self._rays.ray_intersect_preliminary(ray, active=active)
            active &= hit.is_valid()
            face = mi.UInt32(hit.prim_index)
            material = dr.gather(mi.UInt32, self._material, face, active)
            hit.shape = dr.gather(mi.ShapePtr, self._shapes, material, active)
            hit.prim_index = dr.gather(mi.UInt32, self._place, face, active)
            si = hit.compute_surface_interaction(ray, mi.RayFlags.All, active)
            lands = active & ~dr.gather(mi.Bool, self._specular, material, active)

            # ---- landed -------------------------------------------------------------------------------
            position = dr.select(lands, si.p, position)
            landed_with = dr.select(lands, carry, landed_with)
            triangle = dr.select(lands, face, triangle)
            lit |= lands & (dr.dot(dr.gather(mi.Vector3f, self._lit, face, lands), ray.d) < 0)
            landed |= lands

            # ---- on -----------------------------------------------------------------------------------
            a, b, c, d = self._numbers(index, drawn)
            drawn += 2
            sample, weight = si.bsdf().sample(ctx, si, a, mi.Point2f(b, c), active)
            way = si.to_world(sample.wo)
            weight *= dr.minimum(for_smoothed(si, sample.wo, way), _MOST_CORRECTION)
            after = carry * weight
            strength = dr.max(after)
            active &= (strength > 0) & dr.isfinite(strength)
            # Where it lands it goes on as often as the surface reflects, elsewhere only long flights may end.
            survival = dr.select(lands, strength / dr.max(carry), dr.maximum(strength / start, 0.1))
            survival = dr.minimum(survival, dr.select(lands | (met >= _ROULETTE_FROM), _SURVIVAL, 1))
            survival = dr.select(lands | (met >= _ROULETTE_FROM), survival, 1)
            active &= d < survival
            carry = dr.select(active, after / survival, carry)
            ray = si.spawn_ray(way)
            on |= lands & active
            met += dr.select(lands, mi.UInt32(0), mi.UInt32(1))
            active &= ~lands
        return (
            ray.o, ray.d, carry, index, drawn, position, landed_with, triangle, met, lit, landed, on
        )  # fmt: skip

    def _numbers(self, index: Any, drawn: Any) -> tuple[Any, ...]:
        mi = self._mi
        words: list[Any] = []
        for k in range(2):
            words += mi.sample_tea_32(index ^ self._key[0], (drawn + k) ^ self._key[1], 8)
        return tuple(mi.Float(word >> 8) * _HALF_FLOAT for word in words)


def _places(scene: Scene) -> np.ndarray:
    """(F,) uint32: of each triangle among those of its material."""
    place = np.zeros(len(scene.triangles), np.uint32)
    for m in range(len(scene.materials)):
        chosen = np.flatnonzero(scene.material_of == m)
        place[chosen] = np.arange(len(chosen))
    return place


def _rows(vectors: Any) -> Float32[np.ndarray, "n 3"]:
    return np.ascontiguousarray(vectors.numpy().T, np.float32)
