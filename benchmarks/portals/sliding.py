"""A door that slides: its opening in strips, each a portal with a blind, beside the very opening baked by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from prelight.baking.portals import bake_portals
from prelight.baking.portals_settings import PortalsSettings
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.glass import Glass
from prelight.lighting.rig import Rig
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.portals import PortalWish
from prelight.scene.stock.room import room as stock_room

STRIPS = (1, 4, 8, 16)
COVERED = (0.15, 0.5, 0.8)  # of the opening's width
_X, _Y, _Z = -2.3, (0.80, 2.20), (-1.25, 0.55)
_SUN = Disc((-0.75, 0.6, 0.25), 0.25, (7e4, 6.5e4, 6e4), 0.5)


def sliding(data: Path, work: Path) -> dict[str, Any]:
    """Mean |difference| over the mean of all vertices, by strips and by how far the door is shut."""
    scene = stock_room(detail=0.3)
    settings = {"rays": 2048, "gather_rays": 256}

    def made(spans: list[tuple[float, float]]) -> PortalsRelighter:
        rows = []
        for k, (low, high) in enumerate(spans):
            corners = [[_X, y, z] for y, z in ((_Y[0], low), (_Y[1], low), (_Y[1], high), (_Y[0], high))]
            rows.append(f'[[portal]]\nname = "strip {k}"\npolygon = {corners}\n')
        (work / "door.toml").write_text("\n".join(rows))
        asked = PortalsSettings(PortalWish(file=str(work / "door.toml")), **settings)
        return PortalsRelighter(bake_portals(scene, work / "door.prelight", settings=asked, force=True))

    sky = Environment.constant((1.0, 1.1, 1.3))
    lights = {"sky": sky, "sky and sun": sky.with_disc(_SUN)}
    edges = {n: np.linspace(*_Z, n + 1) for n in STRIPS}
    doors = {n: made(list(zip(e[:-1].tolist(), e[1:].tolist(), strict=True))) for n, e in edges.items()}
    out: dict[str, Any] = {}
    for share in COVERED:
        edge = _Z[0] + share * (_Z[1] - _Z[0])  # the door comes from the low side
        truth = made([(edge, _Z[1])])
        for name, light in lights.items():
            truth.light(Rig(light))
            known, row = truth.irradiance, {}
            for n, door in doors.items():
                shut = np.clip((edge - edges[n][:-1]) / np.diff(edges[n]), 0, 1)
                glass = tuple(Glass(f"strip {k}", blind=float(b)) for k, b in enumerate(shut))
                door.light(Rig(light, portals=glass))
                row[str(n)] = float(np.abs(door.irradiance - known).mean() / known.mean())
            out[f"{share:.0%} shut, {name}"] = row
    return out
