"""Pictures beside each other as in the paper; they lie in results/pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import measuring
import numpy as np
from PIL import Image, ImageDraw

from prelight.drawing.figures import panels, save_figure
from prelight.drawing.view import View
from prelight.relighting.cloud import CloudRelighter
from prelight.relighting.cloud_figure import cloud_figure
from prelight.scene.geometry import Scene
from prelight.storage.bake import Bake
from scenes import baked

HERE = Path(__file__).parent / "results" / "pictures"
SIZE = (480, 360)
# A lamp of the paper's kind in each scene: where it shows what its figure shows.
LAMPS = {
    "cornell": (0.25, 0.75, 0.1), "cornell-small": (0.25, 0.75, 0.1), "window": (-0.78, 0.61, -0.04),
    "window-small": (-0.78, 0.61, -0.04), "maze": (0.85, 0.3, 2.65), "maze-small": (0.85, 0.3, 2.65),
    "sponza": (2.0, 1.5, 0.3),
}  # fmt: skip


def _shown(bake: Bake, lights: list[np.ndarray]) -> list[np.ndarray]:
    """Pictures of irradiance / π at vertices, all by one exposure."""
    receivers = bake.receivers
    camera = next(iter(bake.cameras.values()))
    view = View(receivers.positions, bake.triangles, camera=camera, width=SIZE[0], height=SIZE[1])
    pictures = [view.draw(np.maximum(receivers.albedo * light, 0)) for light in lights]
    stops = pictures[-1].stops("auto")
    return [np.asarray(picture.display(exposure=stops)) for picture in pictures]


def of_scene(name: str, bake: Bake) -> list[str]:
    """Direct, indirect and all light of a lamp; the cloud's lights before and after clustering for a zone."""
    HERE.mkdir(parents=True, exist_ok=True)
    light = CloudRelighter(bake)
    light.shine([measuring.point(np.array(LAMPS[name]))])
    images = _shown(bake, [light.direct, light.indirect, light.irradiance])
    save_figure(panels(images, ["direct", "indirect", "all light"]), HERE / f"{name}-light.png", force=True)
    zone = len(light.layer.zone_rows) // 2
    cloud_figure(bake.path, HERE / f"{name}-lights.png", zone=zone, force=True)
    return [f"{name}-light.png", f"{name}-lights.png"]


def of_coefficients(scene: Scene, work: Path, counts: tuple[int, ...]) -> None:
    """Figure 8: indirect light of one lamp by so many coefficients a vertex."""
    HERE.mkdir(parents=True, exist_ok=True)
    shown, bake = [], None
    for count in counts:
        bake, _ = baked("cornell-small", scene, work, coefficients=count)
        light = CloudRelighter(bake)
        light.shine([measuring.point(np.array(LAMPS["cornell"]))])
        shown.append(light.indirect)
    assert bake is not None
    images = _shown(bake, shown)
    save_figure(
        panels(images, [f"{n} coefficients" for n in counts], columns=3),
        HERE / "coefficients.png",
        force=True,
    )


def chart(path: Path, curves: dict[str, list[tuple[float, float]]], *, labels: tuple[str, str]) -> None:
    """Lines over logarithmic or even axes are enough for four points: numbers stand beside them in the tables."""
    width, height, left, low = 720, 420, 70, 360
    image = Image.new("RGB", (width, height), "white")
    draw = ImageDraw.Draw(image)
    points = [p for curve in curves.values() for p in curve]
    xs, ys = (sorted({p[k] for p in points}) for k in (0, 1))
    x0, x1, y1 = min(xs), max(xs), max(ys)

    def at(x: float, y: float) -> tuple[float, float]:
        return left + (x - x0) / max(x1 - x0, 1e-9) * (width - left - 160), low - y / y1 * (low - 30)

    draw.line([(left, 20), (left, low), (width - 140, low)], fill=(120, 120, 120))
    for y in np.linspace(0, y1, 5):
        draw.line([at(x0, y), at(x1, y)], fill=(230, 230, 230))
        draw.text((8, at(x0, y)[1] - 6), f"{y:.3g}", fill=(60, 60, 60))
    for x in xs if len(xs) < 9 else xs[:: max(1, len(xs) // 8)]:
        draw.text((at(x, 0)[0] - 8, low + 6), f"{x:g}", fill=(60, 60, 60))
    colours = [(24, 96, 168), (200, 84, 24), (60, 130, 60)]
    for (name, curve), colour in zip(curves.items(), colours, strict=False):
        draw.line([at(*p) for p in curve], fill=colour, width=3)
        draw.text((at(*curve[-1])[0] + 8, at(*curve[-1])[1] - 6), name, fill=colour)
    draw.text((left, height - 24), labels[0], fill=(60, 60, 60))
    draw.text((left, 2), labels[1], fill=(60, 60, 60))
    path.parent.mkdir(parents=True, exist_ok=True)
    image.save(path)


def falloff(found: dict[str, Any]) -> None:
    """Figure 5 in kind."""
    curves = {
        part: [(float(k + 1), 1 - float(share)) for k, share in enumerate(values)]
        for part, values in found.items()
    }
    chart(HERE / "falloff.png", curves, labels=("components", "share of the variation that is left"))
