"""A picture of a cloud's lights, before and after they are clustered for a zone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..camera import Camera
from ..drawing.figures import save_figure
from ..drawing.light_cloud import light_cloud_figure
from ..errors import InputError
from ..storage.bake import Bake
from .stored_cloud import open_cloud


def cloud_figure(bake: str | Path, path: str | Path, *, zone: int = 0, force: bool = False) -> None:
    """Draw it into a .png, as the bake's first camera sees the scene. Raises InputError for a zone there is not."""
    opened = Bake.open(bake)
    layer = open_cloud(opened)
    if not 0 <= zone < len(layer.zone_rows):
        raise InputError("--zone", f"{zone}, expected 0 to {len(layer.zone_rows) - 1}")
    receivers = opened.receivers
    own = layer.slot_of[zone] - layer.slot_of[zone].min()
    groups = np.concatenate([layer.group_lights(zone), np.bincount(own, layer.counts)[:, None]], axis=1)
    first = int(layer.zone_rows[:zone].sum())
    figure = light_cloud_figure(
        (receivers.positions, opened.triangles, receivers.normals, receivers.albedo),
        next(iter(opened.cameras.values()), None) or Camera.framing(receivers.positions),
        before=layer.grid, after=groups, zone=layer.order[first : first + int(layer.zone_rows[zone])],
        step=float(layer.parameters["step"] or 1.0),
    )  # fmt: skip
    save_figure(figure, path, force=force)
