"""Mixing lamps that do not move, which light groups of Cycles and LuxCore do too: the same scene with 16 and 64 lamps.

Each renderer renders twice with different seeds; the noise of a lamp's picture is what is between the two. So nobody's
idea of a material or a lamp's unit can favour anyone. Time to equal noise is then seconds · (noise / wanted)².
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from setting import Setting

from prelight.baking.steerable import bake_steerable
from prelight.baking.steerable_settings import BakedLamp, SteerableSettings
from prelight.lighting.spot import Spot
from prelight.material import Material
from prelight.relighting.steerable_bake import SteerableBake
from prelight.transport.basis_images import ImageSettings
from prelight.transport.steered_lamps import SteeredSpot

COUNTS, WANTED, RADIUS, ROUNDS = (16, 64), 0.05, 0.02, 21
SAMPLES = {"prelight": 25, "cycles": 256, "luxcore": 256}  # of the runs that are measured


def lamps(count: int) -> np.ndarray:
    """Places on a dome over the board."""
    k = np.arange(count)
    height, turn = 0.25 + 0.7 * (k + 0.5) / count, k * np.pi * (3 - np.sqrt(5))
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(turn), height, across * np.sin(turn)], axis=1) * 0.42 + [0.0, 0.12, 0.0]


def plain_scene(setting: Setting) -> Any:
    """The chessmen without glass, mirrors and gloss: what all three renderers understand alike."""
    scene = setting.scene
    colours = [np.array(m.colour) * (0.4 if m.colour_texture is not None else 1.0) for m in scene.materials]
    materials = tuple(
        Material(f"part {n}", tuple(float(x) for x in colour)) for n, colour in enumerate(colours)
    )
    of_vertex = np.zeros(len(scene.positions), np.int64)
    of_vertex[scene.triangles] = scene.material_of[:, None]
    albedo = np.array(colours, np.float32)[of_vertex]
    return replace(scene, materials=materials, albedo=albedo, tint=None, uv=None, textures=())


def written(scene: Any, setting: Setting, count: int, folder: Path) -> Path:
    """The scene as plain numbers for the others' scripts."""
    camera, path = setting.camera, folder / f"scene{count}.npz"
    np.savez(
        path, positions=scene.positions, triangles=scene.triangles, material_of=scene.material_of,
        colours=np.array([m.colour for m in scene.materials]), lamps=lamps(count),
        intensities=np.full(count, 4.0 / count), radius=RADIUS, eye=np.array(camera.eye), axes=camera.axes(),
        fov=camera.vertical_fov_deg, size=setting.size, depth=setting.depth, threads=os.cpu_count() or 1,
    )  # fmt: skip
    return path


def ours(scene: Any, setting: Setting, count: int, folder: Path) -> dict[str, Any]:
    """Baked twice; then a slider is moved."""
    baked = tuple(
        BakedLamp(f"l{k}", SteeredSpot(tuple(at), 0, RADIUS)) for k, at in enumerate(lamps(count).tolist())
    )
    seconds, processor, pictures, size = [], [], [], 0
    for seed in (0, 1):
        images = ImageSettings(setting.size, setting.size, SAMPLES["prelight"], 0, setting.depth, seed=seed)
        settings = SteerableSettings(baked, "front", images, keep="all")
        started, worked = time.perf_counter(), time.process_time()
        bake = bake_steerable(scene, folder / f"{count}-{seed}.prelight", settings=settings)
        seconds.append(time.perf_counter() - started)
        processor.append(time.process_time() - worked)
        live = SteerableBake(bake)
        layers = live.live.layers.values()
        pictures.append(np.stack([layer.planes.decoded(1)[0] for layer in layers]))
        size = sum(layer.planes.size for layer in layers)
    lights = [Spot((1.0, 1.0, 1.0), direction=(0, -1, 0), layer=one.name) for one in baked]
    rng, taken = np.random.default_rng(0), []
    for _ in range(ROUNDS):
        lights[int(rng.integers(count))] = replace(lights[0], layer=f"l{rng.integers(count)}")
        started = time.perf_counter()
        live.live.light([replace(light, layer=one.name) for light, one in zip(lights, baked, strict=True)])
        taken.append(time.perf_counter() - started)
    return _figures(pictures, (seconds, processor), SAMPLES["prelight"]) | {
        "bytes": size, "slider_milliseconds": 1e3 * statistics.median(taken),
    }  # fmt: skip


