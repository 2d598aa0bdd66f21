"""Make caustics.png: python docs/pictures/caustics.py FOLDER, where the bake is kept, a minute or two of work.

A brass ring, a ball of clear glass and one of green on a pale floor, under a dim sky and a sun: direct light alone, and
with what glass, brass and floor send on.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import prelight as pl
from prelight.material import Material
from prelight.scene.geometry import Scene
from prelight.scene.stock.parts import Part, rectangle, scene_of, split_quads, together
from prelight.scene.stock.revolved import Profile

DIELECTRIC = {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0}
GREEN = {"type": "rgb", "value": [0.25, 0.95, 0.45]}
FLOOR = Material("floor", (0.72, 0.7, 0.66))
GLASS = Material("glass", (0.1, 0.1, 0.1), bsdf=DIELECTRIC)
GREEN_GLASS = Material("green glass", (0.03, 0.12, 0.05), bsdf=DIELECTRIC | {"specular_transmittance": GREEN})
BRASS = Material("brass", (0.75, 0.55, 0.28), metallic=1.0, roughness=0.12)
EYE = pl.Camera(eye=(0.15, 1.25, 1.9), target=(0.02, 0.02, -0.02), vertical_fov_deg=30)
SKY = pl.Environment.constant((0.25, 0.3, 0.38)).with_discs(
    (pl.Disc(direction=(-0.75, 0.62, -0.35), radius_deg=0.5, radiance=(9500, 8600, 7200)),)
)


def ball(radius: float, x: float, z: float) -> Part:
    angles = np.linspace(-np.pi / 2, np.pi / 2, 33)
    profile = Profile(tuple((max(float(radius * np.cos(t)), 0.0), float(radius * np.sin(t))) for t in angles))
    return profile.part(along=40, around=80).moved((x, radius + 0.004, z))


def ring(
    x: float, z: float, *, inner: float = 0.27, outer: float = 0.28, height: float = 0.11, around: int = 160
) -> Part:
    """A short pipe: four faces with normals of their own."""
    turn = 2 * np.pi * np.arange(around + 1) / around
    c, s = np.cos(turn), np.sin(turn)
    low, high = 0.002, 0.002 + height

    def band(first: tuple[float, float], second: tuple[float, float], out: float, up: float) -> Part:
        places = [np.stack([r * c, np.full_like(c, y), r * s], axis=1) for r, y in (first, second)]
        k = np.arange(around)
        quads = np.stack([k, k + around + 1, k + around + 2, k + 1], axis=1)
        positions = np.concatenate(places)
        normals = np.concatenate([np.stack([out * c, np.full_like(c, up), out * s], axis=1)] * 2)
        return Part(positions, normals, split_quads(positions, quads))

    bands = [
        band((outer, low), (outer, high), 1.0, 0.0),
        band((outer, high), (inner, high), 0.0, 1.0),
        band((inner, high), (inner, low), -1.0, 0.0),
        band((inner, low), (outer, low), 0.0, -1.0),
    ]
    return together(bands).moved((x, 0.0, z))


def scene() -> Scene:
    floor = rectangle(
        np.array([-1.1, 0, -1.0]), np.array([0.0, 0, 1.9]), np.array([2.2, 0, 0]), cells=(150, 174)
    )
    parts = [
        (floor, FLOOR), (ring(0.42, 0.12), BRASS), (ball(0.2, -0.42, 0.18), GLASS),
        (ball(0.13, -0.1, -0.35), GREEN_GLASS),
    ]  # fmt: skip
    return scene_of("caustics", parts, cameras={"front": EYE})


def main() -> None:
    folder, panes, made = Path(sys.argv[1]), [], scene()
    path = folder / "caustics.prelight"
    if not path.exists():
        pl.bake_environment(made, path, resolution=32, tolerance=0.05, gather_rays=256)
    for bounced in (False, True):
        light = pl.Relighter(path, bounced=bounced)
        light.environment = SKY
        picture = light.picture("front", width=800, height=600, background=(0.02, 0.02, 0.02))
        panes.append(picture.display(exposure=-0.2))
    Image.fromarray(np.hstack(panes)).save(Path(__file__).with_name("caustics.png"), optimize=True)


if __name__ == "__main__":
    main()
