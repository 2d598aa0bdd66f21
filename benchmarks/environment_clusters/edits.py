"""Section 6.2 and figure 7(a): lights added to an environment, brightened and moved; one small light alone."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import prelight as pl
from prelight.lighting.disc import Disc
from prelight.transport.exact import integrate_exactly
from scenes import baked, maps, relative, scan

STEPS = TURNS = 120  # of brightening, of moving
WALKS = 5  # through all of them
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
    nothing is known of it) to cube and clusters and their sums. Full from a cube map: the same once the map is in the
    cube. Local: from the assignment of the changed discs. Sums are in storage order; to write them out as the radiance
    of every vertex is the same work after all of them, and given apart, with the ratio that it leaves. Both discs
    change in each step; they move by 0.75° a step, 90° in four seconds at 30 steps a second. Five walks through all
    steps, of each step the median.
    """
    result = {}
    for R in (256, 1024):
        found, _ = baked(scan(data, "bunny"), work / f"bunny-{R}-5e-5.prelight", resolution=R, epsilon=5e-5)
        result[f"R={R}"] = _two_discs(found, pl.Environment.open(maps(data)["beach"]), R)
    return result


def _seconds(act: Callable[[], object]) -> float:
    started = time.perf_counter()
    act()
    return time.perf_counter() - started


def _two_discs(found: pl.Bake, beach: pl.Environment, R: int) -> dict:
    light, other = pl.Relighter(found), pl.Relighter(found)
    light.environment = beach
    cube, live = beach.cube(R), other._live
    live.set_cube(cube)
    local, written, clusters = np.empty((WALKS, STEPS + TURNS)), np.empty((WALKS, STEPS + TURNS)), []
    from_map, from_cube = [], []
    for walk in range(WALKS):
        for step in range(STEPS + TURNS):
            share = min(1.0, (step + 1) / STEPS)
            turn = max(0, step - STEPS + 1) * 90.0 / TURNS
            red = Disc(direction(90 + turn), radius_deg(0.05), (20 * share, 2 * share, 2 * share))
            green = Disc(direction(0 - turn), radius_deg(0.10), (share, 6 * share, share))

            def assign(red: Disc = red, green: Disc = green) -> None:
                light.environment = beach.with_discs([red, green])

            local[walk, step] = _seconds(assign)
            clusters.append(light.last.clusters)
            written[walk, step] = _seconds(lambda: light.radiance)
            if step % 16 == 7:
                cube *= np.float32(1.02 if step % 32 == 7 else 1 / 1.02)
                from_cube.append(_seconds(lambda cube=cube: live.set_cube(cube)))
            if step % 48 == 7:
                turned = beach.rotated(0.5 * (step + 1) + 0.1 * walk)
                from_map.append(_seconds(lambda turned=turned: setattr(other, "environment", turned)))
    drift = light.radiance
    light.refresh()
    steps = np.median(local, axis=0) * 1e3
    full, of_map = statistics.median(from_cube) * 1e3, statistics.median(from_map) * 1e3
    out = float(np.median(written)) * 1e3
    phases = {"brightening": float(steps[:STEPS].mean()), "moving": float(steps[STEPS:].mean())}
    mean = float(steps.mean())
    return {
        "full_from_map_milliseconds": of_map,
        "full_from_cube_milliseconds": full,
        "local_milliseconds": mean,
        "local_milliseconds_by_phase": phases,
        "full_from_map_over_local": of_map / mean,
        "full_from_cube_over_local": full / mean,
        "full_from_cube_over_local_by_phase": {phase: full / each for phase, each in phases.items()},
        "written_out_milliseconds": out,
        "full_from_map_over_local_written_out": (of_map + out) / (mean + out),
        "full_from_cube_over_local_written_out": (full + out) / (mean + out),
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
