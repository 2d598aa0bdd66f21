"""Phong's reflection (with Lafortune and Willems' normalisation), which Mitsuba 3 does not bring.

f = kd/π + ks·(n + 2)/(2π)·max(r·ωₒ, 0)ⁿ, r the mirror direction of ωᵢ: one-sided, reciprocal, and of less energy
than arrives where kd + ks ≤ 1. In a material it is written {"type": "phong", "exponent": 10, "diffuse_reflectance":
0.3, "specular_reflectance": 0.5}, reflectances being numbers, colours or textures.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

KIND = "phong"


def register_phong(mi: Any) -> None:
    """Make ``{"type": "phong"}`` known to Mitsuba's current variant; once."""
    _registered(mi.variant())


@lru_cache(maxsize=4)
def _registered(variant: str) -> str:
    from ..scene.variant import mitsuba

    mi = mitsuba()
    mi.register_bsdf(KIND, _phong(mi))
    return variant


def _phong(mi: Any) -> type:
    import drjit as dr

    class Phong(mi.BSDF):
        def __init__(self, properties: Any) -> None:
            mi.BSDF.__init__(self, properties)
            self._matt = properties.get_texture("diffuse_reflectance", 0.5)
            self._shine = properties.get_texture("specular_reflectance", 0.2)
            self._power = float(properties.get("exponent", 30.0))
            flags = [
                mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide,
                mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide,
            ]
            self.m_components = [int(flag) for flag in flags]
            self.m_flags = int(flags[0]) | int(flags[1])

        def _lobe(self, wi: Any, wo: Any) -> Any:
            """cosⁿ of the angle to the mirror direction."""
            across = dr.maximum(wo.z * wi.z - wo.x * wi.x - wo.y * wi.y, 0)
            return dr.power(across, self._power)

        def _share(self, si: Any, active: Any) -> Any:
            """How often the highlight is sampled."""
            matt, shine = (mi.luminance(t.eval(si, active)) for t in (self._matt, self._shine))
            whole = matt + shine
            return dr.select(whole > 0, shine / whole, 0.5)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            del ctx
            active &= (si.wi.z > 0) & (wo.z > 0)
            f = self._matt.eval(si, active) / dr.pi
            f += self._shine.eval(si, active) * ((self._power + 2) / (2 * dr.pi) * self._lobe(si.wi, wo))
            return dr.select(active, f * wo.z, 0)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            del ctx
            active &= (si.wi.z > 0) & (wo.z > 0)
            share = self._share(si, active)
            narrow = (self._power + 1) / (2 * dr.pi) * self._lobe(si.wi, wo)
            return dr.select(active, share * narrow + (1 - share) * wo.z / dr.pi, 0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            active &= si.wi.z > 0
            shines = sample1 < self._share(si, active)
            cosine = dr.power(sample2.x, 1 / (self._power + 1))
            sine, angle = dr.safe_sqrt(1 - cosine * cosine), 2 * dr.pi * sample2.y
            mirrored = mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
            along = mi.Vector3f(sine * dr.cos(angle), sine * dr.sin(angle), cosine)
            wo = dr.select(
                shines, mi.Frame3f(mirrored).to_world(along), mi.warp.square_to_cosine_hemisphere(sample2)
            )
            bs = dr.zeros(mi.BSDFSample3f)
            bs.wo, bs.eta = wo, 1.0
            bs.pdf = self.pdf(ctx, si, wo, active)
            bs.sampled_component = dr.select(shines, mi.UInt32(0), mi.UInt32(1))
            bs.sampled_type = dr.select(
                shines,
                mi.UInt32(int(mi.BSDFFlags.GlossyReflection)),
                mi.UInt32(int(mi.BSDFFlags.DiffuseReflection)),
            )
            active &= bs.pdf > 0
            weight = dr.select(active, self.eval(ctx, si, wo, active) / bs.pdf, 0)
            return bs, weight

        def traverse(self, callback: Any) -> None:
            callback.put("diffuse_reflectance", self._matt, mi.ParamFlags.Differentiable)
            callback.put("specular_reflectance", self._shine, mi.ParamFlags.Differentiable)

        def to_string(self) -> str:
            return f"Phong[exponent={self._power}]"

    return Phong
