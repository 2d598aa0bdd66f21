"""Bake the paper's Bunny and hold it against the paper, bare rays, bare memory and exact integration."""

from __future__ import annotations

import argparse
import json
import platform
import resource
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numba import njit, prange

import prelight as pl
from prelight.baking.environment import bake_planned
from prelight.baking.environment_plan import EnvironmentSettings, plan_environment
from prelight.bases.cube_map import texel_directions
from prelight.checking.machine import llvm, machine, read_bandwidth
from prelight.errors import InputError
from prelight.rays.mitsuba import Occluders
from prelight.rays.offset import ray_offset
from prelight.relighting.environment import EnvironmentRelighter
from prelight.relighting.layer import EnvironmentLayer
from prelight.transport.exact import integrate_exactly
from prelight.transport.ordering import receiver_order
from prelight.transport.visibility import Visibility

PROBES = ("grace_cross.hdr", "galileo_cross.hdr", "uffizi_latlong.hdr")
PAPER = {"clusters": 8832, "bytes": 405e6, "clusters_of_bytes": 9831}


def in_turn(first: Callable[[], float], second: Callable[[], float], repeats: int) -> dict:
    """Seconds of both, one after the other, and the median of their ratios."""
    first(), second()
    pairs = [(first(), second()) for _ in range(repeats)]
    return {
        "ours_seconds": statistics.median(a for a, _ in pairs),
        "rival_seconds": statistics.median(b for _, b in pairs),
        "rival_over_ours": statistics.median(b / a for a, b in pairs),
        "spread": [min(b / a for a, b in pairs), max(b / a for a, b in pairs)],
    }


def timed(act: Callable[[], object]) -> Callable[[], float]:
    def run() -> float:
        started = time.perf_counter()
        act()
        return time.perf_counter() - started

    return run


def mean_of(act: Callable[[], float], count: int) -> Callable[[], float]:
    return lambda: statistics.fmean(act() for _ in range(count))


def bake(scene: pl.Scene, work: Path) -> tuple[pl.Bake, dict]:
    settings = EnvironmentSettings(resolution=256, epsilon=5e-5)
    path = work / "bunny.prelight"
    plan = plan_environment(scene, settings)
    try:
        found = pl.Bake.open(path)
    except InputError:
        found = bake_planned(
            scene,
            path,
            plan=plan,
            resume=True,
            report=lambda f, s, c: print(f"\r{f:.0%} {s:.0f} s {c}", end=""),
        )
        print()
    layer = found.layers["environment"]
    allowed = PAPER["bytes"] * layer.coefficients / PAPER["clusters_of_bytes"]
    kept = found.manifest.bytes_of("layers/")
    seconds = found.seconds
    figures = {
        "receivers": len(found.receivers),
        "clusters": layer.coefficients,
        "clusters_over_paper": layer.coefficients / PAPER["clusters"],
        "bytes": kept,
        "bytes_over_paper_scaled": kept / allowed,
        "rays": layer.rays,
        "seconds": seconds,
        "peak_memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024,
        "plan_over_bake": {
            "clusters": plan.clusters / layer.coefficients,
            "rays": plan.rays / layer.rays,
            "bytes": plan.bytes / found.manifest.bytes_of(""),
            "seconds": plan.seconds / seconds if seconds else None,
            "memory": plan.memory / (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024),
        },
    }
    return found, figures


def tracing(scene: pl.Scene, repeats: int) -> dict:
    """Our tile of visibility against ``ray_test`` with its rays laid out in memory beforehand."""
    import drjit as dr

    order = receiver_order(scene.positions, scene.normals)
    origins, normals = scene.positions[order], scene.normals[order]
    occluders = Occluders(scene.positions, scene.triangles)
    ours = Visibility(occluders, origins=origins, normals=normals)
    mi, bvh = occluders.mi, occluders.scene
    rng = np.random.default_rng(0)
    d = texel_directions(np.sort(rng.choice(6 * 256**2, 150, replace=False)), 256)
    lifted = origins + np.float32(ray_offset(scene.positions)) * normals
    o_all = [mi.Float(np.tile(x, len(d))) for x in lifted.T]
    d_all = [mi.Float(np.repeat(x, len(origins))) for x in d.T]
    facing = mi.Bool((d @ normals.T > 0).ravel())
    ray = mi.Ray3f(mi.Point3f(*o_all), mi.Vector3f(*d_all))
    dr.eval(ray, facing)

    def bare() -> None:
        dr.eval(bvh.ray_test(ray, active=facing))
        dr.sync_thread()

    result = in_turn(timed(lambda: ours.trace(d)), timed(bare), repeats)
    return result | {"vertex_directions_per_second": len(d) * len(origins) / result["ours_seconds"]}


