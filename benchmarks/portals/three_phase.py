"""Beside Radiance's three-phase method: one room, the same sensors, forty hours, three glasses, against rtrace."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from datetime import date
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from radiance import (
    Radiance,
    klems_directions,
    points_text,
    read_matrix,
)

from prelight.baking.portals import bake_portals
from prelight.baking.portals_settings import PortalsSettings
from prelight.bases import cube_map
from prelight.lighting.daylight import Daylight
from prelight.lighting.environment import Environment
from prelight.lighting.frost import frosted
from prelight.lighting.glass import Glass
from prelight.lighting.moment import Site, hours_of_day
from prelight.lighting.rig import Rig
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.geometry import Scene
from prelight.scene.portals import PortalWish
from prelight.scene.stock.room import room as stock_room
from prelight.storage.bake import Bake

FOLDER: Path | None = None  # of the pyradiance package
SITE = Site(43.7, 15.9)
DAYS = (date(2026, 2, 20), date(2026, 4, 15), date(2026, 6, 21), date(2026, 10, 30))
NORTH_DEG = 90.0  # the window, in the wall at −X, looks south
DETAIL, SENSORS, CHECKED = 0.6, 240, 12
FROST_DEG = 15.0
GLASSES = {
    "clear": Glass("*", tint=(0.88, 0.88, 0.88)),
    "tinted": Glass("*", tint=(0.35, 0.55, 0.95)),
    "frosted": Glass("*", kind="frosted", frost_deg=FROST_DEG, tint=(0.8, 0.8, 0.8)),
}
_X, _Y, _Z = -2.3, (0.80, 2.20), (-1.25, 0.55)  # of the pane: the outer edge of the reveal
_OUTWARD = np.array((-1.0, 0.0, 0.0), np.float32)
_V = ("-I+", "-ab", "9", "-lw", "1e-5", "-n", "2")
_TRUTH = (
    "-I",
    "-h",
    "-ab",
    "9",
    "-ad",
    "4096",
    "-aa",
    "0",
    "-as",
    "0",
    "-lw",
    "1e-5",
    "-dj",
    "0",
    "-ds",
    "0.02",
    "-n",
    "2",
)


def hours() -> list[Daylight]:
    """Ten hours of four days each, from soon after dawn to soon before dusk."""
    moments = [when for day in DAYS for when in hours_of_day(day, SITE, steps=12)[1:-1]]
    return [Daylight(SITE, when, north_deg=NORTH_DEG) for when in moments]


def plain_room(detail: float = DETAIL) -> Scene:
    """The stock room, its boards in their mean colour: Radiance gets no pictures."""
    scene = stock_room(detail=detail)
    tint = scene.tint.copy()
    materials = list(scene.materials)
    for k, material in enumerate(scene.materials):
        if material.colour_texture is not None:
            on = scene.material_of_vertex == k
            tint[on] = scene.albedo[on].mean(axis=0)
            r, g, b = (float(x) for x in tint[on][0])
            materials[k] = replace(material, colour=(r, g, b), colour_texture=None)
    return replace(scene, albedo=tint, tint=None, textures=(), uv=None, materials=tuple(materials))


def settings(work: Path, rays: int = 4096, gather_rays: int = 1024) -> PortalsSettings:
    """The window as a polygon of a file."""
    corners = [[_X, y, z] for y, z in ((_Y[0], _Z[0]), (_Y[1], _Z[0]), (_Y[1], _Z[1]), (_Y[0], _Z[1]))]
    (work / "window.toml").write_text(f'[[portal]]\nname = "window"\npolygon = {corners}\n')
    return PortalsSettings(PortalWish(file=str(work / "window.toml")), rays=rays, gather_rays=gather_rays)


def sensors(scene: Scene, light: PortalsRelighter) -> np.ndarray:
    """Vertices inside the room that light reaches, in a seeded order."""
    x, y, z = scene.positions.T
    inside = (np.abs(x) < 2.05) & (y > -0.01) & (y < 2.71) & (np.abs(z) < 2.35)
    light.light(Rig(Environment.constant((1.0, 1.0, 1.0))))
    found = light.irradiance[:, 1]
    lit = found > 0.02 * found[inside].mean()
    there = np.flatnonzero(inside & lit & (np.abs(scene.normals).sum(axis=1) > 0))
    return np.random.default_rng(5).choice(there, SENSORS, replace=False)


def checked(hour: int) -> np.ndarray:
    """Which of the sensors rtrace is asked for at an hour: others at every hour."""
    return (CHECKED * hour + np.arange(CHECKED)) % SENSORS


def ours(work: Path) -> tuple[Scene, PortalsRelighter, float]:
    """Baked the first time; and the seconds that took."""
    scene, path, told = plain_room(), work / "room.prelight", work / "room.seconds"
    if not path.exists():
        bake_portals(
            plain_room(0.3), work / "small.prelight", settings=settings(work), force=True
        )  # compiles
        started = time.perf_counter()
        bake_portals(scene, path, settings=settings(work))
        told.write_text(str(time.perf_counter() - started))
    return scene, PortalsRelighter(Bake.open(path)), float(told.read_text())


@lru_cache(maxsize=1)
def prepared(work: Path) -> tuple[Radiance, Scene, np.ndarray]:
    """Radiance with the room, and the sensors."""
    assert FOLDER is not None
    radiance, scene = Radiance(FOLDER, work / "radiance"), plain_room()
    radiance.write_scene(scene, "room.rad")
    radiance.octree("room.oct", "room.rad")
    window = [(_X, -z, y) for y, z in ((_Y[0], _Z[1]), (_Y[0], _Z[0]), (_Y[1], _Z[0]), (_Y[1], _Z[1]))]
    a, b, c = (np.array(p) for p in window[:3])
    if np.cross(b - a, c - b)[0] < 0:  # into the room
        window = window[::-1]
    corners = " ".join(f"{v:.6g}" for p in window for v in p)
    glow = "void glow pane 0 0 4 1 1 1 0\n"
    (radiance.work / "window.rad").write_text(f"#@rfluxmtx h=kf u=Z\n{glow}pane polygon w 0 0 12 {corners}\n")
    (radiance.work / "dome.rad").write_text(
        "#@rfluxmtx h=u u=Y\nvoid glow g 0 0 4 1 1 1 0\ng source ground 0 0 4 0 0 -1 180\n"
        "#@rfluxmtx h=r1 u=Y\nvoid glow s 0 0 4 1 1 1 0\ns source sky 0 0 4 0 0 1 180\n"
    )
    return radiance, scene, sensors(scene, ours(work)[1])


def points(scene: Scene, chosen: np.ndarray) -> bytes:
    return points_text(scene.positions[chosen] + 1e-3 * scene.normals[chosen], scene.normals[chosen])


def view_matrix(radiance: Radiance, given: bytes, *, divisions: int) -> tuple[np.ndarray, float]:
    """(n, 145, 3), and its seconds."""
    started = time.perf_counter()
    told = radiance.run(
        "rfluxmtx", *_V, "-ad", str(divisions), "-", "window.rad", "-i", "room.oct", given=given
    )
    return read_matrix(told, (given.count(b"\n"), 145, 3)), time.perf_counter() - started


def daylight_matrix(radiance: Radiance) -> tuple[np.ndarray, float]:
    """(145, 146, 3), and its seconds."""
    started = time.perf_counter()
    told = radiance.run("rfluxmtx", "-ab", "2", "-ad", "1024", "-lw", "1e-4", "-c", "4000", "window.rad", "dome.rad",
                        "-i", "room.oct")  # fmt: skip
    return read_matrix(told, (145, 146, 3)), time.perf_counter() - started


def transmissions() -> dict[str, np.ndarray]:
    """(145, 145, 3) from light that falls on the pane to light that leaves it, for each glass."""
    d, angle = klems_directions()
    apart = np.arccos(np.clip(d @ d.T, -1, 1))
    solid = angle / np.maximum(d[:, 2], 1e-9)
    blur = np.exp(-0.5 * (apart / np.radians(FROST_DEG)) ** 2) * solid
    blur /= blur.sum(axis=1, keepdims=True)
    shapes = {"clear": np.eye(145), "tinted": np.eye(145), "frosted": blur}
    return {name: shapes[name][..., None] * np.array(glass.tint) for name, glass in GLASSES.items()}


class Blurred:
    """What frosted glass makes of an environment, as a map to look up."""

    discs = ()

    def __init__(self, environment: Environment) -> None:
        self._cube = frosted(environment.cube(64), FROST_DEG, _OUTWARD)

    def with_discs(self, discs: list) -> Blurred:
        return self

    def radiance_along(self, d: np.ndarray) -> np.ndarray:
        face, u, v = cube_map.face_coordinates(d.astype(np.float64))
        row, column = (np.clip(((t + 1) * 32).astype(int), 0, 63) for t in (v, u))
        return self._cube[face, row, column]


def truth(work: Path, name: str, chosen: Iterable[int]) -> np.ndarray:
    """(hours, CHECKED, 3) irradiance by rtrace through an open window; each hour kept when it is there."""
    radiance, scene, all_ = prepared(work)
    out = []
    for k in chosen:
        kept = work / f"truth_{name}_{k}.npy"
        if not kept.exists():
            environment: Any = hours()[k].environment()
            radiance.write_sky(Blurred(environment) if name == "frosted" else environment, "sky.rad")
            radiance.octree("lit.oct", "room.rad", "sky.rad")
            told = radiance.run("rtrace", *_TRUTH, "lit.oct", given=points(scene, all_[checked(k)]))
            np.save(kept, read_matrix(told, (CHECKED, 3)))
        out.append(np.load(kept))
    return np.array(out)


def relit(work: Path, light: PortalsRelighter, chosen: np.ndarray, name: str) -> np.ndarray:
    """(hours, sensors, 3) irradiance by us."""
    out = []
    for daylight in hours():
        light.light(Rig(daylight.environment(), portals=(GLASSES[name],)))
        out.append(np.pi * light.irradiance[chosen])
    return np.array(out)
