"""A small car with an interior, to drive through a town: seats, a dashboard, a wheel, and six panes of glass.

It stands on the ground at y = 0 and looks along −Z; the driver sits on the left.
"""

from __future__ import annotations

import numpy as np

from ...camera import Camera
from ...errors import InputError
from ...material import Material
from ..geometry import Scene
from .boxes import Hole, box, hole_of, panel, rim, ring, wheel
from .parts import Part, scene_of, together
from .plinth import slab

# Linear Rec.709; all but the glass Lambertian.
TRIM = Material("trim", (0.085, 0.085, 0.09))
LINING = Material("lining", (0.62, 0.60, 0.55))
LEATHER = Material("leather", (0.46, 0.205, 0.085))
CARPET = Material("carpet", (0.11, 0.105, 0.10))
WHEEL = Material("steering wheel", (0.035, 0.035, 0.035))
PAINT = Material("paint", (0.52, 0.035, 0.03))
TYRE = Material("tyre", (0.03, 0.03, 0.03))

SKIN = 0.06  # between the inner and the outer sheet
FLOOR, BELT, ROOF = 0.28, 0.94, 1.40  # heights inside
HALF, ROOF_HALF = 0.72, 0.57  # half the width at the belt, and of the roof
FRONT, BACK, ROOF_FRONT, ROOF_BACK = -1.05, 1.50, -0.30, 0.98  # z
WHEELS = ((-0.62, -1.45), (0.62, -1.45), (-0.62, 1.25), (0.62, 1.25))
_X, _Y, _Z = np.eye(3)

SCREEN: Hole = ((0.05, 0.95), (0.10, 0.93))
SIDES: tuple[Hole, ...] = (((0.13, 0.50), (0.09, 0.91)), ((0.56, 0.90), (0.09, 0.91)))

CAMERAS = {
    "front": Camera(eye=(0.10, 1.17, 1.12), target=(-0.04, 0.98, -1.0), vertical_fov_deg=74.0),
    "close": Camera(eye=(-0.36, 1.16, 0.22), target=(-0.20, 0.98, -1.6), vertical_fov_deg=72.0),
}


def car(*, detail: float = 1.0) -> Scene:
    """The car; about 27,000 · detail² vertices. ``detail`` from 0.2 to 4; raises InputError beyond."""
    if not 0.2 <= detail <= 4:
        raise InputError("detail", f"{detail}, expected 0.2 to 4")
    step = 0.034 / detail
    inner, outer = _sheets(0.0), _sheets(SKIN)
    parts: list[tuple[Part, Material]] = []
    for name, (corners, out) in inner.items():
        holes = _holes(name)
        material = CARPET if name == "floor" else LINING if name == "roof" or holes else TRIM
        parts.append((panel(corners, -out, step=step, holes=holes), material))
        parts.append((panel(outer[name][0], out, step=5 * step, holes=holes), PAINT))
        rims = [rim(hole_of(corners, hole), hole_of(outer[name][0], hole), step=step) for hole in holes]
        if rims:
            parts.append((together(rims), TRIM))
    parts += [*_fittings(detail), *_coachwork(step)]
    for name, (corners, out) in inner.items():
        for hole, label in zip(_holes(name), _labels(name), strict=True):
            middle = 0.5 * (hole_of(corners, hole) + hole_of(outer[name][0], hole))
            glass = Material(
                f"{label} glass", (0.90, 0.94, 0.93), roughness=0.0, specular=1.0, transmission=1.0
            )
            parts.append((panel(middle, out, step=0.2), glass))
    return scene_of("car" if detail >= 1 else "car-small", parts, cameras=CAMERAS)


