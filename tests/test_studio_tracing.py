"""The path tracer beside the studio's light: it is right, tells how far it is, and ends when asked to."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from prelight.baking.environment import bake_environment
from prelight.camera import Camera
from prelight.errors import InputError
from prelight.lighting.environment import Environment
from prelight.lighting.rig import Rig
from prelight.storage.bake import Bake
from prelight.studio.environments import Environments
from prelight.studio.protocol import (
    Trace,
    Traced,
)
from prelight.studio.rig_state import initial
from prelight.studio.tracing import Tracing

from .scenes import plane
from .studio_bakes import lamps_bake


def test_the_path_tracer_sees_a_white_floor_under_a_white_sky(tmp_path) -> None:
    """Known answer: a floor of albedo 0.8 under radiance 1 has radiance 0.8, and around it is the sky."""
    pytest.importorskip("mitsuba", reason="the renderer is not installed")
    from prelight.checking.on_screen import ScreenTracer

    bake = bake_environment(plane(6), tmp_path / "plane.prelight", resolution=8, bounces=0)
    rig_ = Rig(Environment.constant((1.0, 1.0, 1.0)))
    above = Camera((0.0, 3.0, 0.01), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), 60.0)
    tracer = ScreenTracer(bake, rig_, above, width=24, height=16)
    counts = []
    picture = np.zeros((16, 24, 3))
    for samples, mean in tracer.pictures(48):
        counts.append(samples)
        picture = mean.reshape(16, 24, 3)
    assert counts == list(range(1, 49))
    assert picture[5:11, 8:16].mean() == pytest.approx(0.8, rel=0.01)
    assert picture[:, 0].mean() == pytest.approx(1.0, abs=1e-3)
    with pytest.raises(InputError, match="nothing shines"):
        ScreenTracer(bake, Rig(Environment.dark()), above, width=8, height=8)


def test_tracing_tells_how_far_it_is_and_ends_when_it_is_asked_to(tmp_path_factory) -> None:
    told: list[tuple[Traced, bytes | None]] = []
    goes_on, ended = threading.Event(), threading.Event()

    def pictures(_bake, _rig, _camera, size, samples):
        try:
            for n in range(1, samples + 1):
                yield n, np.full((size[0] * size[1], 3), float(n), np.float32)
                goes_on.wait(10)
        finally:
            ended.set()

    bake = Bake.open(lamps_bake(tmp_path_factory))
    tracing = Tracing(
        bake, Environments(), pictures=pictures, tell=lambda _v, said, data: told.append((said, data))
    )
    wanted = Trace((0.0, 1.0, 3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 40.0, 32, 18)
    tracing.start(wanted, initial("stock:noon"), takes=("environment", "lamps"), visitor=1)
    while not (told and told[-1][1]):
        ended.wait(0.02)
    assert (told[-1][0].samples, told[-1][0].stopped) == (1, None)
    assert len(told[-1][1] or b"") == 32 + 4 * 32 * 18
    tracing.stop(2)  # somebody else's wish
    tracing.stop(1)
    goes_on.set()
    assert ended.wait(10)
    tracing.close()
    assert told[-1][0].stopped == "stopped"
    with pytest.raises(InputError, match="pixels"):
        tracing.start(replace(wanted, width=4096, height=4096), initial("stock:noon"), takes=(), visitor=1)
    none = Tracing(bake, Environments(), pictures=None, tell=lambda *_: None)
    assert "Mitsuba" in (none.missing or "")
    with pytest.raises(InputError, match="not installed"):
        none.start(wanted, initial("stock:noon"), takes=(), visitor=1)
