"""What a shell costs, by the triangles outside."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import worlds

from prelight.lighting.outside import OutsideObject
from prelight.lighting.outside import Path as Way
from prelight.relighting.shells import Shells

_REPEATS = 11
_WINDOWS = np.array([(x, 1.2, z) for x in (-0.75, 0.75) for z in (-0.6, 0.4, 1.2)])  # of a car


def run(data: Path, work: Path) -> dict:
    """Seconds to open a world, and milliseconds for one shell and for a car's six, 6·32² texels of 2×2 samples."""
    scenes = {
        "stock:town": ("stock:town", (21.8, 0.0, 50.0), 1.0),
        "city block": (str(data / "city" / "city_block_assembled.glb"), (0.0, 0.4, 0.0), 10.0),
        "large town": (worlds.large_town(work), (21.8, 0.0, 50.0), 1.0),
    }
    return {name: _measured(*given) for name, given in scenes.items()}


def _measured(scene: str, place: tuple[float, float, float], scale: float) -> dict:
    x, y, z = place
    way = Way((0.0, 10.0), (place, (x, y, z - 30.0)))
    passing = Way((0.0, 10.0), ((x - 3.6, y, z - 40.0), (x - 3.6, y, z + 20.0)))
    rig = worlds.rig_of(
        scene, scale=scale, room=way, objects=(OutsideObject("stock:car-small", passing, name="oncoming"),)
    )
    tiny = np.array([(0, 1, 0), (0.01, 1, 0), (0, 1.01, 0)], np.float32)
    live = Shells(tiny, np.array([(0, 1, 2)], np.int32))
    started = time.perf_counter()
    live.light(rig)
    opened = time.perf_counter() - started
    live.shells_of(_WINDOWS, 32)
    one, six, move = [], [], []
    for seconds in np.linspace(0.5, 9.5, _REPEATS).tolist():
        started = time.perf_counter()
        live.light(rig.at(seconds))
        move.append(time.perf_counter() - started)
        started = time.perf_counter()
        shell = live.shell_of((0.0, 1.2, 0.0), 32)
        one.append(time.perf_counter() - started)
        started = time.perf_counter()
        live.shells_of(_WINDOWS, 32)
        six.append(time.perf_counter() - started)
    return {
        "triangles": live.triangles,
        "seconds_to_open": round(opened, 2),
        "ms_to_move": round(1e3 * float(np.median(move)), 2),
        "ms_a_shell": round(1e3 * float(np.median(one)), 1),
        "ms_a_shell_worst": round(1e3 * max(one), 1),
        "ms_six_shells": round(1e3 * float(np.median(six)), 1),
        "mean_radiance": round(float(shell.mean()), 4),
    }
