"""Section 6.2 and figure 7(a): lights added to an environment, brightened and moved; one small light alone."""

from __future__ import annotations

import statistics
import time
from pathlib import Path

import numpy as np

import prelight as pl
from prelight.lighting.disc import Disc
from prelight.transport.exact import integrate_exactly
from scenes import baked, maps, relative, scan

STEPS = TURNS = 120  # of brightening, of moving
ELEVATION = np.radians(35.0)


def radius_deg(share_of_face: float) -> float:
    """A disc whose radius is this share of a face's side, seen in the middle of the face."""
    return float(np.degrees(np.arctan(2 * share_of_face)))


def direction(azimuth_deg: float) -> tuple[float, float, float]:
    a = np.radians(azimuth_deg)
    return (
        float(np.sin(a) * np.cos(ELEVATION)), float(np.sin(ELEVATION)), float(-np.cos(a) * np.cos(ELEVATION))
    )  # fmt: skip


def two_discs(data: Path, work: Path) -> dict:
    """Two discs of 5 % and 10 % radius over the beach, brightening, then moving: local against full.

    Full, as the paper's section 5.1 counts it: from an environment map (turned by half a degree each time, so that
    nothing is known of it) to cube, clusters and radiance. Full from a cube map: the same once the map is in the cube.
    Local: from the assignment of the changed discs to the radiance. Both discs change in each step; they move by
    0.75° a step, 90° in four seconds at 30 steps a second. In turn, in one run.
    """
    result = {}
    for R in (256, 1024):
        found, _ = baked(scan(data, "bunny"), work / f"bunny-{R}-5e-5.prelight", resolution=R, epsilon=5e-5)
        result[f"R={R}"] = _two_discs(found, pl.Environment.open(maps(data)["beach"]), R)
    return result


def _two_discs(found: pl.Bake, beach: pl.Environment, R: int) -> dict:
    light, other = pl.Relighter(found), pl.Relighter(found)
    light.environment = beach
    cube, live = beach.cube(R), other._live
    live.set_cube(cube)
    phases: dict[str, list[float]] = {"brightening": [], "moving": []}
    from_map, from_cube, clusters = [], [], []
    for step in range(STEPS + TURNS):
        share = min(1.0, (step + 1) / STEPS)
        turn = max(0, step - STEPS) * 90.0 / TURNS
        red = Disc(direction(90 + turn), radius_deg(0.05), (20 * share, 2 * share, 2 * share))
        green = Disc(direction(0 - turn), radius_deg(0.10), (share, 6 * share, share))
        started = time.perf_counter()
        light.environment = beach.with_discs([red, green])
        phases["brightening" if step < STEPS else "moving"].append(time.perf_counter() - started)
        clusters.append(light.last.clusters)
        if step % 8 == 7:
            cube *= np.float32(1.02 if step % 16 == 7 else 1 / 1.02)
            started = time.perf_counter()
            live.set_cube(cube)
            from_cube.append(time.perf_counter() - started)
            started = time.perf_counter()
            other.environment = beach.rotated(0.5 * step)
            from_map.append(time.perf_counter() - started)
    local = statistics.fmean(phases["brightening"] + phases["moving"])
    drift = light.radiance
    light.refresh()
    return {
        "full_from_map_milliseconds": statistics.fmean(from_map) * 1e3,
        "full_from_cube_milliseconds": statistics.fmean(from_cube) * 1e3,
        "local_milliseconds": local * 1e3,
        "local_milliseconds_by_phase": {k: statistics.fmean(v) * 1e3 for k, v in phases.items()},
        "full_from_map_over_local": statistics.fmean(from_map) / local,
        "full_from_cube_over_local": statistics.fmean(from_cube) / local,
        "full_from_cube_over_local_by_phase": {
            k: statistics.fmean(from_cube) / statistics.fmean(v) for k, v in phases.items()
        },
        "clusters_a_change": statistics.fmean(clusters),
        "paper": {"local_milliseconds": 60, "full_milliseconds": 6500, "full_over_local": 100},
        "largest_difference_to_fresh": float(np.abs(drift - light.radiance).max() / light.radiance.max()),
    }


def small_light(data: Path, work: Path) -> dict:
    """Figure 7(a): one small light at the upper left; its hard shadow against exact integration, and a picture."""
    R = 1024
    found, _ = baked(scan(data, "bunny"), work / "bunny-1024-5e-5.prelight", resolution=R, epsilon=5e-5)
    light = pl.Relighter(found)
    lamp = Disc((-0.55, 0.75, 0.35), 0.6, (9000.0, 8600.0, 8000.0))
    sky = pl.Environment.constant((0.02, 0.02, 0.025)).with_disc(lamp)
    light.environment = sky
    chosen = np.sort(np.random.default_rng(3).choice(len(found.receivers), 1000, replace=False))
    only = np.zeros((6, R, R, 3), np.float32)
    for part in lamp.texels(R):
        only[part.face, part.rows, part.columns] += part.radiance
    receivers = found.receivers
    true = integrate_exactly(
        receivers.positions, found.triangles, receivers.normals, receivers=chosen, cube=only
    ) * receivers.albedo[chosen]  # fmt: skip
    figures = {}
    for traced in (True, False):
        light.trace_strong = traced
        light.environment = pl.Environment.constant((0.0, 0.0, 0.0)).with_disc(lamp)
        figures["traced" if traced else "clusters alone"] = relative(light.radiance[chosen], true)
    light.trace_strong = True
    light.environment = sky
    picture = light.picture(width=1280, height=720)
    picture.save(work / "small-light.png", force=True, exposure=picture.stops("auto"))
    return figures | {"light_radius_deg": 0.6, "picture": "small-light.png in the work folder"}
