"""Bakes of several layers for the studio's tests, each made once for all tests of a process."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from prelight.baking.environment import bake_environment
from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.storage.joining import add_layers

from .scenes import ball_on_floor


def lamps_bake(folders: pytest.TempPathFactory, *, side: int = 25) -> Path:
    """A ball over a floor with two layers: the sky's, and one for lamps."""
    pytest.importorskip("mitsuba", reason="the renderer is not installed")
    path = folders.getbasetemp() / f"lamps-{side}" / "ball.prelight"
    if not path.exists():
        path.parent.mkdir()
        scene = ball_on_floor(side=side)
        bake_environment(scene, path, resolution=48, tolerance=0.05, bounces=0)
        other = path.with_name("lamps.prelight")
        bake_transfer(scene, other, settings=TransferSettings(gather_rays=144, entries=64, modes=16))
        add_layers(path, other)
        shutil.rmtree(other)
    return path
