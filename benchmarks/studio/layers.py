"""Updates a second and latency of every kind of change that a studio of several layers takes; parts are kept as JSON.

python benchmarks/studio/layers.py --work FOLDER [--large] [--browser] [--output results/layers.json]

A bake that is in the folder is taken: room.prelight and portals.prelight with --large (100,000 vertices each; their
rows are gathered with few rays, so that baking takes minutes: a change of light reads as much).
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
from collections.abc import Callable
from pathlib import Path

from run import RATE, dragged, entered, steered, studio

import prelight as pl
from prelight.baking.portals import bake_portals
from prelight.baking.portals_settings import PortalsSettings
from prelight.baking.transfer import bake_transfer
from prelight.baking.transfer_settings import TransferSettings
from prelight.scene.loading import load_scene
from prelight.scene.subdivision import subdivided
from prelight.studio.kept import state_file
from prelight.studio.protocol import ClientMessage, SetEnvironment, SetGlass, SetLamp, SetSun, SetWorld
from prelight.studio.protocol_values import LampLight, PortalGlass, Sun

ROOM_EDGE, PORTALS_EDGE = 0.077, 0.24  # metres: 100,000 vertices each
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


WORLD = "passing.toml"


def passing(bake: pl.Bake, folder: Path) -> str:
    """A rig whose world is a car that passes by the room."""
    low, high = bake.receivers.positions.min(axis=0).tolist(), bake.receivers.positions.max(axis=0).tolist()
    x, y = low[0] - 5.0, low[1]
    path = folder / WORLD
    path.write_text(
        f"[environment]\nmap = 'stock:noon'\n[outside]\n[[outside.object]]\nscene = 'stock:car-small'\n"
        f"position = [{x}, {y}, {low[2]}]\nkeys = [{{ at = 10, position = [{x}, {y}, {high[2]}] }}]\n"
    )
    return str(path)


def world(k: int) -> SetWorld:
    return SetWorld(WORLD, 0.02 * (k % 500), dragging=True)


def measured(
    name: str,
    bake: Path,
    edits: dict[str, Callable[[int], ClientMessage]],
    seconds: float,
    *,
    skies: tuple[str, ...] = (),
) -> dict:
    """Each kind of change in a studio of its own, one after another: each finds the light that the last one left."""
    state_file(bake).unlink(missing_ok=True)
    found: dict[str, object] = {"vertices": len(pl.Bake.open(bake).receivers), "changes_per_second": RATE}
    for words, edit in edits.items():
        with studio(bake, *skies) as link:
            found[words] = asyncio.run(dragged(*entered(link), edit=edit, seconds=seconds))
        print(name, words, json.dumps(found[words]), flush=True)
    return found


def on_the_page(bake: Path, edits: dict[str, Callable[[int], ClientMessage]], seconds: float) -> dict:
    """What arrives in Chromium while somebody else drags, and the script that it costs there."""
    from page import in_browser

    with studio(bake) as link:
        door = entered(link)
        drags = {
            words: lambda edit=edit: asyncio.run(steered(*door, edit=edit, seconds=seconds))
            for words, edit in edits.items()
        }
        return in_browser(*door, drags=drags)


def baked(base: str, path: Path, *, large: bool) -> None:
    """A room with a transfer layer, or with portals."""
    if path.exists():
        return
    scene = load_scene(f"stock:{base}" if large else f"stock:{base}-small")
    if base == "room":
        settings = TransferSettings(gather_rays=144) if large else TransferSettings()
        bake_transfer(subdivided(scene, ROOM_EDGE) if large else scene, path, settings=settings, resume=True)
    else:
        rays = PortalsSettings(rays=256, gather_rays=144) if large else PortalsSettings()
        bake_portals(subdivided(scene, PORTALS_EDGE) if large else scene, path, settings=rays, resume=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--work", type=Path, default=Path("studio-benchmark"), help="folder for the bakes")
    parser.add_argument("--seconds", type=float, default=4.0, help="of each kind of change")
    parser.add_argument("--large", action="store_true", help="100,000 vertices, not the small scenes")
    parser.add_argument("--browser", action="store_true", help="in Chromium too")
    parser.add_argument("--output", type=Path, help="JSON file of the figures; parts that are there are kept")
    given = parser.parse_args()
    given.work.mkdir(parents=True, exist_ok=True)
    figures = json.loads(given.output.read_text()) if given.output and given.output.exists() else {}
    for base in ("room", "portals"):
        scene = base if given.large else f"{base}-small"
        if scene in figures:
            continue
        path = given.work / f"{scene}.prelight"
        baked(base, path, large=given.large)
        skies: tuple[str, ...] = ()
        if base == "room":
            edits = lamps_edits()
        else:
            from prelight.relighting.portals_layer import read_portals

            bake = pl.Bake.open(path)
            edits = {**portal_edits(list(read_portals(bake, None).names)), "the world moves": world}
            skies = (passing(bake, given.work),)
        found = {
            "load_before": os.getloadavg()[0],
            **measured(scene, path, edits, given.seconds, skies=skies),
        }
        if given.browser:
            one = dict(list(edits.items())[:1])
            found["browser"] = on_the_page(path, one, given.seconds)
            print(scene, "browser", json.dumps(found["browser"]), flush=True)
        figures[scene] = found
        if given.output:
            given.output.write_text(json.dumps(figures, indent=2) + "\n")


if __name__ == "__main__":
    main()
