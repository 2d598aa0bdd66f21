"""What a cloud of lights will cost, before it is paid: its grid, a few rays traced on this machine, and scaled."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..arrays import Float32, Positions
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..rays.segments import PlainSegments
from ..scene.geometry import Scene
from ..transport.specular import as_photons_see, is_specular, specular_materials
from ..transport.spreading import vertex_areas
from ..transport.vantage import vantage_points
from .bounced_plan import tried_rows
from .cloud_grid import LightGrid, light_grid
from .cloud_regions import MODES_A_REGION
from .cloud_settings import CloudSettings
from .environment_plan import machine_memory

COLUMNS = 32  # of light, solved together and kept as one part
PHOTONS = 1 << 16  # of each light, for caustics, where a material needs them
BOUNCED_SHARE = 0.25  # of these, beside them, for light that bounced before
_PHOTONS_A_SECOND, _BYTES_PER_PHOTON = 4e5, 200  # with their sums; of a part's photons that land
_PROCESS_BYTES = 400_000_000  # Python, the renderer and its compiler
_BYTES_PER_TRIANGLE = 300  # of both trees
_RAYS_AT_ONCE, _BYTES_PER_RAY = 1 << 22, 60  # of a tile of the operator
_USED_SHARE = 0.9
_COPIES = 24  # of the columns that are solved together
_PRODUCTS = 7  # that solving takes
_ENTRY_COLUMNS = 2.0e9  # a second, of products, on two cores
_SHADOW_RAYS = 20e6  # a second
_COMPONENT_SECONDS = 2.5e-9  # a vertex, column, colour and round of clustering, measured
_ROUNDS = 25
_ZONE_COPIES = 8  # of a zone's rows, in double precision
_MERGED_SHARE = 0.5  # of the lights: what clustering leaves, for want of better


@dataclass(frozen=True)
class CloudPlan:
    """An estimate, and what the operator may take."""

    settings: CloudSettings
    scene: Scene
    grid: LightGrid
    vertices: int
    triangles: int
    rays: int
    seconds: float
    memory: int  # bytes, peak of the process
    scratch: int  # bytes on disk while baking
    bytes: int  # on disk
    operator_bytes: int  # what the operator may take; beyond it tiles are traced again
    notes: tuple[str, ...]
    ground: CloudGround
    photons: int = 0  # of each light

    def summary(self) -> dict[str, float | int | list[str]]:
        """What ``--dry-run --json`` prints."""
        names = ("vertices", "triangles", "rays", "seconds", "memory", "scratch", "bytes")
        found: dict[str, float | int | list[str]] = {name: getattr(self, name) for name in names}
        return found | {
            "lights": len(self.grid),
            "in_solids": self.grid.in_solids,
            "step": float(self.grid.step.max()),
            "notes": list(self.notes),
        }


class CloudGround:
    """A scene's triangles for rays, and where the rays of its vertices begin."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.segments = PlainSegments(scene.positions, scene.triangles, scene.normals)
        self.occluders = Occluders(scene.positions, scene.triangles)

    @cached_property
    def areas(self) -> Float32[np.ndarray, "vertices"]:
        """Of the surface around each vertex, m²."""
        a, b, c = np.moveaxis(self.scene.positions[self.scene.triangles].astype(np.float64), 1, 0)
        whole = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
        return vertex_areas(self.scene) * np.float32(whole / len(self.scene.positions))

    @cached_property
    def origins(self) -> Positions:
        """(V, 3)."""
        return vantage_points(self.scene, self.occluders)


