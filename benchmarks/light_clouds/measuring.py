"""Lamps between the lights of a cloud, against the same operator without compression, and against the path tracer."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from prelight.encoding.light_fit import bounded
from prelight.lighting.placed_lights import Lamp
from prelight.lighting.spot import Spot
from prelight.rays.mitsuba import Occluders
from prelight.rays.segments import PlainSegments
from prelight.rays.surfaces import SurfaceScene
from prelight.relighting.cloud import CloudRelighter
from prelight.scene.geometry import Scene
from prelight.transport.bounces import bounced
from prelight.transport.gathering import Gathering
from prelight.transport.lamps import SphereLamps, lamp_light
from prelight.transport.path_traced_light import LitScene, as_diffuse

LAMPS, SEED = 50, 50
CLEAR = 0.02  # of the box's sides, from its walls
RECEIVERS, SAMPLES = 256, 1024


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
    """Indirect and whole light of lamps, near surfaces and away from them, and the milliseconds of each move."""
    direct, indirect = truth.light(places)
    of_indirect, of_all, took = [], [], []
    for k, at in enumerate(places):
        light.shine([point(at)])
        took.append(light.last.milliseconds)
        of_indirect.append(off(light.indirect, indirect[:, k], truth.areas))
        of_all.append(off(light.irradiance, direct[:, k] + indirect[:, k], truth.areas))
    step = (
        float(getattr(light.layer, "parameters", {}).get("step") or 0.0) if hasattr(light, "layer") else 0.0
    )
    found: dict[str, Any] = {"indirect": spread(of_indirect), "all": spread(of_all)}
    gaps = np.array([np.sqrt(((truth.scene.positions - at) ** 2).sum(axis=1).min()) for at in places])
    for name, chosen in (("near", gaps < 0.5 * step), ("away", gaps >= 0.5 * step)):
        if chosen.any() and step:
            own = [e for e, is_own in zip(of_indirect, chosen, strict=True) if is_own]
            found[f"indirect_{name}"] = {"lamps": len(own), **spread(own)}
    return found | {"milliseconds": float(np.median(took[5:]))}


def columns_lost(light: CloudRelighter, truth: Truth, chosen: np.ndarray) -> dict[str, Any]:
    """Lamps at the places of some of the grid's lights: what is left of their own light is lost by compression.

    Irradiance, and radiance: times the albedo.
    """
    _, indirect = truth.light(light.layer.grid[chosen])
    albedo, lost, shown, squares = truth.scene.albedo, [], [], np.zeros(2)
    for k, light_of_grid in enumerate(chosen):
        light.shine([point(light.layer.grid[light_of_grid])])
        lost.append(off(light.indirect, indirect[:, k], truth.areas))
        shown.append(off(albedo * light.indirect, albedo * indirect[:, k], truth.areas))
        for part, values in enumerate((light.indirect - indirect[:, k], indirect[:, k])):
            squares[part] += (truth.areas[:, None] * np.square(albedo * values, dtype=np.float64)).sum()
    return {"lights": len(chosen), "irradiance": spread(lost), "radiance": spread(shown),
            "radiance_of_all_together": float(np.sqrt(squares[0] / squares[1])),
            "coefficients": light.bake.layers[light.name].statistics["coefficients_a_vertex"]}  # fmt: skip


def against_paths(
    light: CloudRelighter, scene: Scene, places: np.ndarray, areas: np.ndarray
) -> dict[str, Any]:
    """The whole light of lamps at some vertices, beside Mitsuba's path tracer; its own noise is taken off."""
    chance = np.random.default_rng(1)
    chosen = np.sort(chance.choice(len(scene.positions), min(RECEIVERS, len(scene.positions)), replace=False))
    chosen = chosen.astype(np.int32)
    plain, found, ours_at = as_diffuse(scene), {"all": [], "indirect": []}, []
    surfaces, a = SurfaceScene(plain), areas[chosen].astype(np.float64)[:, None]
    began = time.perf_counter()
    for at in places:
        lit = LitScene(plain, lamps=spheres(at[None]), surfaces=surfaces)
        true = lit.light(chosen, origins=light.layer.origins, samples=SAMPLES)
        moved = time.perf_counter()
        light.shine([point(at)])
        ours_at.append(time.perf_counter() - moved)
        for name, ours, known, variance in (
            ("all", light.irradiance, true.total, true.total_variance),
            ("indirect", light.indirect, true.indirect, true.indirect_variance),
        ):
            left = (a * (np.square(ours[chosen] - known) - variance)).sum()
            found[name].append(float(np.sqrt(max(left, 0.0) / max((a * np.square(known)).sum(), 1e-30))))
    seconds = time.perf_counter() - began - sum(ours_at)
    return {
        **{name: spread(values) for name, values in found.items()}, "lamps": len(places),
        "reference_seconds_a_lamp": seconds / len(places), "samples": SAMPLES, "receivers": len(chosen),
        "seconds_a_move": float(np.median(ours_at[5:])),
    }  # fmt: skip


