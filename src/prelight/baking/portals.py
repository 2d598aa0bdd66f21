"""The portals bake: a room lit through its windows, whatever is outside and whatever the glass becomes.

Yue, Iwasaki, Chen, Dobashi and Nishita, Interactive Rendering of Interior Scenes with Dynamic Environment
Illumination, 2009. Direct light through each portal is kept on a cube map, as pulses or Haar coefficients;
light that bounces in spherical harmonics of each portal's shell.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..encoding.modes import grouped
from ..errors import InputError
from ..scene.geometry import Scene
from ..storage.bake import Bake
from ..storage.journal import BakeWriter, refuse_target
from ..storage.manifest import FORMAT, VERSION, LayerRecord, Manifest
from .bounced_writer import FIRST
from .carrying_out import carry_out, check_disk
from .layer_writer import software
from .portals_direct import DirectLight, bake_direct
from .portals_indirect import IndirectLight, bake_indirect, held_share
from .portals_plan import PortalsPlan, plan_portals
from .portals_room import PortalsRoom
from .portals_settings import PortalsSettings
from .scene_arrays import WrittenArrays, scene_record

LAYER = "portals"
Report = Callable[[float], None]  # share done


def bake_portals(
    scene: Scene,
    path: str | Path,
    *,
    settings: PortalsSettings | None = None,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Bake a room for light through its portals into the new folder ``path``.

    Parameters
    ----------
    settings
        Which portals, and quality; the scene's glass and the defaults if not given.
    resume, force
        Go on with an interrupted bake of the same settings; replace what is there.
    report
        Hears the share done, 0 to 1.

    Raises
    ------
    InputError
        No portal, or one that is none; more memory than allowed; a partial bake of other settings.
    OutputError
        ``path`` exists, the disk is full or cannot be written; what was done can be resumed.
    InterruptedBakeError
        Stopped by Ctrl-C; what was done can be resumed.
    MissingExtraError
        Mitsuba or its LLVM is not installed.
    """
    refuse_target(Path(path), force=force)
    plan = plan_portals(scene, settings or PortalsSettings())
    return bake_planned(path, plan=plan, resume=resume, force=force, report=report)


def bake_planned(
    path: str | Path,
    *,
    plan: PortalsPlan,
    resume: bool = False,
    force: bool = False,
    report: Report | None = None,
) -> Bake:
    """Carry out a plan; otherwise as ``bake_portals``."""
    check_disk(Path(path), 2 * plan.bytes)  # tiles are kept until all are there
    tell = report or (lambda _: None)
    return carry_out(
        Path(path),
        lambda writer: _made(plan, writer, tell),
        identity=identity(plan),
        kept=lambda entries: f"direct light of {len(entries)} parts",
        resume=resume,
        force=force,
    )


def identity(plan: PortalsPlan) -> dict[str, int | float | str | None]:
    """Everything that the bytes of the bake depend on."""
    settings, portals = plan.settings, plan.room.portals
    names = ("cube", "rays", "order", "accuracy", "gather_rays", "seed")
    asked = {name: getattr(settings, name) for name in names}
    bounces = "all" if settings.bounces is None else settings.bounces
    digest = _digest(
        portals.corners, portals.pane_of, portals.portal_of_pane, portals.pane_tints, portals.tints
    )
    if settings.spectrum is not None:
        asked["spectrum"] = json.dumps([float(f"{energy:.6g}") for energy in settings.spectrum])
    return {
        "kind": LAYER, "scene": plan.room.scene.digest, "portals": digest, **asked, "bounces": bounces,
        "suns": int(settings.suns), "glossy_order": settings.glossy_order, "photons": plan.room.photons, **software(),
    }  # fmt: skip


def _digest(*arrays: np.ndarray) -> str:
    import hashlib

    h = hashlib.sha256()
    for array in arrays:
        h.update(repr((array.shape, array.dtype.str)).encode())
        h.update(np.ascontiguousarray(array).data)
    return h.hexdigest()


def _made(plan: PortalsPlan, writer: BakeWriter, report: Report) -> Manifest:
    room, settings = plan.room, plan.settings
    has_bounces = settings.bounces != 0
    part = 0.5 if has_bounces else 1.0
    direct = bake_direct(room, writer, lambda share: report(part * share))
    if not len(direct.rows):
        what = "no receiver sees the sky through one: it lies outside, or something stands before it"
        raise InputError(f"portal {room.portals.names[0]}", what)
    indirect = (
        bake_indirect(room, direct, lambda share: report(part + (1 - part) * share)) if has_bounces else None
    )
    written = WrittenArrays(writer)
    written.write_scene(room.scene)
    _write_portals(written, room)
    _write_direct(written, direct)
    if indirect is not None:
        _write_indirect(written, indirect)
    gloss = {} if room.gloss is None else written.write_gloss(f"layers/{LAYER}/glossy", room.gloss)
    layer = LayerRecord(
        kind=LAYER,
        basis_lights=len(room.portals) * 6 * settings.cube**2,
        coefficients=len(direct.rows),
        rays=direct.rays + (indirect.rays if indirect else 0) + int(gloss.get("glossy_rays", 0)),
        parameters=_parameters(plan, indirect) | ({"glossy_order": settings.glossy_order} if gloss else {}),
        statistics=_statistics(plan, direct, indirect) | gloss,
    )
    return Manifest(
        format=FORMAT,
        version=VERSION,
        settings=identity(plan),
        scene=scene_record(room.scene, (*room.notes, *(room.gloss.notes if room.gloss else ()))),
        layers={LAYER: layer},
        arrays=written.arrays,
        chunks=written.chunks,
        software=software(),
    )


