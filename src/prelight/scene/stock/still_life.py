"""A still life that gloss deserves: lacquer, glazed ware, fruit, brass and steel on a matte table by a matte wall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...camera import Camera
from ...errors import InputError
from ...material import Material
from ..geometry import Scene
from .band import Band
from .cloth import Napkin
from .parts import Part, rectangle, scene_of
from .patterns import glazed, oak
from .plinth import slab
from .revolved import Profile

# Linear Rec.709. Microfacets are never narrower than roughness 0.15: a cluster of lights must resolve the highlight.
LACQUER = Material(
    "lacquer", (0.010, 0.085, 0.082), roughness=0.32, specular=1.0, clearcoat=1.0, clearcoat_roughness=0.16
)
GLAZE = Material("glaze", (1.0, 1.0, 1.0), colour_texture=0, roughness=0.2, specular=1.0)
ORANGE = Material("orange", (0.70, 0.235, 0.022), roughness=0.42, specular=1.0)
LEMON = Material("lemon", (0.74, 0.52, 0.045), roughness=0.45, specular=1.0)
PEAR = Material("pear", (0.36, 0.37, 0.055), roughness=0.38, specular=1.0)
STEM = Material("stem", (0.075, 0.045, 0.025))
BRASS = Material("brass", (0.86, 0.62, 0.28), roughness=0.36, metallic=1.0)
STEEL = Material("steel", (0.66, 0.645, 0.62), roughness=0.34, metallic=1.0)
LINEN = Material("linen", (0.66, 0.62, 0.55))
OAK = Material("oak", (1.0, 1.0, 1.0), colour_texture=1)
WALL = Material("wall", (0.44, 0.415, 0.375))

TABLE = 0.76  # metres above the ground, which is not there
GAP = 0.0008  # rays begin 0.4 mm off a surface, and must not begin inside another
TURN_DEG = -16.0  # table and wall face the key light, which the stock environments have on the left

CAMERAS = {
    "front": Camera(eye=(0.08, 1.24, 1.66), target=(0.03, 0.84, 0.04), vertical_fov_deg=23.6),
    "close": Camera(eye=(0.20, 1.07, 0.98), target=(0.09, 0.83, 0.05), vertical_fov_deg=23.0),
}

VASE_AT, BOWL_AT, PEAR_AT = (-0.25, -0.10), (0.13, -0.02), (0.33, 0.085)  # x and z
RING_AT, BALL_AT = (-0.139, 0.002), (-0.195, 0.125)
RING_LEAN_DEG, RING_TURN_DEG = 24.0, 50.0
BOARDS = 0.8  # metres of the table for a texture

VASE = Profile((
    (0.0, 0.0), (0.040, 0.0), (0.052, 0.001), (0.052, 0.006), (0.056, 0.03), (0.095, 0.09), (0.118, 0.165),
    (0.098, 0.235), (0.042, 0.275), (0.026, 0.315), (0.024, 0.355), (0.040, 0.382), (0.046, 0.387), (0.043, 0.391),
    (0.034, 0.382), (0.018, 0.350), (0.018, 0.315), (0.034, 0.275), (0.085, 0.225), (0.104, 0.165), (0.085, 0.10),
    (0.045, 0.035), (0.0, 0.022),
))  # fmt: skip
BOWL = Profile((
    (0.0, 0.008), (0.040, 0.008), (0.046, 0.006), (0.047, 0.0), (0.052, 0.0), (0.054, 0.003), (0.055, 0.016),
    (0.095, 0.034), (0.128, 0.070), (0.146, 0.106), (0.151, 0.112), (0.150, 0.115), (0.145, 0.112), (0.124, 0.075),
    (0.090, 0.040), (0.045, 0.022), (0.0, 0.020),
))  # fmt: skip
ORANGE_SHAPE = Profile((
    (0.0, -0.037), (0.018, -0.041), (0.039, -0.030), (0.048, 0.0), (0.040, 0.030), (0.018, 0.041), (0.006, 0.0385),
    (0.0, 0.034),
))  # fmt: skip
LEMON_SHAPE = Profile((
    (0.0, -0.050), (0.010, -0.050), (0.014, -0.043), (0.034, -0.030), (0.041, 0.0), (0.034, 0.030), (0.014, 0.043),
    (0.011, 0.052), (0.0, 0.053),
))  # fmt: skip
STEM_SHAPE = Profile(((0.0, 0.0), (0.003, 0.0), (0.0024, 0.012), (0.0036, 0.03), (0.0, 0.03)))
PEAR_SHAPE = Profile((
    (0.0, 0.006), (0.016, 0.001), (0.036, 0.006), (0.050, 0.040), (0.040, 0.074), (0.024, 0.098), (0.019, 0.118),
    (0.012, 0.129), (0.004, 0.128), (0.0, 0.123),
))  # fmt: skip


def still_life(*, detail: float = 1.0) -> Scene:
    """The still life; about 25,000 · detail² vertices. ``detail`` from 0.2 to 4. Raises InputError beyond."""
    if not 0.2 <= detail <= 4:
        raise InputError("detail", f"{detail}, expected 0.2 to 4")
    parts = [*_vessels(detail), *_fruit(detail), *_metal(detail), *_stand(detail)]
    return scene_of(
        "still-life" if detail >= 1 else "still-life-small",
        parts,
        cameras=CAMERAS,
        textures=(glazed(), oak()),
    )


def _on_table(part: Part, x: float, z: float, *, turn: float = 0.0) -> Part:
    """Its lowest point GAP above the table."""
    return part.turned(turn).moved((x, TABLE + GAP - part.positions[:, 1].min(), z))


def _lathed(profile: Profile, detail: float, counts: tuple[int, int], *, textured: bool = False) -> Part:
    """``counts`` of rings and of vertices around, at detail 1."""
    along, around = max(6, round(counts[0] * detail)), 2 * max(4, round(counts[1] * detail / 2))
    return profile.part(along=along, around=around, textured=textured)


def _vessels(detail: float) -> list[tuple[Part, Material]]:
    vase = _lathed(VASE, detail, (88, 72))
    bowl = _lathed(BOWL, detail, (60, 72), textured=True)
    return [(_on_table(vase, *VASE_AT), LACQUER), (_on_table(bowl, *BOWL_AT, turn=40), GLAZE)]


def _fruit(detail: float) -> list[tuple[Part, Material]]:
    orange = _lathed(ORANGE_SHAPE, detail, (26, 34))
    lemon = _lathed(LEMON_SHAPE, detail, (26, 30))
    pear = _lathed(PEAR_SHAPE, detail, (34, 34))
    stem = _lathed(STEM_SHAPE, detail, (10, 10))
    x, z = BOWL_AT
    return [
        (orange.tipped(35).turned(20).moved((x - 0.052, TABLE + 0.086, z + 0.030)), ORANGE),
        (orange.tipped(-30).turned(70).moved((x + 0.050, TABLE + 0.087, z + 0.036)), ORANGE),
        (orange.tipped(60).turned(-40).moved((x + 0.0, TABLE + 0.088, z - 0.056)), ORANGE),
        (lemon.tipped(80).turned(65).moved((x + 0.002, TABLE + 0.150, z + 0.004)), LEMON),
        (_on_table(pear, *PEAR_AT), PEAR),
        (_on_table(stem.tipped(9), *PEAR_AT).moved((0.0, 0.1245, 0.0)), STEM),
        (_on_table(lemon.tipped(90), 0.0, 0.165, turn=-35), LEMON),
    ]


def _metal(detail: float) -> list[tuple[Part, Material]]:
    ball = _lathed(Profile(_half_circle(0.036)), detail, (30, 36))
    ring = Band(
        curve=lambda u: 0.072 * np.stack([np.cos(u), np.sin(u), 0 * u], axis=-1),
        half_width=lambda u: 0.0115 + 0 * u,
        half_thickness=lambda u: 0.0115 + 0 * u,
        angle=lambda u: 0 * u,
    ).part(along=max(16, round(72 * detail)), around=2 * max(4, round(9 * detail)))
    return [
        (_on_table(ring.tipped(-RING_LEAN_DEG), *RING_AT, turn=RING_TURN_DEG), BRASS),
        (_on_table(ball, *BALL_AT), STEEL),
    ]


def _half_circle(radius: float) -> tuple[tuple[float, float], ...]:
    """Control points of a sphere's profile, a little outside it."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 15)
    out = radius / (1 - (angle[1] - angle[0]) ** 2 / 6)  # the spline runs inside its points by so much
    x, y = out * np.cos(angle), out * np.sin(angle)
    x[[0, -1]] = 0.0
    return tuple(zip(x.tolist(), y.tolist(), strict=True))


def _stand(detail: float) -> list[tuple[Part, Material]]:
    """Table, napkin and wall; all turned towards the light."""
    x, y, _ = np.eye(3)
    half = (0.78, 0.40)
    cells = max(8, round(74 * detail)), max(6, round(40 * detail)), max(2, round(4 * detail))
    top = slab(half=half, height=0.05, chamfer=0.005, gap=0.0, cells=cells)
    down = top.positions[:, 2] + 0.05 - top.positions[:, 1]  # the grain goes on over the edge
    top = replace(top, uv=np.stack([top.positions[:, 0], down], axis=1) / BOARDS)
    napkin = Napkin(side=0.33, turn_deg=36.0, ahead=0.05).part(max(12, round(50 * detail)))
    cells = max(8, round(64 * detail)), max(6, round(44 * detail))
    wall = rectangle(np.array([-1.7, 0.10, -0.52]), 3.4 * x, 1.75 * y, cells=cells)
    placed = [
        (top.moved((0.0, TABLE - 0.05, -0.04)), OAK),
        (napkin.moved((0.225, TABLE, half[1] - 0.04)), LINEN),
        (wall, WALL),
    ]
    return [(part.turned(TURN_DEG), of) for part, of in placed]
