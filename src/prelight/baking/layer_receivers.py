"""The rows of an environment layer: which they are, their zones, and the transfer of any of them."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..arrays import Int32, Normals, Positions
from ..rays.mitsuba import Occluders
from ..rays.surfaces import SurfaceScene
from ..scene.geometry import Scene
from ..scene.mesh import short_name
from ..transport.direct import DiffuseTransfer
from ..transport.eye import SeenPoints, seen_points, vertex_points
from ..transport.specular import rough_metals, specular_materials, without_specular
from ..transport.transfer import DarkTransfer, Transfer
from ..transport.vantage import vantage_points
from ..transport.viewed import ViewedTransfer
from .environment_settings import PHOTONS, PIXELS, EnvironmentSettings
from .exitant import ExitantPart
from .zones import DARK, DIFFUSE, VIEWED, Zone, divide, sort_of

_NOTHING = -1  # the sort of pixels that show no surface


class LayerReceivers:
    """Receivers of a scene for a bake of these settings.

    Raises
    ------
    InputError
        A camera that the scene does not have.
    """

    def __init__(self, scene: Scene, settings: EnvironmentSettings) -> None:
        self.scene, self.settings = scene, settings
        self.eye = settings.eye_in(scene)
        self.is_picture = settings.receivers == PIXELS
        self.count = settings.width * settings.height if self.is_picture else len(scene.positions)

    @cached_property
    def occluders(self) -> Occluders:
        """What casts shadows."""
        return Occluders(self.scene.positions, self.scene.triangles)

    @cached_property
    def origins(self) -> Positions:
        """Where rays of vertices begin, before they are lifted: not in a corner, if light is to bounce there."""
        if self.settings.bounces == 0:
            return self.scene.positions
        return vantage_points(self.scene, self.occluders)

    @cached_property
    def zones(self) -> list[Zone]:
        """Every row in one of them; the same for the same scene and settings."""
        positions, normals = self._places
        sorts = self._sorts
        parts = divide(positions, normals, sorts, zones=self.settings.zones)
        return [Zone(part, *self._kind(int(sorts[part[0]]))) for part in parts]

    def _kind(self, sort: int) -> tuple[str, int]:
        if sort == _NOTHING:
            return DARK, 3
        return (VIEWED, 3) if self.is_picture or sort else (DIFFUSE, 1)

    def transfer(self, zone: Zone, rows: Int32[np.ndarray, "some"] | None = None) -> Transfer:
        """Of a zone, or of some of its rows."""
        rows = zone.rows if rows is None else rows
        if zone.kind == DARK:
            return DarkTransfer(len(rows), zone.channels)
        if zone.kind == VIEWED:
            return ViewedTransfer(self.occluders, self.surfaces, self.points, receivers=rows)
        return DiffuseTransfer(self.occluders, self.origins[rows], self.scene.normals[rows])

    @cached_property
    def surfaces(self) -> SurfaceScene:
        """What the scene is made of, highlights no narrower than the lights."""
        return SurfaceScene(self.scene, resolution=self.settings.resolution)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What an eye sees otherwise than the materials say, one line each."""
        if self.eye is None:
            return () if self.glossy is None else self.glossy.notes
        notes = []
        if wide := self.surfaces.widened:
            names = ", ".join(short_name(name) for name in wide[:4]) + (", …" if len(wide) > 4 else "")
            notes.append(f"highlights narrower than the texels of the light widened to them: {names}")
        if share := self.points.share_on(self.scene, self.surfaces.delta):
            notes.append(
                f"smooth glass or mirror, which direct light does not reach: {share:.1%} of what is seen"
            )
        return tuple(notes)

    @cached_property
    def glossy(self) -> ExitantPart | None:
        """Vertices that send light otherwise than alike into all directions, for any eye; None if they are left out."""
        if not self.settings.glossy_order:
            return None
        return ExitantPart.of(
            self.scene, self.occluders, order=self.settings.glossy_order, origins=self.origins
        )

    @cached_property
    def bouncing(self) -> Scene:
        """The scene as light bounces in it, all surfaces diffuse but those that photons carry, which are black."""
        scene = self.scene if self.glossy is None else self.glossy.bouncing(self.scene)
        return without_specular(scene) if self.photons else scene

    @cached_property
    def photons(self) -> int:
        """That are traced for caustics: none where no material needs them, or light does not bounce."""
        wanted = PHOTONS if self.settings.photons is None else self.settings.photons
        return wanted if self.settings.bounces != 0 and specular_materials(self.scene).any() else 0

    @cached_property
    def metals(self) -> np.ndarray | None:
        """(materials,) those that gathering follows light from; None where there are none, or no gloss is kept."""
        settings = self.settings
        found = rough_metals(self.scene)
        return found if settings.glossy_order and settings.bounces != 0 and found.any() else None

    @cached_property
    def points(self) -> SeenPoints:
        """What the eye sees."""
        assert self.eye is not None
        camera, settings = self.eye[1], self.settings
        if not self.is_picture:
            return vertex_points(self.scene, camera.eye)
        return seen_points(
            self.occluders,
            camera,
            width=settings.width,
            height=settings.height,
            samples=settings.pixel_samples,
        )

    @cached_property
    def _places(self) -> tuple[Positions, Normals]:
        """Where rows lie and look; a pixel in the mean of its samples."""
        scene = self.scene
        if not self.is_picture:
            return scene.positions, scene.normals
        normals = self.points.interpolated(scene, scene.normals)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        return self.points.interpolated(scene, scene.positions), normals / np.maximum(length, 1e-30)

    @cached_property
    def _sorts(self) -> Int32[np.ndarray, "rows"]:
        """What makes rows unlike each other whatever their place: the sort of their material under a fixed eye."""
        scene = self.scene
        if self.eye is None:
            return np.zeros(self.count, np.int32)
        of_material = np.array([sort_of(material) for material in scene.materials], np.int32)
        if not self.is_picture:
            return of_material[scene.material_of_vertex]
        material = self.points.material(scene)
        return np.where(material < 0, _NOTHING, of_material[material]).astype(np.int32)
