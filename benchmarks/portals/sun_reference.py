"""The sun's bounced light in a small chapel: by ``path`` alone, and with what the sun shines on as lamps."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
from sibenik_day import parts_of, skies
from sunlit import Sun, sunlit

from prelight.baking.portals_room import PortalsRoom
from prelight.baking.portals_settings import PortalsSettings
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene
from prelight.transport.path_traced_light import LitScene, as_diffuse

HOUR, RECEIVERS = 6, 300
DARK = 0.01  # of the mean: noise of what has less is not known well enough to be compared with
WARM, PLAIN, LAMPS = 64, 16384, 4096  # paths of a receiver: before the clock starts, and in it


def sun_reference(_data: Path, _work: Path) -> dict[str, Any]:
    """Noise a processor second of both references of the sun's bounced light, and whether they agree."""
    room = PortalsRoom(load_scene("stock:portals-small"), PortalsSettings())
    scene = as_diffuse(room.open)
    chosen, (_, cube) = _indoors(scene), parts_of(skies()[HOUR])
    began = time.process_time()
    shining, cells = sunlit(scene, room._glass, Sun.of(cube))
    out: dict[str, Any] = {"cells": cells, "prepared_seconds": time.process_time() - began}
    found = {}
    for name, lit, samples in (("plain", LitScene(scene, sky=cube), PLAIN), ("lamps", shining, LAMPS)):
        lit.light(chosen, origins=room.origins, samples=WARM)
        began = time.process_time()
        light = lit.light(chosen, origins=room.origins, samples=samples, seed=1)
        seconds = time.process_time() - began
        mean, variance = (
            (light.indirect, light.indirect_variance)
            if name == "plain"
            else (light.total, light.total_variance)
        )
        noise = float(np.sqrt(variance).mean()) * math.sqrt(2 / math.pi) / float(mean.mean())
        out[name] = {
            "samples": samples, "mean": float(mean.mean()), "noise": noise, "seconds": seconds,
            "noise_squared_seconds": noise**2 * seconds,
        }  # fmt: skip
        found[name] = mean[:, 1], variance[:, 1]
    (a, va), (b, vb) = found["plain"], found["lamps"]
    out["deviation"] = float((b - a).mean() / a.mean())
    out["deviation_noise"] = float(np.sqrt((va + vb).sum()) / a.sum())
    lit = np.maximum(a, b) > DARK * a.mean()
    out["rms_z"] = float(np.sqrt(np.square((b - a)[lit] / np.sqrt(va + vb)[lit]).mean()))
    return out


def _indoors(scene: Scene) -> np.ndarray:
    """Vertices between the chapel's walls, by the area around them."""
    p = scene.positions
    inside = (np.abs(scene.normals).sum(axis=1) > 0) & (np.abs(p[:, 0]) < 4.4) & (np.abs(p[:, 2]) < 7.7)
    inside &= (p[:, 1] < 4.5) & (p[:, 1] > -0.1)
    a, b, c = np.moveaxis(p[scene.triangles].astype(np.float64), 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    around = np.bincount(scene.triangles.ravel(), np.repeat(area, 3), minlength=len(p)) * inside
    rng = np.random.default_rng(2)
    return np.sort(rng.choice(len(p), RECEIVERS, replace=False, p=around / around.sum())).astype(np.int32)
