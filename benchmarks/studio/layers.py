"""Updates a second and latency of every kind of change that a studio of several layers takes; parts are kept as JSON.

python benchmarks/studio/layers.py --work FOLDER [--large] [--output results/layers.json]
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
from collections.abc import Callable
from pathlib import Path

from run import RATE, dragged, entered, studio

import prelight as pl
from prelight.baking.portals import bake_portals
from prelight.baking.transfer import bake_transfer
from prelight.scene.loading import load_scene
from prelight.studio.protocol import (
    ClientMessage,
    LampLight,
    PortalGlass,
    SetEnvironment,
    SetGlass,
    SetLamp,
    SetSun,
    Sun,
)

_SUN = Sun(43.74, 15.89, "2026-06-21", 12.0, None, 2.5)


def lamp(k: int, *, moved: bool, radius: float = 0.05, kind: str = "lamp") -> SetLamp:
    """A lamp that goes to and fro, or is dimmed."""
    x = 0.01 * (k % 100) - 0.5 if moved else 0.2
    light = LampLight(
        "a", "Lamp", kind, True, (x, 1.6, 0.3), (0.2, 0.0, 0.0), 8000.0, 1.0 if moved else 0.02 * (k % 50),
        (1.0, 0.9, 0.8), radius, 40.0, (0.5, 0.5),
    )  # fmt: skip
    return SetLamp(light, dragging=True)


def glass(portal: str, k: int, *, kind: str = "clear") -> SetGlass:
    """A blind that goes up and down, before clear glass, or glass that turns light more and less."""
    blind = 0.01 * (k % 100) if kind == "clear" else 0.0
    return SetGlass(PortalGlass(portal, kind, None, 5.0 + 0.3 * (k % 100), blind), dragging=True)  # ty: ignore


def sky(k: int) -> ClientMessage:
    return SetEnvironment(rotation_deg=0.5 * k % 360, dragging=True)


def hour(k: int) -> ClientMessage:
    return SetSun(
        Sun(_SUN.latitude_deg, _SUN.longitude_deg, _SUN.date, 8 + 0.02 * (k % 400), None, 2.5), dragging=True
    )


def lamps_edits() -> dict[str, Callable[[int], ClientMessage]]:
    return {
        "a lamp is dimmed": lambda k: lamp(k, moved=False),
        "a point is moved": lambda k: lamp(k, moved=True, radius=0.0),
        "a ball is moved": lambda k: lamp(k, moved=True),
        "a spot is moved": lambda k: lamp(k, moved=True, kind="spot"),
        "a panel is moved": lambda k: lamp(k, moved=True, kind="panel"),
        "the sky is turned": sky,
        "the hour goes by": hour,
    }


def portal_edits(names: list[str]) -> dict[str, Callable[[int], ClientMessage]]:
    return {
        "a blind is pulled": lambda k: glass(names[0], k),
        "glass is frosted": lambda k: glass(names[0], k, kind="frosted"),
        "the sky is turned": sky,
        "the hour goes by": hour,
    }


def measured(name: str, bake: Path, edits: dict[str, Callable[[int], ClientMessage]], seconds: float) -> dict:
    """Each kind of change in a studio of its own."""
    found: dict[str, object] = {"vertices": len(pl.Bake.open(bake).receivers), "changes_per_second": RATE}
    for words, edit in edits.items():
        with studio(bake) as link:
            found[words] = asyncio.run(dragged(*entered(link), edit=edit, seconds=seconds))
        print(name, words, json.dumps(found[words]), flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, default=Path("studio-benchmark"), help="folder for the bakes")
    parser.add_argument("--seconds", type=float, default=4.0, help="of each kind of change")
    parser.add_argument(
        "--large", action="store_true", help="stock:room and stock:portals, not their small ones"
    )
    parser.add_argument("--output", type=Path, help="JSON file of the figures; parts that are there are kept")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    figures = json.loads(given.output.read_text()) if given.output and given.output.exists() else {}
    for base, baked in (("room", bake_transfer), ("portals", bake_portals)):
        scene = base if given.large else f"{base}-small"
        if scene in figures:
            continue
        path = given.work / f"{scene}.prelight"
        if not path.exists():
            baked(load_scene(f"stock:{scene}"), path, resume=True)
        if base == "room":
            edits = lamps_edits()
        else:
            from prelight.relighting.portals_layer import read_portals

            edits = portal_edits(list(read_portals(pl.Bake.open(path), None).names))
        figures[scene] = {"load_before": os.getloadavg()[0], **measured(scene, path, edits, given.seconds)}
        if given.output:
            given.output.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
