"""What a transfer bake will cost, before it is paid: a few vertices' rays traced on this machine, and scaled."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property

from ..arrays import Positions
from ..errors import InputError
from ..rays.mitsuba import Occluders
from ..scene.geometry import Scene
from ..transport.specular import as_photons_see, is_specular, specular_materials
from ..transport.vantage import vantage_points
from .bounced_plan import tried_rows
from .environment_plan import machine_memory
from .exitant import ExitantPlan, plan_exitant
from .first_bounce import BYTES_PER_ENTRY, BYTES_PER_VERTEX
from .transfer_settings import COARSER, HELD_OUT, TRIALS, TransferSettings

_PROCESS_BYTES = 400_000_000  # Python, the renderer and its compiler
_BYTES_PER_TRIANGLE = 200  # of the renderer's tree
_RAYS_AT_ONCE, _BYTES_PER_RAY = 1 << 22, 60  # of a tile of the operator
_USED_SHARE = 0.9
_KEPT_SHARE = 0.25  # of the operator's entries, below the number asked for
_COLUMNS_AT_ONCE, _COPIES = 96, 22  # of light, while it is solved
_PRODUCTS = 7  # that solving takes
_ENTRY_COLUMNS = 2.0e9  # a second, of products, on two cores
_THINNED = 3e-7  # seconds an entry of the whole operator, for thinning


@dataclass(frozen=True)
class TransferPlan:
    """An estimate, and what the operator may take."""

    settings: TransferSettings
    scene: Scene
    vertices: int
    triangles: int
    rays: int
    entries: int  # of the whole operator
    seconds: float
    memory: int  # bytes, peak of the process
    bytes: int  # on disk
    operator_bytes: int  # what the operator may take; beyond it tiles are traced again
    notes: tuple[str, ...]
    glossy: ExitantPlan
    _ground: Ground

    @property
    def ground(self) -> Ground:
        """The scene's triangles in the renderer, and where its vertices look out."""
        return self._ground

    @property
    def caustics(self) -> bool:
        """Whether there is clear glass or a mirror, whose light photons carry."""
        return self.settings.caustics and bool(specular_materials(self.scene).any())

    def summary(self) -> dict[str, float | int | list[str]]:
        """What ``--dry-run --json`` prints."""
        names = ("vertices", "triangles", "rays", "entries", "seconds", "memory", "bytes")
        glossy = {f"glossy_{name}": value for name, value in asdict(self.glossy).items() if self.glossy.rows}
        return {name: getattr(self, name) for name in names} | glossy | {"notes": list(self.notes)}


class Ground:
    """A scene's triangles in the renderer, and where the rays of its vertices begin."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.occluders = Occluders(scene.positions, scene.triangles)

    @cached_property
    def origins(self) -> Positions:
        """(V, 3)."""
        return vantage_points(self.scene, self.occluders)


def plan_transfer(scene: Scene, settings: TransferSettings) -> TransferPlan:
    """Trace a few rays, and scale.

    Raises
    ------
    InputError
        More memory is needed than allowed, or photons cannot carry a material.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    if settings.caustics and specular_materials(scene).any():
        as_photons_see(scene)  # says now what photons cannot carry when relighting
    ground, V = Ground(scene), len(scene.positions)
    per_row, ray_seconds = tried_rows(
        scene, ground.occluders, ground.origins, gather_rays=settings.gather_rays
    )
    entries = int(per_row * V)
    finer = min(settings.entries, _KEPT_SHARE * per_row) * V
    thinned = min(settings.entries // COARSER, _KEPT_SHARE * per_row) * V  # of light that has bounced before
    on_disk = int(V * (2 * BYTES_PER_VERTEX + 12 + 4 * settings.modes) + BYTES_PER_ENTRY * (finer + thinned))
    fixed = _PROCESS_BYTES + len(scene.triangles) * _BYTES_PER_TRIANGLE + on_disk
    fixed += min(_RAYS_AT_ONCE, V * settings.gather_rays) * _BYTES_PER_RAY
    lights = 3 * (TRIALS + 2 * settings.modes)
    fixed += int(V * 4 * (lights + _COPIES * _COLUMNS_AT_ONCE) + 8 * (finer + thinned))
    wanted = entries * (16 if scene.textures else 8) + 8 * V
    left = int(_USED_SHARE * (settings.memory or machine_memory() // 2) - fixed)
    if left < 0:
        least = fixed / _USED_SHARE / 1e9 + 0.05
        allowed = fixed / 1e9 + left / 1e9
        reason = f"{allowed:.1f} GB is not enough for {V:,} vertices; at least {least:.1f} GB is"
        raise InputError("memory", reason)
    rays = V * settings.gather_rays
    seconds = rays * ray_seconds * (1 if wanted <= left else 1 + 2 * (1 - left / wanted))
    seconds += entries * _THINNED
    seconds += _PRODUCTS * 3 * (TRIALS + settings.modes) * thinned / _ENTRY_COLUMNS
    seconds += _PRODUCTS * 3 * HELD_OUT * entries / _ENTRY_COLUMNS
    glossy = plan_exitant(scene, settings.glossy_order)
    return TransferPlan(
        settings=settings,
        scene=scene,
        vertices=V,
        triangles=len(scene.triangles),
        rays=rays + glossy.rays,
        entries=entries,
        seconds=float(seconds + glossy.seconds),
        memory=int(fixed + min(wanted, left)),
        bytes=on_disk
        + glossy.bytes
        + 40 * V
        + 16 * len(scene.triangles)
        + sum(t.nbytes for t in scene.textures),
        operator_bytes=left,
        notes=() if settings.glossy_order else _notes(scene, caustics=settings.caustics),
        glossy=glossy,
        _ground=ground,
    )


def _notes(scene: Scene, *, caustics: bool) -> tuple[str, ...]:
    """What this kind of bake cannot carry, one line."""
    glossy = [
        material.name
        for material in scene.materials
        if not material.is_lambertian and not (caustics and is_specular(material))
    ]
    if not glossy:
        return ()
    names = ", ".join(name[:40] for name in glossy[:4]) + (", …" if len(glossy) > 4 else "")
    return (
        f"{names}: lit, and light bounces there, as from diffuse surfaces of their base colour; no reflections "
        "(--glossy-order 8 shows them)",
    )