def _sheets(skin: float) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The corners of each panel (lower left and right, upper left and right), and its outward direction."""
    half, roof_half = HALF + skin, ROOF_HALF + 0.8 * skin
    low, belt, roof = FLOOR - skin, BELT, ROOF + skin
    front, back = FRONT - skin, BACK + skin
    roof_front, roof_back = ROOF_FRONT - 0.5 * skin, ROOF_BACK + 0.5 * skin

    def across(y: float, z: float, w: float) -> list[tuple[float, float, float]]:
        return [(-w, y, z), (w, y, z)]

    def along(sign: float, y: float, w: float, ends: tuple[float, float]) -> list[tuple[float, float, float]]:
        return [(sign * w, y, ends[0]), (sign * w, y, ends[1])]

    sheets = {
        "floor": (across(low, front, half) + across(low, back, half), -_Y),
        "roof": (across(roof, roof_front, roof_half) + across(roof, roof_back, roof_half), _Y),
        "bulkhead": (across(low, front, half) + across(belt, front, half), -_Z),
        "boot": (across(low, back, half) + across(belt, back, half), _Z),
        "windscreen": (across(belt, front, half) + across(roof, roof_front, roof_half), -_Z),
        "rear window": (across(belt, back, half) + across(roof, roof_back, roof_half), _Z),
    }
    for name, sign in (("left", -1.0), ("right", 1.0)):
        out = sign * _X
        sheets[f"{name} door"] = (
            along(sign, low, half, (front, back)) + along(sign, belt, half, (front, back)), out
        )  # fmt: skip
        sheets[f"{name} windows"] = (
            along(sign, belt, half, (front, back)) + along(sign, roof, roof_half, (roof_front, roof_back)), out
        )  # fmt: skip
    return {name: (np.array(corners), out) for name, (corners, out) in sheets.items()}


def _holes(name: str) -> tuple[Hole, ...]:
    if name in ("windscreen", "rear window"):
        return (SCREEN,)
    return SIDES if name.endswith("windows") else ()


def _labels(name: str) -> tuple[str, ...]:
    side = name.partition(" ")[0]
    return (f"{side} front", f"{side} back") if name.endswith("windows") else (name,)[: len(_holes(name))]


def _fittings(detail: float) -> list[tuple[Part, Material]]:
    """Seats, dashboard and steering wheel; nothing touches the panels."""
    n = max(3, round(9 * detail))
    seats = []
    for x in (-0.36, 0.36):
        seats += _seat(0.235, n, (x, FLOOR + 0.16, 0.12))
    seats += _seat(0.60, n, (0.0, FLOOR + 0.16, 0.98), wide=2 * n)
    dash = slab(half=(0.69, 0.17), height=0.24, chamfer=0.03, gap=0.0, cells=(4 * n, n, n)).moved(
        (0, 0.66, -0.86)
    )
    binnacle = slab(half=(0.17, 0.09), height=0.09, chamfer=0.025, gap=0.0, cells=(n, n, n)).moved(
        (-0.36, 0.905, -0.79)
    )
    console = slab(half=(0.085, 0.42), height=0.22, chamfer=0.02, gap=0.0, cells=(n, 2 * n, n)).moved(
        (0, FLOOR + 0.004, -0.22)
    )
    rim_ = ring(0.178, 0.0135, around=max(16, round(40 * detail)), across=max(6, round(10 * detail)))
    spokes = [
        box((-0.172, -0.016, -0.006), (0.172, 0.016, 0.006), step=0.05),
        box((-0.016, -0.172, -0.006), (0.016, 0.0, 0.006), step=0.05),
    ]
    steering = together([rim_, *spokes]).tipped(-24.0).moved((-0.36, 0.90, -0.56))
    return [(together(seats), LEATHER), (together([dash, binnacle, console]), TRIM), (steering, WHEEL)]


def _seat(half: float, n: int, at: tuple[float, float, float], *, wide: int | None = None) -> list[Part]:
    across = wide or n
    cushion = slab(half=(half, 0.25), height=0.15, chamfer=0.035, gap=0.0, cells=(across, n, max(2, n // 3)))
    back = slab(half=(half, 0.06), height=0.54, chamfer=0.032, gap=0.0, cells=(across, max(2, n // 3), n))
    rest = slab(half=(0.13, 0.04), height=0.15, chamfer=0.03, gap=0.0, cells=(n, 2, max(2, n // 2)))
    x, y, z = at
    back = back.tipped(14.0).moved((x, y + 0.14, z + 0.20))
    parts = [cushion.moved(at), back]
    for k in (0,) if wide is None else (-1, 1):
        parts.append(rest.tipped(14.0).moved((x + 0.3 * k, y + 0.70, z + 0.345)))
    return parts


def _coachwork(step: float) -> list[tuple[Part, Material]]:
    """Bonnet, boot and wheels: seen from outside, and the bonnet through the windscreen."""
    bonnet = slab(half=(0.74, 0.47), height=0.88, chamfer=0.06, gap=0.36, cells=(10, 8, 5)).moved(
        (0, 0, FRONT - SKIN - 0.475)
    )
    boot = slab(half=(0.74, 0.26), height=0.92, chamfer=0.06, gap=0.36, cells=(8, 4, 5)).moved(
        (0, 0, BACK + SKIN + 0.265)
    )
    tyre = wheel(0.31, 0.19, around=20)
    wheels = [tyre.moved((x, 0.315, z)) for x, z in WHEELS]
    return [(together([bonnet, boot]), PAINT), (together(wheels), TYRE)]
