"""Baking with the two halves timed, relighting against the clock, receivers against the path tracer."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from prelight.baking.portals import bake_planned
from prelight.baking.portals_plan import plan_portals
from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.lighting.environment import Environment
from prelight.rays.offset import ray_offset
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.geometry import Scene
from prelight.storage.bake import Bake
from prelight.transport.path_traced_light import LitScene, as_diffuse

RECEIVERS, SAMPLES = 1000, 4096
TURNS = 24


def baked(
    scene: Scene, path: Path, settings: PortalsSettings, *, keep: bool = False
) -> tuple[PortalsRelighter, PortalsRoom, dict[str, Any]]:
    """The layer, its room, and the paper's figures: minutes and megabytes of direct and of bounced light.

    What is there already is used again if ``keep``; its seconds are then 0.
    """
    plan = plan_portals(scene, settings)
    began, halves = time.perf_counter(), [0.0]

    def tell(share: float) -> None:
        if not halves[0] and share >= (0.5 if settings.bounces != 0 else 1.0):
            halves[0] = time.perf_counter() - began

    there, partial = keep and path.exists(), path.with_name(path.name + ".partial").exists()
    begun = {"resume": True} if keep and partial else {"force": True}
    bake = Bake.open(path) if there else bake_planned(path, plan=plan, **begun, report=tell)
    whole = time.perf_counter() - began
    layer = bake.summary()["layers"][0]
    found = layer["statistics"]
    return PortalsRelighter(bake), plan.room, {
        "triangles": len(scene.triangles), "vertices": len(scene.positions), "portals": len(plan.room.portals),
        "direct_seconds": halves[0], "indirect_seconds": whole - halves[0],
        "direct_megabytes": (layer["bytes"] - layer["bounced_bytes"]) / 1e6,
        "indirect_megabytes": layer["bounced_bytes"] / 1e6, "rows": found["rows"], "haar_rows": found["haar_rows"],
        "pulse_megabytes": found["pulse_bytes"] / 1e6, "haar_megabytes": found["haar_bytes"] / 1e6,
        "row_error": found["row_error"], "modes": found.get("bounced_modes"), "left_out": found.get("bounced_left_out"),
    }  # fmt: skip


def relights(room: PortalsRelighter, sky: Environment) -> dict[str, float]:
    """Radiance of all vertices under a sky that turns: a shell captured once a frame, then everything else."""
    n = room.layer.cube
    shells = [sky.rotated(15.0 * k).cube(n)[None] for k in range(TURNS)]
    albedo = np.ones((room.vertices, 3), np.float32)
    took = []
    for shell in shells:
        began = time.perf_counter()
        room.set_shells(shell)
        _ = room.irradiance * albedo
        took.append(time.perf_counter() - began)
    middle = float(np.median(took[2:]))
    return {"milliseconds": 1e3 * middle, "a_second": 1 / middle, "worst_milliseconds": 1e3 * max(took[2:])}


def chosen_receivers(room: PortalsRoom, light: PortalsRelighter, count: int = RECEIVERS) -> np.ndarray:
    """Vertices by the area around them, among those indoors that light through portals reaches at all."""
    scene = room.open
    a, b, c = np.moveaxis(scene.positions[scene.triangles].astype(np.float64), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    around = np.bincount(scene.triangles.ravel(), np.repeat(area, 3), minlength=len(scene.positions))
    inside = np.abs(light.irradiance).sum(axis=1) > 1e-4 * light.irradiance.sum(axis=1).mean()
    around *= inside & (np.abs(scene.normals).sum(axis=1) > 0) & _indoors(room)
    rng = np.random.default_rng(7)
    return np.sort(
        rng.choice(len(around), min(count, int((around > 0).sum())), replace=False, p=around / around.sum())
    )


def _indoors(room: PortalsRoom) -> np.ndarray:
    """(V,) whether vertices see the sky through portals alone, by 512 rays of each."""
    mi, scene = room.occluders.mi, room.open
    rng, inside = np.random.default_rng(5), np.abs(scene.normals).sum(axis=1) > 0
    start = room.origins + np.float32(ray_offset(scene.positions)) * scene.normals
    for _ in range(512):
        d = rng.standard_normal(scene.normals.shape)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        d = (scene.normals + 0.999 * d).astype(np.float32)
        ray = mi.Ray3f(
            mi.Point3f(*(mi.Float(np.ascontiguousarray(x, np.float32)) for x in start.T)),
            mi.Vector3f(*(mi.Float(np.ascontiguousarray(x)) for x in d.T)),
        )
        glazed = room._glass.ray_test(ray)
        inside &= np.array(glazed | room.occluders.scene.ray_test(ray))
    return inside


def against_path_tracer(
    light: PortalsRelighter,
    room: PortalsRoom,
    cube: np.ndarray,
    *,
    factor=(1.0, 1.0, 1.0),
    samples: int = SAMPLES,
) -> dict[str, float]:
    """Mean of differences over the mean, direct and bounced light apart; ``light`` is lit by the same cube already."""
    chosen = chosen_receivers(room, light).astype(np.int32)
    truth = LitScene(as_diffuse(room.open), sky=cube).light(chosen, origins=room.origins, samples=samples)
    direct, whole = light.direct[chosen], light.irradiance[chosen]
    factor = np.float32(factor)
    out: dict[str, float] = {}
    for name, ours, known, variance in (
        ("direct", direct, truth.direct, truth.direct_variance),
        ("bounced", whole - direct, truth.indirect, truth.indirect_variance),
        ("all", whole, truth.total, truth.total_variance),
    ):
        true, noise = known * factor, np.sqrt(variance) * factor
        mean = float(true.mean())
        out |= {
            f"{name}_difference": float(np.abs(ours - true).mean()) / mean,
            f"{name}_signed": float((ours - true).mean()) / mean,
            f"{name}_noise": float(noise.mean()) * np.sqrt(2 / np.pi) / mean,
        }  # fmt: skip
    return out