def _write_portals(written: WrittenArrays, room: PortalsRoom) -> None:
    portals, at = room.portals, f"layers/{LAYER}"
    for name, values in (
        ("centres", portals.centres), ("areas", portals.areas), ("extents", portals.extents),
        ("outward", room.openness.outward), ("tints", portals.tints),
    ):  # fmt: skip
        written.write(f"{at}/{name}", np.ascontiguousarray(values, np.float32))
    if len(portals.glass):
        triangles = room.scene.triangles[portals.glass]
        vertices, first = np.unique(triangles, return_index=True)
        bare = np.abs(room.open.normals[vertices]).sum(axis=1) == 0  # of glass alone
        if bare.any():
            written.write(f"{at}/glass", vertices[bare].astype(np.int32))
            of = np.repeat(portals.portal_of_glass, 3)[first]
            written.write(f"{at}/glass_portal", of[bare].astype(np.int32))
    _write_openings(written, room)


def _write_openings(written: WrittenArrays, room: PortalsRoom) -> None:
    """What rays to a sun need at run time: the portals' triangles, where receivers look from, what is glass."""
    portals, at = room.portals, f"layers/{LAYER}/openings"
    written.write(f"{at}/corners", np.ascontiguousarray(portals.corners, np.float32))
    written.write(f"{at}/pane_of", portals.pane_of.astype(np.int32))
    written.write(f"{at}/origins", np.ascontiguousarray(room.origins, np.float32))
    if (room.beyond >= 0).any():
        written.write(f"{at}/beyond", room.beyond.astype(np.int32))
    if len(portals.glass):
        written.write(f"{at}/glass_triangles", np.sort(portals.glass).astype(np.int32))


def _write_direct(written: WrittenArrays, direct: DirectLight) -> None:
    at, rows = f"layers/{LAYER}", direct.rows
    for name in ("kind", "scale", "row_runs", "runs", "data"):
        written.write(f"{at}/{name}", getattr(rows, name))
    written.write(f"{at}/receiver", direct.receiver.astype(np.int32))
    for name in ("pane_rows", "portal_of_pane", "pane_tints"):
        written.write(f"{at}/{name}", getattr(direct, name))
    if direct.pane_caustic.any():
        written.write(f"{at}/pane_caustic", direct.pane_caustic)


def _write_indirect(written: WrittenArrays, indirect: IndirectLight) -> None:
    at = f"layers/{LAYER}/bounced"
    written.write(f"{at}/modes", grouped(indirect.modes))
    written.write(f"{at}/scales", indirect.scales)
    written.write(f"{at}/weights", indirect.weights)
    written.write(f"{at}/energy", indirect.energy.astype(np.float32))
    if indirect.first is not None:
        for name in FIRST:
            values = getattr(indirect.first, name)
            written.write(f"{at}/first/{name}", values if len(values) else np.zeros(1, values.dtype))


def _parameters(plan: PortalsPlan, indirect: IndirectLight | None) -> dict[str, int | float | str | None]:
    settings, wish = plan.settings, plan.settings.wish
    distance = None if math.isinf(wish.exterior_distance) else wish.exterior_distance
    return {
        "cube": settings.cube, "names": json.dumps(list(plan.room.portals.names)), "rays": settings.rays,
        "bounces": 0 if indirect is None else "all" if settings.bounces is None else settings.bounces,
        "order": None if indirect is None else indirect.order, "gather_rays": settings.gather_rays,
        "group": wish.group, "exterior_distance": distance, "theta_deg": wish.theta_deg, "returned": settings.returned,
        "photons": plan.room.photons, "seed": settings.seed,
    }  # fmt: skip


def _statistics(
    plan: PortalsPlan, direct: DirectLight, indirect: IndirectLight | None
) -> dict[str, int | float]:
    choice, advice = direct.choice, plan.advice
    told: dict[str, int | float] = {
        "direct_rays": direct.rays, "rows": choice.rows, "haar_rows": choice.haar_rows, "row_bytes": choice.bytes,
        "pulse_bytes": choice.pulse_bytes, "haar_bytes": choice.haar_bytes, "pulse_error": choice.pulse_error,
        "haar_error": choice.haar_error, "row_error": choice.error, "portal_area": float(plan.room.portals.areas.sum()),
        "largest_extent": advice.extent, "angle_deg": advice.angle_deg, "least_distance": advice.least_distance,
        "returned_distance": advice.returned_distance,
    }  # fmt: skip
    if plan.room.caustics is not None:
        told |= {"photons_traced": plan.room.caustics.emitted, "caustic_noise": plan.room.caustics.noise}
    if indirect is not None:
        told |= {
            "bounced_modes": indirect.modes.shape[1], "bounced_left_out": indirect.left_out,
            "bounced_products": indirect.bounces, "bounced_remaining": float(min(indirect.remaining, 1e30)),
            "bounced_entries": indirect.entries, "bounced_rays": indirect.rays,
            "bounced_held": held_share(indirect.energy),
        }  # fmt: skip
        if (first := indirect.first) is not None:
            told |= {
                "bounced_first_entries": len(first.steps), "bounced_first_threshold": first.threshold,
                "bounced_first_error": first.error,
            }  # fmt: skip
    return told