def steps(light: CloudRelighter, truth: Truth, places: np.ndarray) -> dict[str, Any]:
    """How much light changes from place to place, beside the reference: its mean change over the surfaces."""
    direct, indirect = truth.light(places)
    a, worst = truth.areas / truth.areas.sum(), {}
    kept = {"all": [], "indirect": []}
    for at in places:
        light.shine([point(at)])
        kept["all"].append(light.irradiance.mean(axis=1))
        kept["indirect"].append(light.indirect.mean(axis=1))
    for name, real in (("all", direct + indirect), ("indirect", indirect)):
        known = real.mean(axis=2).T
        ours, true = (np.abs(np.diff(x, axis=0)) @ a for x in (np.array(kept[name]), known))
        allowed = 2 * true + 0.01 * float(known.mean(axis=0) @ a)
        worst[name] = float((ours / allowed).max())
    return {"worst_share_of_what_is_allowed": worst, "steps": len(places) - 1}


def leaks(light: CloudRelighter, truth: Truth, places: np.ndarray) -> dict[str, Any]:
    """Vertices that a lamp does not see: their mean light, as a share of the reference's there.

    Where the reference has less there than a thousandth of its mean everywhere, the share is of that.
    """
    direct, indirect = truth.light(places)
    shares, signed = [], []
    for k, at in enumerate(places):
        light.shine([point(at)])
        behind = direct[:, k, 0] == 0
        a = truth.areas[behind] / truth.areas[behind].sum()
        there = float(a @ indirect[behind, k].mean(axis=1))
        ours = float(a @ light.irradiance[behind].mean(axis=1))
        least = 1e-3 * float((direct[:, k] + indirect[:, k]).mean())
        signed.append(float((ours - there) / max(there, least)))
        shares.append(signed[-1] <= 0.01)
    return {"lamps": len(places), "within_a_hundredth": int(sum(shares)), "excess": spread(signed),
            "least": min(signed)}  # fmt: skip


def at_equal_error(
    light: CloudRelighter, scene: Scene, places: np.ndarray, areas: np.ndarray
) -> dict[str, Any]:
    """Seconds of a move, and of the path tracer at every vertex with as many paths as err as much.

    The cloud's own error is that at some vertices beside many paths, their noise taken off; the path tracer's is its
    noise, where it is no less than that of the many paths. What Mitsuba compiles and what it builds of a scene is not
    counted: each trace is timed when run again.
    """
    chance, quotients, told = np.random.default_rng(1), [], []
    count = len(scene.positions)
    chosen = np.sort(chance.choice(count, min(RECEIVERS, count), replace=False)).astype(np.int32)
    plain, a, all_of_it = as_diffuse(scene), areas[chosen].astype(np.float64)[:, None], np.arange(count)
    surfaces = SurfaceScene(plain)
    light.shine([point(between(scene, light.layer, 1, seed=9)[0])])  # kernels are loaded
    for at in places:
        lit = LitScene(plain, lamps=spheres(at[None]), surfaces=surfaces)
        true = lit.light(chosen, origins=light.layer.origins, samples=SAMPLES)
        began = time.perf_counter()
        light.shine([point(at)])  # once: a relighter remembers lamps it has met
        took = time.perf_counter() - began
        noise = (a * true.total_variance).sum()
        off_by = (a * np.square(light.irradiance[chosen] - true.total)).sum() - noise
        samples = max(2, round(SAMPLES * float(noise / max(off_by, noise))))
        traced = []
        for _ in range(2):  # the first compiles
            began = time.perf_counter()
            lit.light(all_of_it.astype(np.int32), origins=light.layer.origins, samples=samples)
            traced.append(time.perf_counter() - began)
        quotients.append(traced[-1] / took)
        told.append((samples, traced[-1], took))
    samples, reference, ours = (float(np.median(column)) for column in zip(*told, strict=True))
    return {
        "lamps": len(places), "vertices": count, "quotient": {**spread(quotients), "least": min(quotients)},
        "samples": samples, "reference_seconds": reference, "seconds_a_move": ours,
    }  # fmt: skip