def plan_cloud(scene: Scene, settings: CloudSettings) -> CloudPlan:
    """Lay out the grid, trace a few rays, and scale.

    Raises
    ------
    InputError
        No light is in free space, or more memory is needed than allowed.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    ground, V = CloudGround(scene), len(scene.positions)
    grid = light_grid(scene, ground.segments, lights=settings.lights, box=settings.box, shell=settings.shell)
    per_row, ray_seconds = tried_rows(
        scene, ground.occluders, ground.origins, gather_rays=settings.gather_rays
    )
    entries, colours = int(per_row * V), 3
    columns = len(grid) + settings.modes
    solved = columns + (trained(settings.modes) + HELD_OUT if settings.modes else 0)
    fixed = _PROCESS_BYTES + len(scene.triangles) * _BYTES_PER_TRIANGLE
    fixed += min(_RAYS_AT_ONCE, V * settings.gather_rays) * _BYTES_PER_RAY
    solving = 4 * colours * V * COLUMNS * _COPIES
    zone = 8 * colours * min(V, settings.zone) * columns * _ZONE_COPIES
    zone += 3 * 4 * len(grid) ** 2  # distances of pairs of lights
    photons = (PHOTONS if settings.photons is None else settings.photons) * bool(
        specular_materials(scene).any()
    )
    if photons:
        as_photons_see(scene)  # refuses what photons cannot carry before anything is paid
    fixed += max(solving, zone) + photons * COLUMNS * _BYTES_PER_PHOTON
    wanted = entries * (16 if scene.textures else 8) + 8 * V
    left = int(_USED_SHARE * (settings.memory or machine_memory() // 2) - fixed)
    if left < 0:
        least, allowed = fixed / _USED_SHARE / 1e9 + 0.05, (fixed + left) / _USED_SHARE / 1e9
        what = f"{V:,} vertices and {len(grid):,} lights"
        reason = f"{allowed:.1f} GB is not enough for {what}; at least {least:.1f} GB is"
        raise InputError("memory", reason)
    rays, shadows = V * settings.gather_rays, V * len(grid) * (64 if settings.radius else 1)
    seconds = rays * ray_seconds * (1 if wanted <= left else 1 + 2 * (1 - left / wanted))
    seconds += shadows / _SHADOW_RAYS + _PRODUCTS * colours * solved * entries / _ENTRY_COLUMNS
    seconds += (1 + BOUNCED_SHARE) * photons * len(grid) / _PHOTONS_A_SECOND
    seconds += _ROUNDS * colours * V * columns * _COMPONENT_SECONDS
    of_zone = max(MODES_A_REGION, settings.modes * min(1.0, settings.zone / V))
    kept = _MERGED_SHARE * len(grid) + min(settings.modes, of_zone)
    clusters = settings.clusters or max(1, min(settings.zone, V) // VERTICES_A_CLUSTER)
    clusters *= max(1, V // settings.zone)
    bases = clusters * (settings.coefficients + 1) * kept * 2
    per_value = 1 if settings.codes == "bytes" else 2
    on_disk = bases + V * (colours * settings.coefficients * per_value + 2.1 * settings.modes + 24)
    return CloudPlan(
        settings=settings,
        scene=scene,
        grid=grid,
        vertices=V,
        triangles=len(scene.triangles),
        rays=rays + shadows,
        seconds=float(seconds),
        memory=int(fixed + min(wanted, left)),
        scratch=4 * V * (colours * solved + columns),
        bytes=int(on_disk + 40 * V + 16 * len(scene.triangles) + sum(t.nbytes for t in scene.textures)),
        operator_bytes=left,
        notes=() if settings.glossy_order else _notes(scene, photons),
        ground=ground,
        photons=photons,
    )


VERTICES_A_CLUSTER = 33
HELD_OUT = 32  # lamps that errors are measured on
_MOST_TRAINED = 576  # a region has some tens of modes


def trained(modes: int) -> int:
    """How many lamps so many modes are learnt from."""
    return min(modes + modes // 2, _MOST_TRAINED)


def _notes(scene: Scene, photons: int) -> tuple[str, ...]:
    """What this kind of bake cannot carry, one line."""
    glossy = [
        material.name
        for material in scene.materials
        if not material.is_lambertian and not (photons and is_specular(material))
    ]
    if not glossy:
        return ()
    names = ", ".join(name[:40] for name in glossy[:4]) + (", …" if len(glossy) > 4 else "")
    return (
        f"{names}: lit, and light bounces there, as from diffuse surfaces of their base colour; no reflections "
        "(--glossy-order 8 shows them)",
    )
