"""Paths from the eye through a box of light.

Every edge of a path crosses the glow or not. At one place of it, even along the edge, light is noted; and from every
surface that scatters a place in the box is aimed at, even in volume. Both find the same light, so they share it by
multiple importance sampling: one is good where a mirror shows the box or a surface is near it, the other far off.
"""

from __future__ import annotations

from typing import Any

from ..camera import Camera
from ..rays.surfaces import SurfaceScene
from .eye_paths import _ROULETTE_FROM, _SURVIVAL, EyePaths, Notes, PathRules, power_heuristic
from .steered_lamps import SteeredBox, SteeredLamp


def paths_of(
    surfaces: SurfaceScene, lamp: SteeredLamp, camera: Camera, *, width: int, height: int, rules: PathRules
) -> EyePaths:
    """Paths from the eye that find a lamp of this kind."""
    kind = BoxPaths if isinstance(lamp, SteeredBox) else EyePaths
    return kind(surfaces, lamp, camera, width=width, height=height, rules=rules)


class BoxPaths(EyePaths):
    """Paths of a camera's pixels in a scene with one box of light; parameters as those of `EyePaths`.

    The class of a path does not matter, for all are found from the eye.
    """

    def _walk(self, ray: Any, cells: tuple[Any, Any, Any], notes: Notes) -> Any:
        """The loop over surfaces; how many slots each path has filled."""
        import drjit as dr

        mi, scene, rules = self.mi, self.scene, self.rules
        sampler, ctx = self._sampler, mi.BSDFContext()
        most, least = dr.opaque(mi.UInt32, rules.depth), dr.opaque(mi.UInt32, rules.least_depth)
        box = _Box(mi, self.lamp)
        met, slot = mi.UInt32(0), mi.UInt32(0)
        carry, eta = mi.Spectrum(1), mi.Float(1)
        pdf, by_mirror = mi.Float(0), mi.Bool(True)
        active = mi.Bool(True)
        while active:
            si = scene.ray_intersect(ray, mi.RayFlags.All, met == 0, active)

            # ---- the glow along this edge; the eye itself does not see it --------------------------------
            near, far = box.crossed(ray)
            length = far - near
            t = near + sampler.next_1d() * length
            share = dr.select(by_mirror, 1, power_heuristic(pdf, length * t * t * box.density))
            crossed = active & (met > 0) & (length > 0) & (~si.is_valid() | (t < si.t))
            crossed &= (met + 1 <= most) & (met + 1 >= least)
            slot += box.note(notes, slot, carry * length * share, ray(t), crossed)

            active &= si.is_valid() & (met + 1 < most)

            # ---- a place in it aimed at ------------------------------------------------------------------
            bsdf = si.bsdf()
            smooth = active & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
            p = box.place(sampler.next_2d(), sampler.next_1d(), cells, met == 0)
            d = p - si.p
            square = dr.squared_norm(d)
            d *= dr.rsqrt(square)
            wo = si.to_local(d)
            value, wo_pdf, sample, weight = bsdf.eval_pdf_sample(
                ctx, si, wo, sampler.next_1d(), sampler.next_2d(), active
            )
            near, far = box.crossed(mi.Ray3f(si.p, d))
            share = power_heuristic((far - near) * square * box.density, wo_pdf)
            brought = carry * value * share / (square * box.density)
            aimed = smooth & (met + 2 >= least) & (square > 0) & (brought.x + brought.y + brought.z > 0)
            aimed &= ~scene.ray_test(si.spawn_ray_to(p), aimed)
            slot += box.note(notes, slot, brought, p, aimed)

            # ---- on --------------------------------------------------------------------------------------
            by_mirror = mi.has_flag(sample.sampled_type, mi.BSDFFlags.Delta)
            pdf = sample.pdf
            carry = dr.select(active, carry * weight, carry)
            eta = dr.select(active, eta * sample.eta, eta)
            ray = si.spawn_ray(si.to_world(sample.wo))
            met += 1
            strength = dr.max(carry)
            alive = dr.minimum(strength * eta * eta, _SURVIVAL)
            roulette = active & (met >= _ROULETTE_FROM)
            carry[roulette] *= dr.rcp(alive)
            active &= (~roulette | (sampler.next_1d() < alive)) & (strength > 0)
        return slot


class _Box:
    """Where rays enter and leave a box, and places in it by their coordinates, 0 to 1 along each side."""

    def __init__(self, mi: Any, lamp: Any) -> None:
        import drjit as dr

        self.mi = mi
        sides = lamp.sides
        self._corner = mi.Point3f(*(dr.opaque(mi.Float, x) for x in lamp.corner))
        self._sides = [mi.Vector3f(*(dr.opaque(mi.Float, float(x)) for x in side)) for side in sides]
        self._across = [
            mi.Vector3f(*(dr.opaque(mi.Float, float(x)) for x in side / (side @ side))) for side in sides
        ]
        self.density = dr.opaque(mi.Float, 1 / lamp.volume)  # of places aimed at, a cubic metre

    def crossed(self, ray: Any) -> tuple[Any, Any]:
        """Distances along the ray at which it enters, at least 0, and leaves; the other way round where it misses."""
        import drjit as dr

        near, far = self.mi.Float(0), self.mi.Float(dr.inf)
        for across in self._across:
            begin, step = dr.dot(ray.o - self._corner, across), dr.rcp(dr.dot(ray.d, across))
            one, other = -begin * step, (1 - begin) * step
            near, far = dr.maximum(near, dr.minimum(one, other)), dr.minimum(far, dr.maximum(one, other))
        return near, far

    def place(self, aim: Any, third: Any, cells: tuple[Any, Any, Any], first: Any) -> Any:
        """A point of it; of the paths of a pixel each has its own part for the first surface."""
        import drjit as dr

        u = dr.select(first, cells[0] + aim.x * cells[2], aim.x)
        v = dr.select(first, cells[1] + aim.y * cells[2], aim.y)
        return self._corner + u * self._sides[0] + v * self._sides[1] + third * self._sides[2]

    def note(self, notes: Notes, slot: Any, brought: Any, p: Any, active: Any) -> Any:
        """Write down what comes from a place: its third coordinate stands where other lamps have a direction."""
        import drjit as dr

        u, v, w = (dr.dot(p - self._corner, across) for across in self._across)
        return notes.write(slot, brought, self.mi.Vector3f(w, 0, 0), (u, v), active)
