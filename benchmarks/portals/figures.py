"""The paper's figures 2, 8 and 10 of our box, as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from boxes import BEHIND, CASES, OUTWARD, Case, emitter_of, lit_box, open_box, sky
from measuring import baked
from points import Points, of_picture, truth_at
from refining import light_at_vertices
from window_emitter import lit_sides

import rooms
from prelight.baking.portals_refining import refined
from prelight.baking.portals_settings import PortalsSettings
from prelight.bases.harmonic_cells import cell_harmonics
from prelight.camera import Camera
from prelight.drawing.figures import difference_picture, panels, save_figure
from prelight.drawing.plots import Axis, line_plot
from prelight.images.tonemap import srgb_encode
from prelight.lighting.rig import Rig
from prelight.scene.geometry import Scene

PICTURES = Path(__file__).parent / "results" / "pictures"
WIDE, HIGH = 160, 120  # pixels of what the path tracer makes
CLOSE = Camera(eye=(2.75, 1.35, 0.75), target=(1.6, 0.15, 1.55), vertical_fov_deg=52.0)
CLOSE_SIZE = (360, 270)
COARSE = "bun_zipper_res3.ply"
SAMPLES, STRIPS, TIMES = 512, 3, 2


def figure_10(data: Path, work: Path) -> dict[str, Any]:
    """The paper's figure 10: four windows; direct light, bounced, ours, true, and what differs."""
    images, captions = [], []
    names = {
        "small": "a small window",
        "large": "a large one",
        "tinted": "bluish glass",
        "frosted": "frosted, 15°",
    }
    for name, caption in names.items():
        light, scene, _ = lit_box(data, work, CASES[name])
        at, there = _seen(scene)
        images.append(_picture(_shown(scene, at, light.irradiance), there))
        captions.append(caption)
    light, scene, _ = lit_box(data, work, CASES["large"])
    at, there = _seen(scene)
    parts = {
        "direct light": light.direct,
        "bounced light": light.irradiance - light.direct,
        "ours": light.irradiance,
    }
    for caption, irradiance in parts.items():
        images.append(_picture(_shown(scene, at, irradiance), there))
        captions.append(caption)
    true = _reference(data, work, CASES["large"])
    images.append(_picture(true, there))
    captions.append("path tracer")
    ours, factor = _shown(scene, at, light.irradiance), 5.0
    white = 1 / _gain(true)
    images.append(_enlarged(difference_picture(_whole(ours, there), _whole(true, there), factor=factor, white=white,
                                               legend=False)))  # fmt: skip
    captions.append(f"|difference|, {factor:g} times: black 0 to pale {white / factor:.2g}, a fifth of white")
    _save(panels(images, captions, columns=3), "figure-10.png")
    return {
        "difference": float(np.abs(ours - true).mean() / true.mean()),
        "samples": SAMPLES,
        "pixels": int(there.sum()),
    }


def figure_2(data: Path, work: Path) -> dict[str, Any]:
    """The paper's figure 2: direct light through a small window in harmonics of order 10, beside ours and the truth."""
    case = Case(window=rooms.SMALL)
    scene, cube = rooms.box(data, window=case.window), sky(data, BEHIND).cube(32)
    light, room, _ = baked(scene, work / "figure.prelight", PortalsSettings(rays=2048, bounces=0))
    light.light(Rig(sky(data, BEHIND)))
    means, integrals = cell_harmonics(10, light.layer.cube)
    blurred = (means @ (integrals.T @ cube.reshape(-1, 3))).astype(np.float32)
    rows = np.zeros_like(light.direct)
    rows[light.layer.receiver] = light.layer.rows.times(np.ascontiguousarray(blurred))
    at, there = _seen(room.open)
    kept = work / "figure-2.npz"
    if not kept.exists():
        true = truth_at(room.open, at, emitter_of(data, case), samples=256, bounces=0)
        np.savez(kept, direct=true.direct)
    true = np.load(kept)["direct"] * at.of(room.open, room.open.albedo.astype(np.float64))
    shown = [true, *(_shown(room.open, at, x) for x in (light.direct, rows))]
    images = [_picture(np.maximum(x, 0), there, gain=_gain(true)) for x in shown]
    captions = ["direct light, path tracer", "ours: pulses in bytes", "spherical harmonics of order 10"]
    _save(panels(images, captions), "figure-2.png")
    off = [float(np.abs(x - true).mean() / true.mean()) for x in shown[1:]]
    negative = float((shown[2].mean(axis=1) < 0).mean())
    return {"ours": off[0], "harmonics": off[1], "negative_share": negative, "samples": 256}


