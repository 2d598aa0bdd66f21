"""Sixteen hours of a day in Sibenik at 1,000 receivers, against the path tracer under the same sky and the real sun.

The bake and every hour of the reference are kept in the work folder, so that what was stopped goes on.
"""

from __future__ import annotations

import math
import time
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
from measuring import baked, chosen_receivers
from openings import openings_of

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

HOURS, SAMPLES, CHUNK = 16, 4096, 1024
SUN_RESOLUTION = 512  # of the reference's sky: the sun is three texels wide
MEANS = ("direct", "indirect")
VARIANCES = ("direct_variance", "indirect_variance", "total_variance")
FILE = str(rooms.HERE / "sibenik.toml")
# All portals clear: what stained glass does is a factor for each, which the path tracer's open windows have not.
CLEAR = (Glass("*", tint=(1.0, 1.0, 1.0)),)


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


def reference(room: PortalsRoom, chosen: np.ndarray, hour: int, *, work: Path) -> dict[str, np.ndarray]:
    """Direct and indirect light of an hour, and their variances; kept chunk after chunk."""
    parts = []
    for k in range(SAMPLES // CHUNK):
        kept = work / f"hour-{hour}-{k}.npz"
        if not kept.exists():
            cube = skies()[hour].cube(SUN_RESOLUTION)
            sky = opening_emitter(mitsuba(), cube, openings_of(room.portals.corners))
            lit = LitScene(as_diffuse(room.open), emitters=[sky])
            found = lit.light(chosen, origins=room.origins, samples=CHUNK, seed=1000 * k + 17 * hour)
            np.savez(kept, chosen=chosen, **{name: getattr(found, name) for name in (*MEANS, *VARIANCES)})
        with np.load(kept) as file:
            parts.append(dict(file))
    out = {name: np.mean([part[name] for part in parts], axis=0) for name in MEANS}
    out |= {name: np.mean([part[name] for part in parts], axis=0) / len(parts) for name in VARIANCES}
    return out | {"chosen": parts[0]["chosen"]}


def compared(light: PortalsRelighter, chosen: np.ndarray, hour: int, truth: dict) -> dict[str, float]:
    """Mean |difference| over the mean, direct and bounced apart, and how much of each is the reference's noise."""
    assert (truth["chosen"] == chosen).all()
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
    light, room, chosen = opened(data, work, rays=rays, gather_rays=gather_rays)
    hours, sums = [], np.zeros((2, len(chosen), 3))
    for hour in range(HOURS):
        truth = reference(room, chosen, hour, work=work)
        hours.append(compared(light, chosen, hour, truth))
        sums += [light.irradiance[chosen], truth["direct"] + truth["indirect"]]
    each = [hour["total_difference"] for hour in hours]
    noise = [hour["total_noise"] for hour in hours]
    return {
        "receivers": len(chosen), "samples": SAMPLES, "rays": rays, "gather_rays": gather_rays, "hours": hours,
        "mean_of_hours": float(np.mean(each)), "noise_of_hours": float(np.mean(noise)),
        "worst_hour": max(each), "day_together": float(np.abs(sums[0] - sums[1]).mean() / sums[1].mean()),
        "day_signed": float((sums[0] - sums[1]).mean() / sums[1].mean()),
    }  # fmt: skip
