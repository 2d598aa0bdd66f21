"""What a bake of portals will cost, before it is paid: a few receivers' rays traced on this machine, and scaled."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from ..bases import spherical_harmonics
from ..encoding.pulse_or_haar import encoded, size_of
from ..errors import InputError
from ..scene.geometry import Scene
from ..transport.specular import as_photons_see
from .bounced_plan import tried_rows
from .environment_plan import machine_memory
from .portals_advice import PortalsAdvice, advise
from .portals_room import PortalsRoom
from .portals_settings import PortalsSettings

_PROCESS_BYTES = 420_000_000  # Python, the renderer and its compiler
_BYTES_PER_TRIANGLE = 260  # of the renderer's trees, with the glass left out and alone
_BYTES_PER_LANE = 48
_LANES = 1 << 22
_PILOT_ROWS = 512
_ROW_BYTES = 17  # on disk besides runs and bytes
_SECONDS_PER_PHOTON, _BYTES_PER_PHOTON = 1e-5, 150  # with the rows of what half of them bring
_PRODUCTS = 8
_ENTRY_COLUMNS = 2.0e9  # a second, of products, on two cores
_MIXTURES = 2 * 124 + 31
_EACH = 128  # portals up to which every column is bounced
_MODES_OF_PORTAL, _MOST_MODES = 40, 512


@dataclass(frozen=True)
class PortalsPlan:
    """An estimate, and the room it is for."""

    room: PortalsRoom
    settings: PortalsSettings
    receivers: int
    triangles: int
    portals: int
    panes: int
    rays: int
    rows: int
    seconds: float
    memory: int  # bytes, peak of the process
    bytes: int  # on disk
    advice: PortalsAdvice
    photons: int = 0  # for caustics

    def summary(self) -> dict[str, float | int | list[str] | dict[str, float]]:
        """What ``--dry-run --json`` prints."""
        names = (
            "receivers",
            "triangles",
            "portals",
            "panes",
            "rays",
            "rows",
            "seconds",
            "memory",
            "bytes",
            "photons",
        )
        advice = {
            "largest_extent": self.advice.extent, "angle_deg": self.advice.angle_deg,
            "least_distance": self.advice.least_distance, "returned_distance": self.advice.returned_distance,
        }  # fmt: skip
        return {name: getattr(self, name) for name in names} | {
            "names": list(self.room.portals.names),
            **advice,
        }


def plan_portals(scene: Scene, settings: PortalsSettings) -> PortalsPlan:
    """Find the portals, trace a few rays, and scale.

    Raises
    ------
    InputError
        No portal, one that light cannot leave or that lies outside, or more memory than allowed.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    room = PortalsRoom(scene, settings)
    V, portals = len(scene.positions), room.portals
    if room.photons:
        as_photons_see(room.open)  # refuses what photons cannot carry before anything is paid
    rays, rows, size, direct_seconds = _tried(room)
    entries, gather_seconds = (0.0, 0.0)
    columns = 0
    if settings.bounces != 0:
        per_row, ray_seconds = tried_rows(
            room.open, room.occluders, room.origins, gather_rays=settings.gather_rays
        )
        entries, gather_seconds = per_row * V, V * settings.gather_rays * ray_seconds
        columns = len(portals) * spherical_harmonics.count(settings.order)
    held = min(columns, _MIXTURES)  # in memory at a time
    columns = columns if len(portals) <= _EACH else held
    direct_seconds += _SECONDS_PER_PHOTON * room.photons
    seconds = direct_seconds + gather_seconds + _PRODUCTS * 3 * columns * entries / _ENTRY_COLUMNS
    memory = _PROCESS_BYTES + _BYTES_PER_TRIANGLE * len(scene.triangles) + 3 * size + _LANES * _BYTES_PER_LANE
    memory += int(12 * V * (3 * held + 150)) if columns else 0
    memory += int(_BYTES_PER_PHOTON * room.photons)
    allowed = settings.memory or machine_memory() // 2
    if memory > allowed:
        least = memory / 1e9 + 0.05
        what = f"{allowed / 1e9:.1f} GB is not enough for {V:,} vertices; at least {least:.1f} GB is"
        raise InputError("memory", what)
    memory += min(int(16 * entries), allowed - memory)
    kept = min(_MODES_OF_PORTAL * len(portals), _MOST_MODES) + 4 if columns else 0
    kept += 500 if columns and settings.suns else 0
    return PortalsPlan(
        room, settings, V, len(scene.triangles), len(portals), len(portals.portal_of_pane), rays, rows, seconds,
        memory, int(size + (52 + kept) * V + 16 * len(scene.triangles)),
        advise(portals, settings), room.photons,
    )  # fmt: skip


def _tried(room: PortalsRoom) -> tuple[int, int, int, float]:
    """Rays, rows, bytes and seconds of direct light, from some receivers, after a launch that compiles."""
    V, tried = len(room.scene.positions), room.rays
    step = max(1, min(_PILOT_ROWS, _LANES // room.settings.rays // 4))
    rng = np.random.default_rng(0)
    starts = rng.integers(0, max(1, V - step), 3)
    rays = rows = size = 0
    tried.trace(int(starts[0]), min(16, V))
    began = time.perf_counter()
    for first in starts.tolist():
        found = tried.trace(first, min(step, V - first))
        rays += found.rays
        seen = np.add.reduceat(np.append(found.weight, 0), found.starts[:-1]) * (np.diff(found.starts) > 0)
        lit = np.flatnonzero(seen > 0)[:256]
        lengths = np.diff(found.starts)[lit]
        begins = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
        lane = np.repeat(found.starts[lit] - begins[:-1], lengths) + np.arange(begins[-1])
        made, _, _ = encoded(begins, found.cell[lane], found.weight[lane], room.settings.cube)
        rows += int((seen > 0).sum())
        size += int((size_of(made) + _ROW_BYTES * len(made)) * (seen > 0).sum() / max(len(lit), 1))
    factor = V / (3 * min(step, V))
    return (
        round(rays * factor),
        round(rows * factor),
        round(size * factor),
        (time.perf_counter() - began) * factor,
    )
