"""Sixteen hours of a day in Sibenik at 1,000 receivers, against the path tracer under the same sky and the real sun.

The bake and every chunk of the reference are kept in the work folder, so that what was stopped goes on. The sun's
bounced light is that of the surfaces it shines on (``sunlit``), all else by ``path`` and windows that are looked for.
"""

from __future__ import annotations

import math
import time
from datetime import datetime, timedelta, timezone
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from measuring import baked, chosen_receivers
from openings import openings_of
from sunlit import Sun, sunlit

import rooms
from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.lighting.daylight import Daylight
from prelight.lighting.environment import Environment
from prelight.lighting.glass import Glass
from prelight.lighting.moment import Site
from prelight.lighting.rig import Rig
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.portals import PortalWish
from prelight.scene.variant import mitsuba
from prelight.transport.opening_emitter import opening_emitter
from prelight.transport.path_traced_light import LitScene, as_diffuse

HOURS = 16
CHUNKS = {"sky": 10, "sun": 4}  # of an hour's sky, and of its sun
CHUNK = 4096  # paths of a receiver
MINUTES = math.inf  # to trace for; then what there is is told
SUN_RESOLUTION = 512  # of the reference's sky: the sun is three texels wide
MEANS = ("direct", "indirect")
VARIANCES = ("direct_variance", "indirect_variance", "total_variance")
FILE = str(rooms.HERE / "sibenik.toml")
# All portals clear: what stained glass does is a factor for each, which the path tracer's open windows have not.
CLEAR = (Glass("*", tint=(1.0, 1.0, 1.0)),)


@cache
def skies() -> list[Environment]:
    """Every hour from half past four on the longest day, summer time: the sun is up in fifteen of them."""
    first = datetime(2026, 6, 21, 4, 30, tzinfo=timezone(timedelta(hours=2)))
    return [Daylight(Site(43.7, 15.9), first + timedelta(hours=k)).environment() for k in range(HOURS)]


def opened(
    data: Path, work: Path, *, rays: int, gather_rays: int
) -> tuple[PortalsRelighter, PortalsRoom, np.ndarray]:
    """The bake (made if it is not there), its room, and the receivers."""
    scene = rooms.sibenik(data, subdivide=0.8)
    settings = PortalsSettings(PortalWish(file=FILE), rays=rays, gather_rays=gather_rays)
    path = work / f"sibenik-{rays}-{gather_rays}.prelight"
    light, room, _ = baked(scene, path, settings, keep=True)
    light.light(Rig(Environment.constant((1.0, 1.0, 1.0)), portals=CLEAR))
    return light, room, chosen_receivers(room, light).astype(np.int32)


def reference(chosen: np.ndarray, hour: int, *, work: Path) -> dict[str, np.ndarray] | None:
    """Direct and indirect light of an hour and their variances, of the chunks there are; None without any of a kind."""
    out: dict[str, np.ndarray] = {}
    for name in _kinds(hour):
        parts = [dict(np.load(path)) for path in sorted(work.glob(f"hour-{hour}-{name}-*[0-9].npz"))]
        if not parts:
            return None
        if any((part["chosen"] != chosen).any() for part in parts):
            raise ValueError(f"hour-{hour}-{name}-*.npz in {work} are of other receivers: move them away")
        for n in (*MEANS, *VARIANCES):
            share = len(parts) if n in VARIANCES else 1
            out[n] = out.get(n, 0) + np.mean([part[n] for part in parts], axis=0) / share
    return out


def trace(room: PortalsRoom, chosen: np.ndarray, *, work: Path, until: float) -> None:
    """Make the chunks that are missing, the first of all hours first; none is begun after ``until``."""
    for k in range(max(CHUNKS.values())):
        for hour in range(HOURS):
            for name, cube in _kinds(hour).items():
                kept = work / f"hour-{hour}-{name}-{k}.npz"
                if k >= CHUNKS[name] or kept.exists():
                    continue
                if time.monotonic() > until:
                    return
                lit = _lit(room, name, cube)
                light = _light(lit, chosen, room.origins, seed=100_000 * k + 17 * hour)
                np.savez(kept.with_suffix(".tmp.npz"), chosen=chosen, **light)
                kept.with_suffix(".tmp.npz").rename(kept)


def _kinds(hour: int) -> dict[str, np.ndarray]:
    """The cube maps of an hour, of its sky and its sun; those that have light."""
    found = zip(CHUNKS, parts_of(skies()[hour]), strict=True)
    return {name: cube for name, cube in found if cube.any()}


