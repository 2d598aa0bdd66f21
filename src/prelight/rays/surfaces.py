"""What a scene is made of, as Mitsuba's meshes and BSDFs: one of each for every material.

``SurfaceScene`` answers for points of triangles what a BSDF wants to know (position, shading frame, texture
coordinates, direction to the eye) and hands the same meshes to the reference path tracer.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..arrays import Float32, Int32, Texture
from ..errors import InputError
from ..material import STORED_TEXTURE, Material
from ..scene.geometry import Scene
from ..scene.variant import mitsuba
from .mitsuba import triangle_mesh
from .offset import ray_offset
from .phong import KIND as PHONG
from .phong import register_phong

_EVEN = 1e-6  # vertex colours nearer to the material's own are that colour

# A lobe of width α, asked in the middles of the texels of R² to a face, has its energy right to 17 % RMS where
# α = 0.5/R, 4 % at 0.75/R, 1 % at 1/R and 0.15 % at 1.5/R: narrower ones sparkle, or vanish between texels.
_LEAST_WIDTH = 1.25  # α·R
_WITH_WIDTH = {"conductor": "roughconductor", "plastic": "roughplastic", "dielectric": "roughdielectric"}

_WIDTHS = (
    ("alpha", 1.0),
    ("alpha_u", 1.0),
    ("alpha_v", 1.0),
    ("roughness", 0.5),
)  # and the power of α they are


class SurfaceScene:
    """The triangles of a scene with their materials.

    A surface described in glTF's words is lit and seen on both sides, unless it transmits; a ``bsdf`` is taken
    as it is. Textures are read between texels and repeat. Vertex colours are interpolated; to a ``bsdf`` they are
    the mesh's one attribute, whatever name it gives it.

    Raises InputError if Mitsuba does not take a material's ``bsdf``.

    Parameters
    ----------
    scene
        Triangles, materials and textures.
    resolution
        R of the lights' cube map. Given that, highlights narrower than its texels are made as wide, mirrors
        too: light has no finer detail to show in them, and between texels they would find none at all.
    emits
        Make area lights of the materials that emit, one-sided as Mitsuba's are, without their textures.

    Attributes
    ----------
    mi
        Mitsuba.
    bsdfs, meshes
        A BSDF for every material; a mesh for every one that a triangle is made of, else None.
    lambertian
        (materials,) whether light leaves it alike in all directions.
    offset
        How far from a surface rays begin, metres.
    widened
        Names of the materials whose highlights were.
    delta
        (materials,) whether it reflects or transmits like a perfect mirror or pane, in whole or in part: light
        that comes from a point of the sky by such a path is found by no shadow ray.
    """

    def __init__(self, scene: Scene, *, resolution: int | None = None, emits: bool = False) -> None:
        self.mi = mitsuba()
        register_phong(self.mi)
        self._least = 0.0 if resolution is None else min(_LEAST_WIDTH / resolution, 1.0)  # α
        self.widened: tuple[str, ...] = ()
        self.material_of = scene.material_of
        self._pictures: dict[tuple, Any] = {}
        tint = scene.albedo if scene.tint is None else scene.tint
        on_vertex = scene.material_of_vertex
        self.bsdfs, self.meshes = [], []
        self._place = np.zeros(len(scene.triangles), np.int32)  # of each triangle in its mesh
        for m, material in enumerate(scene.materials):
            chosen = np.flatnonzero(self.material_of == m)
            vertices, corners = np.unique(scene.triangles[chosen], return_inverse=True)
            colours = tint[vertices[on_vertex[vertices] == m]]
            uneven = len(colours) > 0 and np.abs(colours - colours[0]).max() > _EVEN
            colour = None if uneven else tuple(colours[0]) if len(colours) else material.colour
            bsdf = self._bsdf(material, scene, colour)
            self.bsdfs.append(bsdf)
            self._place[chosen] = np.arange(len(chosen))
            mesh = None
            if len(chosen):
                mesh = triangle_mesh(
                    scene.positions[vertices],
                    corners.reshape(-1, 3),
                    normals=scene.normals[vertices],
                    bsdf=bsdf,
                    uv=None if scene.uv is None else scene.uv[vertices],
                    tint=tint[vertices],
                    emitter=self._area_light(material) if emits else None,
                )
            self.meshes.append(mesh)
        mirror = self.mi.BSDFFlags.DeltaReflection | self.mi.BSDFFlags.DeltaTransmission
        self.lambertian = np.array([material.is_lambertian for material in scene.materials])
        self.offset = ray_offset(scene.positions)
        self.delta = np.array([bool(int(bsdf.flags()) & int(mirror)) for bsdf in self.bsdfs])

    def lit_by(self, *lights: Any) -> Any:
        """An ``mi.Scene`` of all surfaces under these emitters and luminous shapes, for the reference."""
        parts = {f"mesh{m}": mesh for m, mesh in enumerate(self.meshes) if mesh is not None}
        parts |= {f"light{k}": light for k, light in enumerate(lights)}
        return self.mi.load_dict({"type": "scene", **parts})

    def _area_light(self, material: Material) -> Any:
        if not any(material.emission):
            return None
        radiance = {"type": "rgb", "value": [float(x) for x in material.emission]}
        return self.mi.load_dict({"type": "area", "radiance": radiance})

    def interactions(
        self,
        triangle: Int32[np.ndarray, "points"],
        weights: Float32[np.ndarray, "points 2"],
        *,
        eye: tuple[float, float, float],
    ) -> tuple[Any, Any]:
        """Points of triangles as an evaluated ``mi.SurfaceInteraction3f`` with ``wi`` to the eye, and their BSDFs.

        ``weights`` are the barycentric ones of a triangle's second and third vertex. Where ``triangle`` is −1
        there is no point: no shape, and no BSDF.
        """
        import drjit as dr

        mi = self.mi
        there = triangle >= 0
        material = np.where(there, self.material_of[triangle], 0)
        place = np.where(there, self._place[triangle], 0)
        used = next(mesh for mesh in self.meshes if mesh is not None)  # stands in where there is none
        lane, active = mi.UInt32(material.astype(np.uint32)), mi.Bool(there)
        shapes = mi.ShapePtr([used if mesh is None else mesh for mesh in self.meshes])
        hit = dr.zeros(mi.PreliminaryIntersection3f, len(triangle))
        hit.valid, hit.t = active, mi.Float(1.0)
        hit.shape = dr.gather(mi.ShapePtr, shapes, lane, active)
        hit.prim_index = mi.UInt32(place.astype(np.uint32))
        hit.prim_uv = mi.Point2f(*(mi.Float(np.ascontiguousarray(w, np.float32)) for w in weights.T))
        stand = mi.Point3f(*(dr.opaque(mi.Float, float(x)) for x in eye))
        look = mi.Ray3f(stand, mi.Vector3f(0, 0, 1))  # only ``wi`` would hang on its direction
        si = hit.compute_surface_interaction(look, mi.RayFlags.All, active)
        si.wi = si.to_local(dr.normalize(stand - si.p))
        bsdfs = dr.gather(mi.BSDFPtr, mi.BSDFPtr(self.bsdfs), lane, active)
        dr.eval(si, bsdfs)
        return si, bsdfs

    # ---- materials -------------------------------------------------------------------------------

    def _bsdf(self, material: Material, scene: Scene, colour: tuple[float, ...] | None) -> Any:
        if material.bsdf is not None:
            wide = self._widened(material.bsdf)
            if wide != material.bsdf:
                self.widened += (material.name,)
            return self._load(material.name, self._filled(wide, scene))
        base = self._colour(material, scene, colour)
        if material.is_lambertian:
            return self._load(
                material.name, {"type": "twosided", "inner": {"type": "diffuse", "reflectance": base}}
            )
        if min(_widths(material, scene)) < self._least:
            self.widened += (material.name,)
        roughness, metallic = self._roughness(material, scene)
        inner = {
            "type": "principled", "base_color": base, "roughness": roughness, "metallic": metallic,
            "eta": index_of_refraction(material), "spec_trans": material.transmission,
            "clearcoat": material.clearcoat, "clearcoat_gloss": self._gloss(material),
        }  # fmt: skip
        if material.transmission:
            return self._load(material.name, inner)
        return self._load(material.name, {"type": "twosided", "inner": inner})

    def _load(self, name: str, table: Mapping[str, Any]) -> Any:
        try:
            return self.mi.load_dict(dict(table))
        except (RuntimeError, TypeError, ValueError) as error:
            reason = " ".join(str(error).split())[-200:]
            raise InputError(f"material {name}", f"Mitsuba does not take its bsdf: {reason}") from None

    def _colour(self, material: Material, scene: Scene, colour: tuple[float, ...] | None) -> Any:
        """Vertex colours, or the one ``colour``, times the texture."""
        factor = (
            {"type": "mesh_attribute", "name": "vertex_tint"}
            if colour is None
            else {"type": "rgb", "value": [float(c) for c in colour]}
        )
        if material.colour_texture is None or scene.uv is None:
            return factor
        picture = self._bitmap(scene.textures, material.colour_texture, raw=False)
        return _product(self.mi, picture, self.mi.load_dict(factor))

    def _roughness(self, material: Material, scene: Scene) -> tuple[Any, Any]:
        if material.roughness_texture is None or scene.uv is None:
            return max(material.roughness, self._least**0.5), material.metallic
        green, blue = (
            self._channel(scene.textures[material.roughness_texture], channel, factor, least)
            for channel, factor, least in (
                (1, material.roughness, self._least**0.5),
                (2, material.metallic, 0.0),
            )
        )
        return green, blue

    def _gloss(self, material: Material) -> float:
        """Of Disney's clearcoat, whose width α goes from 0.1 to 0.001."""
        width = max(material.clearcoat_roughness**2, self._least) if material.clearcoat else 1.0
        return float(np.clip((0.1 - width) / 0.099, 0.0, 1.0))

    def _widened(self, bsdf: Mapping[str, Any]) -> dict[str, Any]:
        """The table with no lobe narrower than the lights' texels, where its width is a plain number."""
        table = {k: self._widened(v) if isinstance(v, Mapping) else v for k, v in bsdf.items()}
        kind = table.get("type")
        if not self._least or kind == "hair":
            return table
        if kind in _WITH_WIDTH:
            return table | {"type": _WITH_WIDTH[kind], "alpha": self._least}
        exponent = table.get("exponent")
        if kind == PHONG and isinstance(exponent, int | float):
            table["exponent"] = min(float(exponent), 0.5 / self._least**2)  # of a lobe as wide
        for name, power in _WIDTHS:
            width = table.get(name)
            if isinstance(width, int | float):
                table[name] = max(float(width), self._least**power)
        return table

    def _channel(self, texture: Texture, channel: int, factor: float, least: float) -> Any:
        values = texture[..., channel : channel + 1].astype(np.float32) * np.float32(factor / 255)
        values = np.maximum(values, np.float32(least))
        return self.mi.load_dict({"type": "bitmap", "bitmap": self.mi.Bitmap(values), "raw": True})

    def _bitmap(self, textures: tuple[Texture, ...], index: int, *, raw: bool) -> Any:
        if (index, raw) not in self._pictures:
            bitmap = self.mi.Bitmap(np.array(textures[index]))  # Mitsuba refuses the read-only ones of a bake
            self._pictures[index, raw] = self.mi.load_dict({"type": "bitmap", "bitmap": bitmap, "raw": raw})
        return self._pictures[index, raw]

    def _filled(self, bsdf: Mapping[str, Any], scene: Scene) -> Any:
        """The table with its stored textures put in, and mesh attributes by the name they have here."""
        if bsdf.get("type") == STORED_TEXTURE:
            return self._bitmap(scene.textures, bsdf["index"], raw=bool(bsdf.get("raw", False)))
        table = {k: self._filled(v, scene) if isinstance(v, Mapping) else v for k, v in bsdf.items()}
        return table | {"name": "vertex_tint"} if bsdf.get("type") == "mesh_attribute" else table


def _widths(material: Material, scene: Scene) -> tuple[float, float]:
    """The least α of its highlights, and of its coat's."""
    roughness = material.roughness
    if material.roughness_texture is not None and scene.uv is not None:
        roughness *= float(scene.textures[material.roughness_texture][..., 1].min()) / 255
    return roughness**2, material.clearcoat_roughness**2 if material.clearcoat else 1.0


def index_of_refraction(material: Material) -> float:
    """Of a dielectric whose reflection straight on is ``specular`` × that at ``ior``."""
    r = material.specular**0.5 * (material.ior - 1) / (material.ior + 1)
    return max((1 + r) / (1 - r), 1.0001)


def _product(mi: Any, first: Any, second: Any) -> Any:
    """A texture that is the product of two."""

    class Product(mi.Texture):
        def __init__(self) -> None:
            mi.Texture.__init__(self, mi.Properties())

        def eval(self, si: Any, active: Any = True) -> Any:
            return first.eval(si, active) * second.eval(si, active)

        def mean(self) -> Any:
            return first.mean() * second.mean()

        def is_spatially_varying(self) -> bool:
            return True

        def to_string(self) -> str:
            return "Product"

    return Product()
