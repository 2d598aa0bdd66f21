"""The same room by photons and by the gathering operator, and a portal's harmonics by one map."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from prelight.bases import spherical_harmonics
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.scene.stock.room import room as stock_room
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering
from prelight.transport.lamps import SphereLamps, lamp_light
from prelight.transport.mesh_fitness import measure_fitness
from prelight.transport.photon_mapping import PhotonMap, final_gathered
from prelight.transport.photon_sources import SphereSource, TriangleSource
from prelight.transport.photon_tracing import BOUNCED, DIRECT
from prelight.transport.vantage import vantage_points

ORDER = 4
_MANY, _FEW = 1 << 23, 1 << 20


def areas(scene: Scene) -> np.ndarray:
    a, b, c = (scene.positions[scene.triangles[:, k]].astype(np.float64) for k in range(3))
    out = np.zeros(len(scene.positions))
    for k in range(3):
        np.add.at(out, scene.triangles[:, k], np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6)
    return out


def differences(ours: np.ndarray, theirs: np.ndarray, weight: np.ndarray) -> dict[str, float]:
    """Of light (V,), by area: mean, signed mean and RMS, as shares of the mean."""
    mean = float((theirs * weight).sum() / weight.sum())
    off = ours.astype(np.float64) - theirs
    return {
        "mean_difference": float((np.abs(off) * weight).sum() / weight.sum() / mean),
        "signed_mean": float((off * weight).sum() / weight.sum() / mean),
        "rms": float(np.sqrt((off**2 * weight).sum() / weight.sum()) / mean),
    }


def both_ways(work: Path, *, small: bool = False) -> dict[str, Any]:
    """stock:room, a lamp within: bounced light by photons alone, by a final gather of photons, and by the operator.

    Stated errors: of photons, noise from their own squares, and the kernel's bias as what half its area changes; of the
    operator, noise as the difference of two of other rays, over √2. Vertices whose mesh does not hold the light, as
    behind a picture on the wall, are told apart by `mesh_fitness` before anything is compared.
    """
    scene = stock_room(detail=0.34 if small else 1.0)
    occluders = Occluders(scene.positions, scene.triangles)
    stand = vantage_points(scene, occluders)
    middle = (scene.positions.min(axis=0) + scene.positions.max(axis=0)) / 2
    lamp = SphereLamps(
        np.float32([middle]) + np.float32([0, 0.4, 0]), np.float32([0.1]), np.float32([[10, 10, 10]])
    )
    weight = areas(scene) * scene.normals.any(axis=1)

    started = time.perf_counter()
    D = lamp_light(occluders, stand, scene.normals, lamps=lamp, rays=256)
    operators = [Gathering.trace(scene, occluders, origins=stand, rays=1024, seed=seed) for seed in (0, 1)]
    solved = [bounced(g, D).indirect[:, 0, 1] for g in operators]
    by_operator = time.perf_counter() - started
    fit = measure_fitness(
        scene, occluders, direct=D, indirect=np.repeat(solved[0][:, None, None], 3, axis=2),
        direct_at=lambda p, n: lamp_light(occluders, p, n, lamps=lamp, rays=64),
    )  # fmt: skip
    all_area, weight = weight, weight * fit.judged

    started = time.perf_counter()
    photons = PhotonMap(scene, occluders, SphereSource(lamp), ways=DIRECT | BOUNCED)
    photons.more(_FEW if small else _MANY)
    traced = time.perf_counter()
    found = photons.light(ways=BOUNCED, nearest=1000)
    finer = photons.light(ways=BOUNCED, nearest=500, finest=2**-0.5, widest=4 * 2**-0.5)
    by_photons = time.perf_counter()
    everything = photons.light(nearest=1000).light
    gathered = final_gathered(operators[0], everything)[:, 0, 1]
    ours = found.light[:, 0, 1]
    noise = float(np.sqrt((found.noise[:, 0, 1].astype(np.float64) ** 2 * weight).sum() / weight.sum()))
    mean = float((solved[0] * weight).sum() / weight.sum())
    stated = np.sqrt(
        found.noise[:, 0, 1].astype(np.float64) ** 2
        + (finer.light[:, 0, 1].astype(np.float64) - ours) ** 2
        + (solved[0].astype(np.float64) - solved[1]) ** 2 / 2
    )
    two = differences(solved[0], solved[1], weight)["rms"] / np.sqrt(2)
    return {
        "vertices": len(scene.positions), "photons": photons.emitted, "landed": len(photons.photons),
        "seconds": {"operator": by_operator, "photons": traced - started, "density": by_photons - traced},
        "area_judged": float(weight.sum() / all_area.sum()),
        "stated": {
            "photons_noise_rms": noise / mean,
            "photons_kernel": differences(finer.light[:, 0, 1], ours, weight),
            "operator_noise_rms": float(two),
        },
        "stated_mean": float(np.sqrt(2 / np.pi) * (stated * weight).sum() / weight.sum() / mean),
        "share_within_two_stated": float(((np.abs(ours - solved[0]) <= 2 * stated) * weight).sum() / weight.sum()),
        "photons_less_operator": differences(ours, solved[0], weight),
        "gathered_less_operator": differences(gathered, solved[0], weight),
        "left_out_photons_less_operator": differences(ours, solved[0], all_area - weight),
    }  # fmt: skip


def portal(work: Path, *, small: bool = False) -> dict[str, Any]:
    """A window's 25 harmonics by one map of photons, and by one map for each: seconds, and how they differ."""
    scene = stock_room(detail=0.34 if small else 0.5)
    occluders = Occluders(scene.positions, scene.triangles)
    low, high = scene.positions.min(axis=0), scene.positions.max(axis=0)
    y, z = (low + high)[1:] / 2
    x = low[0] + 0.05
    corners = np.float32(
        [[x, y - 0.5, z - 0.5], [x, y + 0.5, z - 0.5], [x, y + 0.5, z + 0.5], [x, y - 0.5, z + 0.5]]
    )
    quad = np.stack([corners[[0, 1, 2]], corners[[0, 2, 3]]])
    if np.cross(quad[0, 1] - quad[0, 0], quad[0, 2] - quad[0, 0])[0] < 0:
        quad = np.ascontiguousarray(quad[:, ::-1])
    source = TriangleSource(quad, np.ones((2, 3), np.float32), np.zeros(2, np.int32))
    photons = PhotonMap(scene, occluders, source)
    photons.more(1 << 17)
    photons.light()  # compiles
    started = time.perf_counter()
    photons.more((1 << 17) if small else 500_000)
    traced = time.perf_counter() - started

    def harmonics(order: int) -> Any:
        return lambda p: spherical_harmonics.evaluate(order, -p.direction).astype(np.float32)

    times = {}
    for order in (0, 2, ORDER):
        started = time.perf_counter()
        found = photons.light(harmonics(order))
        times[f"order {order}"] = time.perf_counter() - started
    weight = areas(scene) * scene.normals.any(axis=1)
    of_function = np.sqrt((found.light[..., 1].astype(np.float64) ** 2 * weight[:, None]).sum(axis=0))
    noise = np.sqrt((found.noise[..., 1].astype(np.float64) ** 2 * weight[:, None]).sum(axis=0))
    return {
        "vertices": len(scene.positions), "photons": photons.emitted, "functions": (ORDER + 1) ** 2,
        "trace_seconds": traced, "density_seconds": times,
        "one_map_for_each_would_take": (ORDER + 1) ** 2 * (traced + times["order 0"]),
        "noise_over_light": {"first": float(noise[0] / of_function[0]), "worst": float((noise / of_function).max())},
    }  # fmt: skip