@njit(parallel=True, fastmath=True)
def dense_product(T, l, out):
    """The rival: (R, M) bytes times (3, M), four rows at a time."""
    for q in prange(T.shape[0] // 4):
        a, b, c, d = T[4 * q], T[4 * q + 1], T[4 * q + 2], T[4 * q + 3]
        r, g, u = l[0], l[1], l[2]
        s00 = s01 = s02 = s10 = s11 = s12 = s20 = s21 = s22 = s30 = s31 = s32 = np.float32(0)
        for k in range(T.shape[1]):
            x, y, z, w = np.float32(a[k]), np.float32(b[k]), np.float32(c[k]), np.float32(d[k])
            s00 += x * r[k]
            s01 += x * g[k]
            s02 += x * u[k]
            s10 += y * r[k]
            s11 += y * g[k]
            s12 += y * u[k]
            s20 += z * r[k]
            s21 += z * g[k]
            s22 += z * u[k]
            s30 += w * r[k]
            s31 += w * g[k]
            s32 += w * u[k]
        out[4 * q, 0], out[4 * q, 1], out[4 * q, 2] = s00, s01, s02
        out[4 * q + 1, 0], out[4 * q + 1, 1], out[4 * q + 1, 2] = s10, s11, s12
        out[4 * q + 2, 0], out[4 * q + 2, 1], out[4 * q + 2, 2] = s20, s21, s22
        out[4 * q + 3, 0], out[4 * q + 3, 1], out[4 * q + 3, 2] = s30, s31, s32


def relighting(found: pl.Bake, cube: np.ndarray, repeats: int) -> dict:
    layer = EnvironmentLayer(found)
    live = EnvironmentRelighter(layer, found.receivers.albedo)
    live.set_cube(cube)
    R, M = layer.rows // 4 * 4, len(layer.rectangles)
    rng = np.random.default_rng(0)
    T = rng.integers(0, 255, (R, M), dtype=np.uint8)
    l, out = rng.random((3, M), dtype=np.float32), np.empty((R, 3), np.float32)
    full = in_turn(timed(live.refresh), timed(lambda: dense_product(T, l, out)), repeats)
    del T
    bandwidth = read_bandwidth()
    full |= {
        "milliseconds": full["ours_seconds"] * 1e3,
        "bytes_per_second": layer.bytes / full["ours_seconds"],
        "read_bandwidth": bandwidth,
        "share_of_bandwidth": layer.bytes / full["ours_seconds"] / bandwidth,
    }

    # 50 clusters beside each other, as a light that changes is, and 50 anywhere; right after a full relight, which
    # leaves nothing of the sums in the caches, and one after another, as when a light is dragged.
    def changing(clusters: np.ndarray) -> Callable[[], float]:
        change = rng.random((len(clusters), 3)) * 1e-3
        nodes = np.sort(live._tree._node_of[clusters])  # of one zone: every cluster is a node

        def run() -> float:
            started = time.perf_counter()
            live._follow(nodes, change, started)
            return time.perf_counter() - started

        return run

    local = {}
    for name, clusters in {
        "together": np.arange(M // 2, M // 2 + 50),
        "scattered": np.sort(rng.choice(M, 50, replace=False)),
    }.items():
        act = changing(clusters)
        for when, once in {"after_a_full_one": act, "one_after_another": mean_of(act, 10)}.items():
            pairs = in_turn(once, timed(live.refresh), repeats)
            local[f"{name}_{when}"] = {
                "milliseconds": pairs["ours_seconds"] * 1e3,
                "full_over_local": pairs["rival_over_ours"],
            }
    return {"full": full, "local_50_clusters": local}


def accuracy(found: pl.Bake, probes: Path) -> dict:
    receivers = found.receivers
    chosen = np.sort(np.random.default_rng(7).choice(len(receivers), 1000, replace=False))
    cubes = [pl.Environment.open(probes / name).cube(256) for name in PROBES]
    exact = integrate_exactly(
        receivers.positions,
        found.triangles,
        receivers.normals,
        receivers=chosen,
        cube=np.concatenate(cubes, axis=-1),
    )
    live = EnvironmentRelighter(EnvironmentLayer(found), np.ones_like(receivers.albedo))
    errors = {}
    for k, (name, cube) in enumerate(zip(PROBES, cubes, strict=True)):
        live.set_cube(cube)
        ours, true = live.radiance[chosen], exact[:, 3 * k : 3 * k + 3]
        errors[name] = {
            "relative_rms": float(np.sqrt(((ours - true) ** 2).sum() / (true**2).sum())),
            "signed_mean": float((ours - true).sum() / true.sum()),
            "worst": float(np.abs(ours - true).max() / true.max()),
        }
    return errors


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bunny", type=Path)
    parser.add_argument("probes", type=Path)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--repeats", type=int, default=15)
    parser.add_argument("--name", default="2-core")
    options = parser.parse_intermixed_args()
    options.work.mkdir(parents=True, exist_ok=True)

    scene = pl.load_scene(options.bunny, floor=3)
    found, figures = bake(scene, options.work)
    grace = pl.Environment.open(options.probes / PROBES[0]).cube(256)
    results = {
        "machine": machine() | {"python": platform.python_version()} | llvm(),
        "bake": figures,
        "tracing": tracing(scene, options.repeats),
        "relighting": relighting(found, grace, options.repeats),
        "against_exact_integration": accuracy(found, options.probes),
    }
    results["machine"].pop("python")
    results["machine"].pop("llvm_path")
    target = Path(__file__).parent / "results" / f"{options.name}.json"
    target.write_text(json.dumps(results, indent=1) + "\n")
    print(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
