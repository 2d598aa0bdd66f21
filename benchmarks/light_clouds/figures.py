"""Pictures beside each other as in the paper; they lie in results/pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import measuring
import numpy as np

from prelight.camera import Camera
from prelight.drawing.figures import panels, save_figure
from prelight.drawing.plots import Axis, line_plot
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

# Sponza's file has no camera: along the nave at the height of an eye, as in the paper's figure 10.
NAVE = Camera((-11.0, 1.7, 0.4), (4.0, 3.2, 0.0), vertical_fov_deg=50.0)


def _shown(bake: Bake, lights: list[np.ndarray]) -> list[np.ndarray]:
    """Pictures of irradiance / π at vertices, all by one exposure."""
    receivers = bake.receivers
    camera = next(iter(bake.cameras.values()), NAVE)
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
    if not bake.cameras:  # from outside no light of the grid is seen
        return [f"{name}-light.png"]
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


def falloff(found: dict[str, Any]) -> None:
    """Figure 5 in kind."""
    counts = np.arange(1.0, 1 + len(found["direct"]))
    left = {part: (counts, 1 - np.array(share)) for part, share in found.items()}
    axes = Axis("components", log=False), Axis("share of the variation that is left", log=False)
    image = line_plot(left, x=axes[0], y=axes[1], title="Light of the box's back wall")
    save_figure(image, HERE / "falloff.png", force=True)


def growth(found: dict[int, dict[str, Any]]) -> None:
    """What more lights cost, as so many times what the fewest do.

    Seconds of baking are left out: each bake ran beside other work of its own, so they cannot be set beside each other.
    """
    counts = np.array(sorted(found), np.float64)
    costs = {"bytes": "bytes", "milliseconds an update": "milliseconds"}
    lines = {}
    for name, key in costs.items():
        values = np.array([found[int(n)][key] for n in counts], np.float64)
        lines[name] = (counts, values / values[0])
    image = line_plot(
        lines, x=Axis("lights"), y=Axis(f"times that of {counts[0]:.0f} lights"), title="A room"
    )
    save_figure(image, HERE / "growth.png", force=True)