def theirs(kind: str, found_at: str, scene: Path, count: int, folder: Path) -> dict[str, Any]:
    """A rival's script, twice, each in a process of its own; why not, where it cannot be."""
    ending = "exr" if kind == "cycles" else "npy"
    seconds, processor, pictures, said = [], [], [], {}
    for seed in (0, 1):
        target = folder / f"{kind}{count}-{seed}.{ending}"
        command = [sys.executable, str(Path(__file__).with_name(f"rival_{kind}.py")), str(scene), str(target)]
        answer = subprocess.run(
            [*command, str(SAMPLES[kind]), str(seed)], env=os.environ | {"PYTHONPATH": found_at}, text=True,
            capture_output=True, check=False, timeout=900,
        )  # fmt: skip
        told = [line for line in answer.stdout.splitlines() if line.startswith("FOUND ")]
        if answer.returncode or not told:
            return {"not_measured": (answer.stderr or answer.stdout).strip().splitlines()[-1:]}
        said = json.loads(told[-1].removeprefix("FOUND "))
        seconds.append(said.pop("seconds"))
        processor.append(said.pop("processor_seconds"))
        pictures.append(groups(target, count) if kind == "cycles" else np.load(target).reshape(count, -1, 3))
    return (
        said
        | _figures(pictures, (seconds, processor), SAMPLES[kind])
        | {"bytes": pictures[0].nbytes, "slider_milliseconds": _dense(pictures[0])}
    )


def groups(path: Path, count: int) -> np.ndarray:
    """All light groups (count, pixels, 3) of a layered OpenEXR file."""
    import OpenEXR

    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = {name: c.pixels for part in file.parts for name, c in part.channels.items()}
    found = []
    for k in range(count):
        named = [
            next(n for n in channels if f"Combined_g{k:02}." in n and n.endswith(f".{c}")) for c in "RGB"
        ]
        found.append(np.stack([channels[name] for name in named], axis=-1))
    return np.stack(found).reshape(count, -1, 3).astype(np.float32)


def _figures(
    pictures: list[np.ndarray], times: tuple[list[float], list[float]], samples: int
) -> dict[str, Any]:
    """Noise of a lamp's picture relative to its RMS, the median lamp's; pixels beyond the 99.5th percentile count
    as that, for a lamp's own sparks are nobody's fault.
    """
    noise = []
    for a, b in zip(*pictures, strict=True):
        left = np.square(a - b, dtype=np.float64).sum(axis=1) / 2
        power = np.square((a + b) / 2, dtype=np.float64).sum(axis=1)
        noise.append(np.sqrt(np.minimum(left, np.percentile(left, 99.5)).mean() / power.mean()))
    typical, (taken, worked) = float(np.median(noise)), map(statistics.median, times)
    return {
        "samples": samples, "seconds": taken, "noise": typical, "wanted_noise": WANTED,
        "seconds_to_wanted_noise": taken * (typical / WANTED) ** 2, "processor_seconds": worked,
        "processor_seconds_to_wanted_noise": worked * (typical / WANTED) ** 2,
    }  # fmt: skip


def _dense(pictures: np.ndarray) -> float:
    """Milliseconds of a sum of float32 pictures with a weight each, as a compositor makes it."""
    flat = pictures.reshape(len(pictures), -1)
    weights = np.random.default_rng(0).random(len(flat)).astype(np.float32)
    taken = []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        weights @ flat
        taken.append(time.perf_counter() - started)
    return 1e3 * statistics.median(taken)


def fixed_lights(setting: Setting) -> dict[str, Any]:
    """Time to equal noise, bytes and time of a slider, of each for 16 and 64 lamps; what was not asked for stays."""
    kept_at = setting.results / "fixed-lights.json"
    before = json.loads(kept_at.read_text()) if kept_at.exists() else {}
    found: dict[str, Any] = {str(count): before.get(str(count), {}) for count in COUNTS}
    scene = plain_scene(setting)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for count in COUNTS if setting.lamps is None else (setting.lamps,):
            own, source = found[str(count)], written(scene, setting, count, folder)
            for kind in SAMPLES if setting.renderer is None else (setting.renderer,):
                place = setting.rivals.get(kind)
                if kind == "prelight":
                    own[kind] = ours(scene, setting, count, folder)
                elif place is not None:
                    own[kind] = theirs(kind, place, source, count, folder)
                else:
                    own.setdefault(kind, {"not_measured": f"no --{kind} FOLDER given"})
                    continue
                own[kind]["size"] = setting.size
    return found
