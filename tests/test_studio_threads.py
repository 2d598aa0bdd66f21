"""Kernels of several threads are launched by one thread of a studio: numba's own pool ends a process where two meet."""

from __future__ import annotations

import sys
import threading
from typing import Any

import numpy as np
from numba.core.registry import CPUDispatcher

from prelight.camera import Camera
from prelight.lighting.rig import Rig
from prelight.storage.bake import Bake
from prelight.studio.protocol import SetDisc, SetEnvironment, Trace
from prelight.studio.tracing import Growing

from .live_studio import ball_bake, running

PATHS = (
    "/sky/stock:noon", "/sky/daylight:43.7,15.9,2026-06-21,9.25,2.5,", "/preview/stock:sunset", "/preview/daylight",
    "/geometry.json", "/geometry/positions", "/rig.toml",
)  # fmt: skip


def grey(_bake: Bake, _rig: Rig, _camera: Camera, size: tuple[int, int], samples: int) -> Growing:
    """In place of the renderer, which has threads of its own."""
    yield samples, np.ones((size[0] * size[1], 3), np.float32)


def test_only_one_thread_launches_kernels_of_several(monkeypatch, tmp_path, tmp_path_factory) -> None:
    """Whatever is asked of it: skies, previews, the scene, rigs, maps and the path tracer."""
    launched: dict[str, set[str]] = {}

    def noted(kernel: CPUDispatcher, name: str) -> Any:
        def run(*arguments: Any) -> Any:
            launched.setdefault(threading.current_thread().name, set()).add(name)
            return kernel(*arguments)

        return run

    bake = ball_bake(tmp_path_factory)
    with running(bake, state_file=tmp_path / "warm.json") as live, live.page() as page:
        page.exact(page.message("Welcome")["state"]["sequence"])  # all modules are imported
    for name, module in list(sys.modules.items()):
        for label, kernel in list(vars(module).items()) if name.startswith("prelight.") else ():
            if isinstance(kernel, CPUDispatcher) and kernel.targetoptions.get("parallel"):
                monkeypatch.setattr(module, label, noted(kernel, label))
    with running(bake, state_file=tmp_path / "s.json", pictures=grey) as live, live.page() as page:
        page.exact(page.message("Welcome")["state"]["sequence"])
        page.send(SetDisc("d", 20.0, 30.0, 5.0, (1.0, 1.0, 1.0)))
        page.send(SetEnvironment(environment="stock:overcast"))
        page.send(Trace((0.0, 2.0, 6.0), (0.0, 0.5, 0.0), (0.0, 1.0, 0.0), 35.0, 32, 18))
        page.until(lambda got: isinstance(got, dict) and got["type"] == "Traced" and got["samples"] > 0)
        for path in PATHS:
            live.get(path)
    assert "relighting" in launched
    assert set(launched) == {"relighting"}, launched
