"""A frame of a moving world: capture and relight together."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import worlds

from prelight.lighting.outside import OutsideObject
from prelight.lighting.outside import Path as Way
from prelight.relighting.portals import PortalsRelighter
from prelight.relighting.shells import Shells
from prelight.storage.bake import Bake

_REPEATS = 15


def run(data: Path, work: Path) -> dict:
    """Milliseconds for one shell of 50,000 triangles and the light of 100,000 vertices; with all shells too."""
    bake = Bake.open(_baked(work))
    live = PortalsRelighter(bake)
    passing = Way((0.0, 10.0), ((191.5, 0.0, -20.0), (191.5, 0.0, 20.0)))  # 3 m from the chapel's windows
    rig = worlds.rig_of(
        "stock:town",
        room=Way.resting((200.0, 0.0, 0.0)),
        objects=(OutsideObject("stock:car-small", passing, name="passing"),),
    )
    live.light(rig)
    shells = Shells(bake.receivers.positions, bake.triangles)
    shells.light(rig)
    whole, capture = [], []
    for seconds in np.linspace(0.5, 9.5, _REPEATS).tolist():
        moved = rig.at(seconds)
        started = time.perf_counter()
        live.light(moved)
        found = live.irradiance
        whole.append(time.perf_counter() - started)
        started = time.perf_counter()
        shells.light(moved)
        shells.shell_of((-4.45, 2.0, 0.0), live.layer.cube)
        capture.append(time.perf_counter() - started)
    still = live.layer.names
    one = 1e3 * float(np.median(capture))
    all_ = 1e3 * float(np.median(whole))
    return {
        "vertices": len(found),
        "portals": len(still),
        "triangles_outside": shells.triangles,
        "ms_one_shell": round(one, 1),
        "ms_all_shells_and_relight": round(all_, 1),
        "ms_relight": round(all_ - one * len(still), 1),
        "ms_one_shell_and_relight": round(all_ - one * (len(still) - 1), 1),
    }


def _baked(work: Path) -> Path:
    """The chapel with its triangles halved until it has some 100,000 vertices; some minutes the first time."""
    path = work / "chapel-100k.prelight"
    if not path.exists():
        command = ["bake", "portals", "stock:portals", "--subdivide", "0.145", "-o", str(path)]
        run = [sys.executable, "-c", "from prelight.cli.main import main; main()", *command]
        subprocess.run([*run, "--rays", "2304", "--gather-rays", "256"], check=True)
    return path