def figure_refined(data: Path, work: Path) -> dict[str, Any]:
    """A bunny's shadow on an even mesh and on a refined one of as many triangles, beside the path tracer."""
    cube, case = lit_sides(sky(data, BEHIND).cube(32), OUTWARD), CASES["small"]
    even = rooms.box(data, window=rooms.SMALL, cells=36, bunny=COARSE)
    fine = refined(rooms.box(data, window=rooms.SMALL, cells=18, bunny=COARSE), PortalsSettings(), factor=2.4)
    images, captions, counts = [], [], []
    for scene, words in ((even, "even"), (fine, "refined")):
        room, light = light_at_vertices(scene, cube)
        at, there = _seen(room.open, CLOSE, CLOSE_SIZE)
        images.append(_shown(room.open, at, light))
        counts.append(len(scene.triangles))
        captions.append(f"{words}: {counts[-1]:,} triangles")
    bare = room.open  # the same surfaces
    at, there = _seen(bare, CLOSE, CLOSE_SIZE)
    kept = work / "figure-refined.npz"
    if not kept.exists():
        np.savez(kept, direct=truth_at(bare, at, emitter_of(data, case), samples=256, bounces=0).direct)
    images.append(np.load(kept)["direct"] * at.of(bare, bare.albedo.astype(np.float64)))
    captions.append("path tracer")
    gain = 0.8 / float(np.percentile(images[2], 98))
    shown = [_picture(image, there, gain=gain) for image in images]
    _save(panels(shown, captions), "figure-refined.png")
    off = [float(np.abs(image - images[2]).mean() / images[2].mean()) for image in images[:2]]
    return {"triangles": counts, "difference": off, "samples": 256}


def energies(found: dict[str, Any]) -> None:
    """The paper's figure 8, from what the part ``orders`` found: energy of each order, and held up to it."""
    of_order, held = {}, {}
    for name, words in (("large", "1.5 m window"), ("small", "0.375 m window")):
        for c, colour in enumerate(("red", "green", "blue")):
            energy = np.array(found[name]["energy"], np.float64)[:, c]
            orders = np.arange(len(energy), dtype=np.float64)
            of_order[f"{words}, {colour}"] = (orders, energy / energy.max())
            held[f"{words}, {colour}"] = (orders, np.array(found[name]["held"], np.float64)[:, c])
    one = line_plot(
        of_order, x=Axis("order", log=False), y=Axis("most energy, of the largest"), size=(820, 460)
    )
    two = line_plot(
        held, x=Axis("order", log=False), y=Axis("share held up to it", log=False), size=(820, 460)
    )
    _save(panels([one, two], ["Eq. 5: the most that one order brings", "summed"], columns=1), "orders.png")


def _seen(
    scene: Scene, camera: Camera = rooms.EYE, size: tuple[int, int] = (WIDE, HIGH)
) -> tuple[Points, np.ndarray]:
    return of_picture(scene, camera, width=size[0], height=size[1])


def _shown(scene: Scene, at: Points, irradiance: np.ndarray) -> np.ndarray:
    return at.of(scene, irradiance.astype(np.float64)) * at.of(scene, scene.albedo.astype(np.float64))


def _reference(data: Path, work: Path, case: Case) -> np.ndarray:
    """Radiance of the pixels that see something, strip after strip, each kept."""
    scene = open_box(data, case.window)
    at, _ = _seen(scene)
    parts = []
    for k in range(STRIPS):
        path = work / f"picture-{case.reference}-{k}.npz"
        ends = np.linspace(0, len(at.triangle), STRIPS + 1).astype(int)
        own = Points(at.triangle[ends[k] : ends[k + 1]], at.weights[ends[k] : ends[k + 1]])
        if not path.exists():
            found = truth_at(scene, own, emitter_of(data, case), samples=SAMPLES, seed=k)
            np.savez(path, total=found.total)
        parts.append(np.load(path)["total"])
    return np.concatenate(parts) * at.of(scene, scene.albedo.astype(np.float64))


def _gain(radiance: np.ndarray) -> float:
    return 0.9 / float(np.percentile(radiance, 97))


def _whole(radiance: np.ndarray, there: np.ndarray) -> np.ndarray:
    out = np.zeros((len(there), 3), np.float32)
    out[there] = radiance
    return out.reshape(*_shape(there), 3)


def _shape(there: np.ndarray) -> tuple[int, int]:
    """Rows and columns of a picture that is four by three."""
    high = round((len(there) * 3 / 4) ** 0.5)
    return high, len(there) // high


def _picture(radiance: np.ndarray, there: np.ndarray, *, gain: float | None = None) -> np.ndarray:
    linear = _whole(radiance, there) * (gain or _gain(radiance))
    linear[~there.reshape(_shape(there))] = 1.0  # the sky in the window
    shown = np.rint(srgb_encode(linear) * 255).astype(np.uint8)
    return shown if len(shown) > HIGH else _enlarged(shown)


def _enlarged(image: np.ndarray) -> np.ndarray:
    return image.repeat(TIMES, axis=0).repeat(TIMES, axis=1)


def _save(image: np.ndarray, name: str) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    save_figure(image, PICTURES / name, force=True)
