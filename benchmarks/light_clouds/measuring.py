"""Lamps between the lights of a cloud, against the same operator without compression, and against the path tracer."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prelight.encoding.light_fit import bounded
from prelight.lighting.placed_lights import Lamp
from prelight.lighting.spot import Spot
from prelight.rays.mitsuba import Occluders
from prelight.rays.segments import PlainSegments
from prelight.relighting.cloud import CloudRelighter
from prelight.scene.geometry import Scene
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering
from prelight.transport.lamps import SphereLamps, lamp_light
from prelight.transport.path_traced_light import LitScene, as_diffuse

LAMPS, SEED = 50, 50
CLEAR = 0.02  # of the box's sides, from its walls
TRACED_LAMPS, RECEIVERS, SAMPLES = 8, 400, 1024


def point(at: np.ndarray) -> Lamp:
    x, y, z = (float(v) for v in at)
    return Lamp((x, y, z), Spot((1.0, 1.0, 1.0), direction=(0.0, -1.0, 0.0)), 0.0)


def spheres(places: np.ndarray) -> SphereLamps:
    count = len(places)
    return SphereLamps(
        np.float32(places), np.zeros(count, np.float32), np.full((count, 3), 4 * np.pi, np.float32)
    )


def between(scene: Scene, layer: Any, count: int = LAMPS, seed: int = SEED) -> np.ndarray:
    """Places in the cloud's box that are inside nothing."""
    segments = PlainSegments(scene.positions, scene.triangles, scene.normals)
    chance, found = np.random.default_rng(seed), np.zeros((0, 3))
    while len(found) < count:
        places = layer.low + (layer.high - layer.low) * (CLEAR + (1 - 2 * CLEAR) * chance.random((200, 3)))
        found = np.concatenate([found, places[segments.shares_of_backs(places) < 0.5]])
    return found[:count]


@dataclass
class Truth:
    """Direct and indirect light of points at the vertices, by the operator that bakes use."""

    scene: Scene
    gathering: Gathering
    occluders: Occluders
    origins: np.ndarray
    areas: np.ndarray

    @classmethod
    def of(cls, scene: Scene, layer: Any, rays: int, areas: np.ndarray) -> Truth:
        occluders = Occluders(scene.positions, scene.triangles)
        gathering = Gathering.trace(scene, occluders, origins=layer.origins, rays=rays)
        return cls(scene, gathering, occluders, layer.origins, areas)

    def light(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(V, lamps, 3) each."""
        parts = []
        for k in range(0, len(places), 16):
            lamps = spheres(places[k : k + 16])
            direct = lamp_light(self.occluders, self.origins, self.scene.normals, lamps=lamps)
            sent = bounded(direct, self.areas)[:, :, : 1 if self.gathering.is_grey else 3]
            parts.append((direct, bounced(self.gathering, np.ascontiguousarray(sent)).indirect))
        direct, indirect = (np.concatenate([part[k] for part in parts], axis=1) for k in (0, 1))
        return direct, np.broadcast_to(indirect, direct.shape)


def off(ours: np.ndarray, true: np.ndarray, areas: np.ndarray) -> float:
    """RMS over the surfaces, of the truth's."""
    a = np.sqrt(areas.astype(np.float64))[:, None]
    return float(np.linalg.norm((ours - true) * a) / max(np.linalg.norm(true * a), 1e-30))


def spread(values: list[float]) -> dict[str, float]:
    return {"median": float(np.median(values)), "p90": float(np.quantile(values, 0.9)), "worst": max(values)}


def errors(light: CloudRelighter, truth: Truth, places: np.ndarray) -> dict[str, Any]:
    """Indirect and whole light of lamps, and the milliseconds of each move."""
    direct, indirect = truth.light(places)
    of_indirect, of_all, took = [], [], []
    for k, at in enumerate(places):
        light.shine([point(at)])
        took.append(light.last.milliseconds)
        of_indirect.append(off(light.indirect, indirect[:, k], truth.areas))
        of_all.append(off(light.irradiance, direct[:, k] + indirect[:, k], truth.areas))
    return {
        "indirect": spread(of_indirect), "all": spread(of_all),
        "relights_per_second": 1e3 / float(np.median(took[5:])),
    }  # fmt: skip


def against_paths(
    light: CloudRelighter, scene: Scene, places: np.ndarray, areas: np.ndarray
) -> dict[str, Any]:
    """The whole light of some lamps at some vertices, beside Mitsuba's path tracer."""
    chance = np.random.default_rng(1)
    chosen = np.sort(chance.choice(len(scene.positions), min(RECEIVERS, len(scene.positions)), replace=False))
    chosen = chosen.astype(np.int32)
    found, seconds = [], 0.0
    for at in places[:TRACED_LAMPS]:
        began = time.perf_counter()
        lit = LitScene(as_diffuse(scene), lamps=spheres(at[None]))
        true = lit.light(chosen, origins=light.layer.origins, samples=SAMPLES).total
        seconds += time.perf_counter() - began
        light.shine([point(at)])
        found.append(off(light.irradiance[chosen], true, areas[chosen]))
    return {"all": spread(found), "reference_seconds": seconds, "samples": SAMPLES, "receivers": len(chosen)}


def bytes_of(path: Path) -> int:
    from prelight.storage.bake import Bake

    return Bake.open(path).manifest.bytes_of("layers/cloud/")
