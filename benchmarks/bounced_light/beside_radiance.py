"""146 patches of the sky by Radiance's rfluxmtx and by us: the same room and points, side by side."""

from __future__ import annotations

import os
import subprocess
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from prelight.bases.cube_map import texel_directions
from prelight.checking.comparison import compare
from prelight.rays.mitsuba import Occluders
from prelight.scene.geometry import Scene
from prelight.scene.stock.room import room as stock_room
from prelight.transport.bounces import bounced
from prelight.transport.direct import DiffuseTransfer
from prelight.transport.exact import integrate
from prelight.transport.gathering import Gathering
from prelight.transport.mesh_fitness import measure_fitness
from prelight.transport.path_traced_light import LitScene
from prelight.transport.vantage import vantage_points

FOLDER: Path | None = None  # of the pyradiance package
SHARE = 80  # Radiance does one point in so many; its time is in proportion to them
PATHS, RECEIVERS = 16384, 300
RESOLUTION = 48  # of the sky for our direct light
_ROWS = (30, 30, 24, 24, 18, 12, 6, 1)  # patches of 12° from the horizon up (Tregenza 1987), then the ground
_AT_ONCE = 25  # patches in colour that we bounce together
_OPTIONS = ("-I+", "-ab", "9", "-ad", "1024", "-lw", "1e-5", "-n", "2", "-h", "-fa")


def room(data: Path, work: Path) -> dict[str, Any]:
    """rfluxmtx -I+ -ab 9 -ad 1024 beside the gathering operator at 1,024 rays, in a room of 45,000 vertices."""
    if FOLDER is None or not (FOLDER / "bin" / "rfluxmtx").exists():
        return {"skipped": "give --radiance FOLDER, the pyradiance package with its bin/rfluxmtx"}
    scene = _without_textures(stock_room(detail=1.23))
    points = np.arange(0, len(scene.positions), SHARE)
    points = points[scene.normals[points].any(axis=1)]
    _bake(_without_textures(stock_room(detail=0.3)))  # compiles
    ours, D, seconds, stand = _bake(scene)
    theirs, their_seconds = _rfluxmtx(scene, points, stand, work)
    seconds_again = _bake(scene)[2]
    sky = _sky_of_rows()
    x, y, z = scene.positions[points].T
    inside = np.flatnonzero(
        (np.abs(x) < 2.29) & (np.abs(y - 1.35) < 1.5) & (np.abs(z) < 2.59)
    )  # not on the shell
    direct = np.repeat(_under_sky(D[..., None], sky)[:, None], 3, axis=2)
    fit = measure_fitness(
        scene, Occluders(scene.positions, scene.triangles), direct=direct,
        indirect=_under_sky(ours, sky)[:, None].astype(np.float32) - direct,
    )  # fmt: skip
    judged = inside[fit.judged[points[inside]]]
    few = np.random.default_rng(3).choice(judged, min(RECEIVERS, len(judged)), replace=False)
    reference = LitScene(scene, sky=sky[_row_of_texels()].reshape(6, RESOLUTION, RESOLUTION, 3)).light(
        points[few].astype(np.int32), origins=stand, samples=PATHS
    )
    weights = np.concatenate([np.repeat(sky[:-1, 0], _ROWS), sky[-1:, 0]])
    rows = _patch_rows_of_radiance(weights)
    per_point, their_per_point = (
        (seconds + seconds_again) / 2 / len(scene.positions),
        their_seconds / len(points),
    )
    return {
        "vertices": len(scene.positions), "patches": 146, "points_of_radiance": len(points),
        "options_of_radiance": " ".join(_OPTIONS),
        "our_seconds": [seconds, seconds_again], "radiance_seconds": their_seconds,
        "milliseconds_a_point": {"ours": 1e3 * per_point, "radiance": 1e3 * their_per_point},
        "radiance_over_ours": their_per_point / per_point,
        "against_path_tracer": {
            "paths": PATHS, "receivers": len(few), "points_judged": len(judged) / len(inside),
            "ours": _figures(_under_sky(ours[points[few]], sky), reference),
            "radiance": _figures(np.einsum("pjc,j->pc", theirs[few], rows) / np.pi, reference),
        },
    }  # fmt: skip


def _without_textures(scene: Scene) -> Scene:
    """The boards in their mean colour: Radiance gets no pictures."""
    tint = scene.tint.copy()
    pictured = [k for k, m in enumerate(scene.materials) if m.colour_texture is not None]
    on = np.isin(scene.material_of_vertex, pictured)
    colour = tuple(float(x) for x in scene.albedo[on].mean(axis=0))
    tint[on] = colour
    plain = tuple(
        replace(m, colour=colour, colour_texture=None) if k in pictured else m
        for k, m in enumerate(scene.materials)
    )
    return replace(scene, albedo=tint, tint=None, textures=(), uv=None, materials=plain)