def parts_of(environment: Environment) -> tuple[np.ndarray, np.ndarray]:
    """The sky's cube map, and that of the sun alone."""
    sky = environment.with_discs(()).cube(SUN_RESOLUTION)
    return sky, environment.cube(SUN_RESOLUTION) - sky


def _lit(room: PortalsRoom, name: str, cube: np.ndarray) -> list[LitScene]:
    """What brings an hour's light: the sky through the openings; the sun itself, and what it shines on."""
    scene = as_diffuse(room.open)
    if name == "sky":
        return [
            LitScene(scene, emitters=[opening_emitter(mitsuba(), cube, openings_of(room.portals.corners))])
        ]
    return [LitScene(scene, sky=cube), sunlit(scene, room._glass, Sun.of(cube))[0]]


def _light(
    lit: list[LitScene], chosen: np.ndarray, origins: np.ndarray, *, seed: int
) -> dict[str, np.ndarray]:
    """``CHUNK`` paths of each receiver: direct and indirect light, and variances."""
    if len(lit) == 1:
        found = lit[0].light(chosen, origins=origins, samples=CHUNK, seed=seed)
        return {name: getattr(found, name) for name in (*MEANS, *VARIANCES)}
    direct = lit[0].light(chosen, origins=origins, samples=CHUNK, bounces=0, seed=seed)
    bounced = lit[1].light(chosen, origins=origins, samples=CHUNK, seed=seed)
    return {
        "direct": direct.direct, "direct_variance": direct.direct_variance,
        "indirect": bounced.total, "indirect_variance": bounced.total_variance,
        "total_variance": direct.direct_variance + bounced.total_variance,
    }  # fmt: skip


def compared(light: PortalsRelighter, chosen: np.ndarray, hour: int, truth: dict) -> dict[str, float]:
    """Mean |difference| over the mean, direct and bounced apart, and how much of each is the reference's noise."""
    started = time.perf_counter()
    light.light(Rig(skies()[hour], portals=CLEAR))
    seconds = time.perf_counter() - started
    whole, direct = light.irradiance[chosen], light.direct[chosen]
    total = truth["direct"] + truth["indirect"]
    mean = float(total.mean())
    out = {"mean": mean, "relight_seconds": seconds}
    for name, ours, known in (
        ("direct", direct, truth["direct"]), ("indirect", whole - direct, truth["indirect"]), ("total", whole, total),
    ):  # fmt: skip
        noise = np.sqrt(truth[f"{name}_variance"])
        error = ours - known
        square = float(np.mean(error**2) - np.mean(noise**2))
        out |= {
            f"{name}_difference": float(np.abs(error).mean()) / mean,
            f"{name}_noise": float(noise.mean()) * math.sqrt(2 / math.pi) / mean,
            f"{name}_signed": float(error.mean()) / mean,
            f"{name}_rms_without_noise": math.copysign(math.sqrt(abs(square)), square) / mean,
        }  # fmt: skip
    return out


def sibenik_day(data: Path, work: Path, *, rays: int = 2048, gather_rays: int = 1024) -> dict[str, Any]:
    """Sixteen hours of a day in Sibenik at 1,000 receivers, against the path tracer."""
    until = time.monotonic() + 60 * MINUTES
    light, room, chosen = opened(data, work, rays=rays, gather_rays=gather_rays)
    trace(room, chosen, work=work, until=until)
    hours, sums = {}, np.zeros((2, len(chosen), 3))
    for hour in range(HOURS):
        truth = reference(chosen, hour, work=work)
        if truth is not None:
            hours[hour] = compared(light, chosen, hour, truth)
            sums += [light.irradiance[chosen], truth["direct"] + truth["indirect"]]
    each = [hour["total_difference"] for hour in hours.values()]
    noise = [hour["total_noise"] for hour in hours.values()]
    chunks = {name: len(list(work.glob(f"hour-*-{name}-*[0-9].npz"))) for name in CHUNKS}
    return {
        "receivers": len(chosen), "paths_of_a_chunk": CHUNK, "chunks": chunks, "rays": rays,
        "gather_rays": gather_rays, "hours": hours,
        "mean_of_hours": float(np.mean(each)), "noise_of_hours": float(np.mean(noise)),
        "worst_hour": max(each), "day_together": float(np.abs(sums[0] - sums[1]).mean() / sums[1].mean()),
        "day_signed": float((sums[0] - sums[1]).mean() / sums[1].mean()),
    }  # fmt: skip
