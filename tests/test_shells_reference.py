"""Shells beside the path tracer, frame by frame: the same world in the renderer, seen from the same windows."""

from __future__ import annotations

from pathlib import Path as File

import numpy as np
import pytest

from prelight.bases import cube_map
from prelight.lighting.disc import Disc
from prelight.lighting.environment import Environment
from prelight.lighting.outside import Outside, OutsideObject, Path
from prelight.lighting.regions import Window
from prelight.lighting.rig import Rig
from prelight.rays.mitsuba import triangle_mesh
from prelight.relighting.shells import Shells
from prelight.scene.loading import load_scene
from prelight.scene.variant import mitsuba

from .test_shells import room, write_box

R, SAMPLES = 16, 256
MOMENTS = (1.3, 2.0, 2.7)
SKY, SUN = 2.0, Disc.at(-60.0, 40.0, radius_deg=1.0, radiance=(3000.0, 2700.0, 2400.0))


def path_traced(meshes: list[tuple[str, np.ndarray, tuple]], centre: np.ndarray) -> np.ndarray:
    """(6, R, R, 3) direct light alone, by the renderer; suns are seen by what they light, not themselves."""
    mi = mitsuba()
    scene: dict = {"type": "scene", "sky": {"type": "constant", "radiance": SKY}}
    scene["sun"] = {
        "type": "directional", "direction": [-x for x in SUN.direction],
        "irradiance": {"type": "rgb", "value": SUN.total.tolist()},
    }  # fmt: skip
    for k, (source, shift, colour) in enumerate(meshes):
        loaded = load_scene(source)
        bsdf = {
            "type": "twosided",
            "b": {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(colour)}},
        }
        scene[f"mesh{k}"] = triangle_mesh(loaded.positions + np.float32(shift), loaded.triangles, bsdf=bsdf)
    loaded_scene = mi.load_dict(scene)
    integrator = mi.load_dict({"type": "path", "max_depth": 2})
    n = 6 * R * R * SAMPLES
    texel = np.repeat(np.arange(6 * R * R, dtype=np.int32), SAMPLES)
    rng = np.random.default_rng(3)
    face, inside = np.divmod(texel, R * R)
    row, column = np.divmod(inside, R)
    u, v = (2 * (k + rng.uniform(size=n)) / R - 1 for k in (column, row))
    d = cube_map.directions(face, u, v).astype(np.float32)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, n)
    ray = mi.RayDifferential3f(
        mi.Point3f(*np.broadcast_to(np.float32(centre)[:, None], (3, n))), mi.Vector3f(*d.T)
    )
    light, _, _ = integrator.sample(loaded_scene, sampler, ray)
    return np.array(light).T.reshape(6 * R * R, SAMPLES, 3).mean(axis=1).reshape(6, R, R, 3)


def test_a_van_that_passes_at_three_metres(tmp_path: File) -> None:
    """At each of three windows, in every frame, by a hundredth; and they darken in the same order."""
    van = write_box(tmp_path / "van.obj", (-1.0, -1.0, -2.2), (1.0, 1.2, 2.2), (0.5, 0.08, 0.05))
    street = write_box(tmp_path / "street.obj", (-300.0, -1.6, -300.0), (300.0, -1.5, 300.0), (0.3, 0.3, 0.3))
    drives = Path((0.0, 4.0), ((-4.0, -0.4, 9.0), (-4.0, -0.4, -9.0)), curved=False)
    still = Path.resting()
    dark_below = Window((-180.0, 180.0), (-90.0, 0.0))  # what the street hides in the renderer
    sky = Environment.constant((SKY,) * 3).painted(dark_below, (0.0, 0.0, 0.0))
    rig = Rig(
        sky.with_disc(SUN),
        outside=Outside((OutsideObject(street, still), OutsideObject(van, drives)), samples=4, bounce=False),
    )
    live = Shells(*room())
    windows = [(-1.0, 0.0, z) for z in (3.0, 0.0, -3.0)]
    ours, theirs = [], []
    for seconds in MOMENTS:
        live.light(rig.at(seconds))
        place = np.array(drives.at(seconds).position)
        meshes = [(street, np.zeros(3), (0.3,) * 3), (van, place, (0.5, 0.08, 0.05))]
        for window in windows:
            shell = live.shell_of(window, R, discs=False)
            reference = path_traced(meshes, np.array(window))
            difference = np.abs(shell - reference).mean() / reference.mean()
            assert difference < 0.013, f"{seconds} s, window {window}"
            assert shell.mean() == pytest.approx(reference.mean(), rel=0.005)
            ours.append(shell[1, ..., 1].mean())
            theirs.append(reference[1, ..., 1].mean())
    ours, theirs = (np.array(x).reshape(len(MOMENTS), 3) for x in (ours, theirs))
    assert np.array_equal(ours.argmin(axis=0), theirs.argmin(axis=0))
    assert ours.argmin(axis=0).tolist() == [0, 1, 2]
    assert ours == pytest.approx(theirs, rel=0.02)