def _row_of_texels() -> np.ndarray:
    """Of each texel of the cube map, its row of patches from the horizon up; 8 is the ground."""
    up = texel_directions(np.arange(6 * RESOLUTION**2), RESOLUTION)[:, 1]
    row = np.minimum(np.degrees(np.arcsin(np.clip(up, -1, 1))) // 12, 7).astype(int)
    return np.where(up > 0, row, 8)


def _sky_of_rows() -> np.ndarray:
    """(9, 3) radiance of the rows: the CIE overcast sky by its patches' middles, a grey ground."""
    altitude = np.radians([6, 18, 30, 42, 54, 66, 78, 90])
    return np.repeat(np.append((1 + 2 * np.sin(altitude)) / 3, 0.15)[:, None], 3, axis=1).astype(np.float32)


def _patches() -> np.ndarray:
    """(6, R, R, 146) which patch each texel is in; azimuth counts from −Z, which no figure depends on."""
    d = texel_directions(np.arange(6 * RESOLUTION**2), RESOLUTION)
    row, turn = _row_of_texels(), np.arctan2(d[:, 0], -d[:, 2]) / (2 * np.pi) % 1.0
    count = np.array([*_ROWS, 1])
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    patch = first[row] + np.minimum((turn * count[row]).astype(int), count[row] - 1)
    out = np.zeros((len(d), 146), np.float32)
    out[np.arange(len(d)), patch] = 1
    return out.reshape(6, RESOLUTION, RESOLUTION, 146)


def _bake(scene: Scene) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """E / π (V, 146, 3) of every patch, all bounces, its direct part (V, 146), and the seconds in all."""
    started = time.perf_counter()
    occluders = Occluders(scene.positions, scene.triangles)
    stand = vantage_points(scene, occluders)
    gathering = Gathering.trace(scene, occluders, origins=stand, rays=1024)
    D = integrate(DiffuseTransfer(occluders, stand, scene.normals), _patches()).astype(np.float32)
    E = np.empty((len(D), 146, 3), np.float32)
    for k in range(0, 146, _AT_ONCE):
        light = np.repeat(D[:, k : k + _AT_ONCE, None], 3, axis=2)
        E[:, k : k + _AT_ONCE] = light + bounced(gathering, light).indirect
    return E, D, time.perf_counter() - started, stand


def _under_sky(E: np.ndarray, sky: np.ndarray) -> np.ndarray:
    weights = np.concatenate([np.repeat(sky[:-1, 0], _ROWS), sky[-1:, 0]])
    return np.einsum("pjc,j->pc", E, weights, optimize=True).astype(np.float32)


def _patch_rows_of_radiance(weights: np.ndarray) -> np.ndarray:
    """Its matrix has the ground first, then the patches of each row."""
    return np.concatenate([weights[-1:], weights[:-1]])


def _rfluxmtx(scene: Scene, points: np.ndarray, stand: np.ndarray, work: Path) -> tuple[np.ndarray, float]:
    """Irradiance (points, 146, 3) by Radiance, Z up: (x, y, z) becomes (x, −z, y)."""
    folder = work / "radiance"
    folder.mkdir(exist_ok=True)
    _write_scene(scene, folder / "room.rad")
    (folder / "sky.rad").write_text(
        "#@rfluxmtx h=u u=Y\nvoid glow g 0 0 4 1 1 1 0\ng source ground 0 0 4 0 0 -1 180\n"
        "#@rfluxmtx h=r1 u=Y\nvoid glow s 0 0 4 1 1 1 0\ns source sky 0 0 4 0 0 1 180\n"
    )
    lifted = stand[points] + 1e-3 * scene.normals[points]
    lines = np.concatenate([_turned(lifted), _turned(scene.normals[points])], axis=1)
    np.savetxt(folder / "points", lines, fmt="%.7g")
    its = FOLDER.resolve()
    environment = os.environ | {"PATH": f"{its / 'bin'}:{os.environ['PATH']}", "RAYPATH": f".:{its / 'lib'}"}
    with (folder / "room.oct").open("wb") as octree:
        subprocess.run(["oconv", "room.rad"], cwd=folder, env=environment, stdout=octree, check=True)
    started = time.perf_counter()
    with (folder / "points").open("rb") as given:
        told = subprocess.run(
            ["rfluxmtx", *_OPTIONS, "-", "sky.rad", "-i", "room.oct"],
            cwd=folder, env=environment, stdin=given, capture_output=True, check=True,
        )  # fmt: skip
    seconds = time.perf_counter() - started
    return np.array(told.stdout.split(), np.float64).reshape(len(points), 146, 3), seconds


def _turned(a: np.ndarray) -> np.ndarray:
    return np.stack([a[:, 0], -a[:, 2], a[:, 1]], axis=1)


def _write_scene(scene: Scene, path: Path) -> None:
    """Triangles as polygons, each material a plastic without gloss."""
    out = [
        f"void plastic m{k} 0 0 5 {m.colour[0]:.6g} {m.colour[1]:.6g} {m.colour[2]:.6g} 0 0\n"
        for k, m in enumerate(scene.materials)
    ]
    corners = _turned(scene.positions.astype(np.float64))[scene.triangles].reshape(-1, 9)
    for k, (material, values) in enumerate(zip(scene.material_of.tolist(), corners.tolist(), strict=True)):
        out.append(f"m{material} polygon p{k} 0 0 9 {' '.join(f'{x:.9g}' for x in values)}\n")
    path.write_text("".join(out))


def _figures(E: np.ndarray, reference: Any) -> dict[str, float]:
    found = compare(E, reference.total, reference.total_variance)
    return {
        "mean_difference": found.mean_difference, "signed_mean": found.signed_mean,
        "detectable_bias": found.detectable_bias, "relative_rms": found.relative_rms,
    }  # fmt: skip
