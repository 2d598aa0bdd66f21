"""A scene under a rig as a file of Mitsuba's, for a final render: meshes, materials, lights and the camera.

Everything is written out: meshes as PLY with their vertex colours, textures and the environment as EXR. Lights with a
shape of their own (spots, measured lamps) become six projectors, which hold the intensity in every direction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..bases import cube_map
from ..camera import Camera
from ..errors import InputError
from ..images.openexr import encode_exr
from ..images.tonemap import srgb_decode
from ..lighting.placed_lights import Lamp, PlacedPanel
from ..lighting.rig import Rig
from ..material import STORED_TEXTURE, Material
from ..rays.phong import KIND as PHONG
from ..rays.surfaces import index_of_refraction
from ..scene.geometry import Scene
from .mitsuba_xml import Emitted, lookat, mesh_file, scene_xml
from .on_screen import refuse_unknown

_SKY = 512  # rows of the environment's map
_CUBE = 256  # R that it is taken from
_SIDE = 128  # pixels of a projector's picture
_FAINT = 1e-4  # of its brightest: a side that no path need be lost on
_DEEPEST = 64
_EVEN = 1e-6


@dataclass
class FinalScene:
    """What is written: the XML, and the files that it names, beside it."""

    xml: bytes
    files: dict[str, bytes]
    notes: list[str] = field(default_factory=list)


def final_scene(
    scene: Scene, rig: Rig, camera: Camera, *, size: tuple[int, int], samples: int, folder: str
) -> FinalScene:
    """A scene under a rig at its beginning, seen by a camera.

    Parameters
    ----------
    size
        Width and height, pixels.
    samples
        Paths a pixel.
    folder
        The name of the folder beside the XML that the files go to.

    Raises
    ------
    InputError
        For what Mitsuba does not know: lamps of steerable layers, [outside], glass that is set, materials of Phong's.
    """
    refuse_unknown(rig)
    parts = _Parts(scene, folder)
    children = [_sensor(camera, size, samples), {"type": "path", "max_depth": _DEEPEST, "rr_depth": 12}]
    for m in range(len(scene.materials)):
        children += parts.mesh(m)
    children += [part for light in rig.lamps_at(0.0) for part in parts.light(light)]
    if max(rig.environment.total) > 0:
        name = parts.picture("sky.exr", _sky_map(rig))
        children.append({"type": "envmap", "filename": name})
    return FinalScene(scene_xml(children), parts.files, parts.notes)


def _sensor(camera: Camera, size: tuple[int, int], samples: int) -> Emitted:
    film = {"type": "hdrfilm", "width": size[0], "height": size[1], "pixel_format": "rgb",
            "rfilter": {"type": "tent", "radius": 1.0}}  # fmt: skip
    return {
        "type": "perspective", "fov": float(camera.vertical_fov_deg), "fov_axis": "y",
        "to_world": lookat(camera.eye, camera.target, camera.up), "film": film,
        "sampler": {"type": "independent", "sample_count": samples},
    }  # fmt: skip


def _sky_map(rig: Rig) -> np.ndarray:
    """The environment as a map of latitudes and longitudes, −Z on its left edge; a texel is the mean of four points."""
    faces = rig.environment.cube(_CUBE)
    total = np.zeros((_SKY, 2 * _SKY, 3))
    for down in (-0.25, 0.25):
        polar = np.pi * (np.arange(_SKY) + 0.5 + down) / _SKY
        for across in (-0.25, 0.25):
            azimuth = 2 * np.pi * (np.arange(2 * _SKY) + 0.5 + across) / (2 * _SKY)
            d = np.stack(
                np.broadcast_arrays(
                    np.sin(polar)[:, None] * np.sin(azimuth), np.cos(polar)[:, None] + 0 * azimuth,
                    -np.sin(polar)[:, None] * np.cos(azimuth),
                ), axis=-1,
            )  # fmt: skip
            face, row, column = _texel(d.reshape(-1, 3))
            total += faces[face, row, column].reshape(total.shape)
    return (total / 4).astype(np.float32)


def _texel(directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    face, u, v = cube_map.face_coordinates(directions.astype(np.float32))
    place = lambda x: np.clip(((x + 1) * 0.5 * _CUBE).astype(np.int64), 0, _CUBE - 1)  # noqa: E731
    return face, place(v), place(u)


class _Parts:
    """Meshes, materials and lights as tables, and the files that they name."""

    def __init__(self, scene: Scene, folder: str) -> None:
        self._scene, self._folder = scene, folder
        self.files: dict[str, bytes] = {}
        self.notes: list[str] = []
        self._tint = scene.albedo if scene.tint is None else scene.tint

    def file(self, name: str, data: bytes) -> str:
        """Keep a file; what the XML calls it."""
        self.files[name] = data
        return f"{self._folder}/{name}"

    def picture(self, name: str, pixels: np.ndarray) -> str:
        """A picture of linear values as an EXR."""
        return self.file(name, encode_exr(np.ascontiguousarray(pixels, np.float32)))

    # ---- Surfaces ----------------------------------------------------------------------------------------

    def mesh(self, m: int) -> list[Emitted]:
        """The triangles of a material, if there are any."""
        scene, material = self._scene, self._scene.materials[m]
        chosen = np.flatnonzero(scene.material_of == m)
        if not len(chosen):
            return []
        vertices, corners = np.unique(scene.triangles[chosen], return_inverse=True)
        own = vertices[scene.material_of_vertex[vertices] == m]
        colours = self._tint[own]
        uneven = len(colours) > 0 and float(np.abs(colours - colours[0]).max()) > _EVEN
        tint, textured = self._tint[vertices], material.colour_texture is not None and scene.uv is not None
        if uneven and textured:
            self.notes.append(
                f"{material.name}: texture and vertex colours together are written as vertex colours"
            )
            tint, textured = scene.albedo[vertices], False
        colour = None if uneven else tuple(colours[0]) if len(colours) else material.colour
        data = mesh_file(
            scene.positions[vertices], corners.reshape(-1, 3), normals=scene.normals[vertices],
            uv=None if scene.uv is None else scene.uv[vertices], tint=tint,
        )  # fmt: skip
        shape: Emitted = {
            "type": "ply", "filename": self.file(f"mesh{m}.ply", data),
            "bsdf": self._bsdf(material, m, colour, textured=textured),
        }  # fmt: skip
        return [shape]

    def _bsdf(self, material: Material, m: int, colour: Any, *, textured: bool) -> Emitted:
        if material.bsdf is not None:
            return self._filled(material.bsdf, material.name)
        base = self._colour(material, m, colour, textured=textured)
        if material.is_lambertian:
            return {"type": "twosided", "inner": {"type": "diffuse", "reflectance": base}}
        roughness, metallic = self._roughness(material, m)
        coat = max(material.clearcoat_roughness**2, 0.0) if material.clearcoat else 1.0
        inner: Emitted = {
            "type": "principled", "base_color": base, "roughness": roughness, "metallic": metallic,
            "eta": index_of_refraction(material), "spec_trans": float(material.transmission),
            "clearcoat": float(material.clearcoat), "clearcoat_gloss": float(np.clip((0.1 - coat) / 0.099, 0, 1)),
        }  # fmt: skip
        return inner if material.transmission else {"type": "twosided", "inner": inner}

    def _colour(self, material: Material, m: int, colour: Any, *, textured: bool) -> Emitted:
        if colour is None:
            return {"type": "mesh_attribute", "name": "vertex_tint"}
        if not textured or material.colour_texture is None:
            return {"type": "rgb", "value": [float(c) for c in colour]}
        pixels = srgb_decode(self._scene.textures[material.colour_texture].astype(np.float32) / 255)
        name = self.picture(f"colour{m}.exr", pixels * np.array(colour, np.float32))
        return {"type": "bitmap", "filename": name, "raw": True}

    def _roughness(self, material: Material, m: int) -> tuple[Any, Any]:
        if material.roughness_texture is None or self._scene.uv is None:
            return float(material.roughness), float(material.metallic)
        pixels = self._scene.textures[material.roughness_texture].astype(np.float32) / 255
        named = []
        for what, channel, factor in (
            ("roughness", 1, material.roughness),
            ("metallic", 2, material.metallic),
        ):
            grey = np.repeat(pixels[..., channel : channel + 1] * np.float32(factor), 3, axis=-1)
            named.append({"type": "bitmap", "filename": self.picture(f"{what}{m}.exr", grey), "raw": True})
        return named[0], named[1]

    def _filled(self, table: Mapping[str, Any], name: str) -> Emitted:
        if table.get("type") == PHONG:
            raise InputError(f"material {name}", "is one of Phong's, which Mitsuba has not")
        if table.get("type") == STORED_TEXTURE:
            index, raw = table["index"], bool(table.get("raw", False))
            pixels = self._scene.textures[index].astype(np.float32) / 255
            kept = self.picture(
                f"texture{index}{'r' if raw else ''}.exr", pixels if raw else srgb_decode(pixels)
            )
            return {"type": "bitmap", "filename": kept, "raw": True}
        made = {k: self._filled(v, name) if isinstance(v, Mapping) else v for k, v in table.items()}
        return made | {"name": "vertex_tint"} if table.get("type") == "mesh_attribute" else made

    # ---- Lights ------------------------------------------------------------------------------------------

    def light(self, light: Lamp | PlacedPanel) -> list[Emitted]:
        """One light; several where Mitsuba has none like it."""
        from ..scene.variant import mitsuba
        from .placed_emitters import emitter_of

        if isinstance(light, PlacedPanel) or light.beam.distribution is None:
            made = emitter_of(mitsuba(), light)
            if "to_world" in made:
                made["to_world"] = np.array(made["to_world"].matrix)
            return [made]
        if light.radius > 0:
            self.notes.append(
                f"{light.name or 'a lamp'}: has a shape over the directions: written as a point"
            )
        faces = [self._face(light, n) for n in range(6)]
        least = _FAINT * max(irradiance.max() for irradiance, _ in faces)
        return [self._projector(light, *face) for face in faces if face[0].max() > least]

    def _face(self, lamp: Lamp, n: int) -> tuple[np.ndarray, np.ndarray]:
        """Through a face of a cube around a lamp: the irradiance on a plane at a distance of one; ahead and up."""
        axes = lamp.axes  # left, up, the beam
        ahead = axes[:, n % 3] * (1 if n < 3 else -1)
        up = axes[:, (n + 1) % 3]
        left = np.cross(up, ahead)
        x = 2 * (np.arange(_SIDE) + 0.5) / _SIDE - 1
        across, down = np.meshgrid(x, x)
        d = ahead - across[..., None] * left - down[..., None] * up
        d /= np.linalg.norm(d, axis=-1, keepdims=True)
        shape = lamp.beam.distribution
        assert shape is not None  # else it is an emitter of Mitsuba's
        along = np.asarray(shape.along(d.reshape(-1, 3) @ axes), np.float64)
        intensity = along.reshape(_SIDE, _SIDE, -1) * np.array(lamp.colour)
        irradiance = intensity * (d @ ahead)[..., None] ** 3
        return irradiance, np.stack([ahead, up])

    def _projector(self, lamp: Lamp, irradiance: np.ndarray, axes: np.ndarray) -> Emitted:
        file = self.picture(
            f"lamp{len(self.files)}.exr", irradiance / np.pi
        )  # Mitsuba's are π times as bright
        place, (ahead, up) = np.array(lamp.position), axes
        return {
            "type": "projector", "fov": 90.0, "to_world": lookat(place, place + ahead, up),
            "irradiance": {"type": "bitmap", "filename": file, "raw": True},
        }  # fmt: skip
