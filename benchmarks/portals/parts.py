"""What is measured."""

from __future__ import annotations

import resource
from pathlib import Path
from typing import Any

import boxes
import figures
import glossy_box
import numpy as np
import panes
import refining
from beside_three_phase import beside as three_phase_beside
from beside_three_phase import truth as three_phase_truth
from measuring import baked, relights
from sibenik_day import sibenik_day
from sliding import sliding
from sun_reference import sun_reference

import rooms
from prelight.baking.portals_settings import PortalsSettings
from prelight.encoding.pulse_or_haar import tables_of
from prelight.lighting.environment import Environment
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.loading import load_scene
from prelight.scene.portals import PortalWish

PAPER = {"gather_rays": 4096, "bounces": 9, "order": 4}
PICTURES = figures.PICTURES
SIBENIK = str(rooms.HERE / "sibenik.toml")


def _sky(data: Path) -> Environment:
    return boxes.sky(data, boxes.BEFORE)


def _against(name: str, words: str):
    """A part: one of the cases of ``boxes``."""

    def part(data: Path, work: Path) -> dict[str, Any]:
        return boxes.against_path_tracer(data, work, boxes.CASES[name])

    part.__doc__ = f"The paper's box with a bunny {words}, against the path tracer."
    return part


def box_table(data: Path, work: Path) -> dict[str, Any]:
    """The paper's Table 1, the box: minutes, megabytes, relights a second, with its rays and bounces."""
    light, _, figures = baked(
        rooms.box(data), work / "table.prelight", PortalsSettings(rays=4096, suns=False, **PAPER)
    )
    return (
        figures
        | relights(light, _sky(data))
        | {"paper": {"minutes": [12, 11], "megabytes": [90.8, 112.4], "fps": 70}}
    )


def box_million(data: Path, work: Path) -> dict[str, Any]:
    """The box at 1.1 million triangles (300 MB, 27 fps in the paper)."""
    scene = rooms.box(data, cells=307)
    settings = PortalsSettings(rays=1024, gather_rays=256, suns=False, memory=6_000_000_000)
    light, _, figures = baked(scene, work / "million.prelight", settings)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    return (
        figures
        | relights(light, _sky(data))
        | {"memory_gigabytes": most, "paper": {"megabytes": 300, "fps": 27}}
    )


def sibenik_table(data: Path, work: Path) -> dict[str, Any]:
    """The paper's Table 1, Sibenik: 16,384 rays, 4,096 gather rays, nine bounces, about 186,000 triangles."""
    scene = rooms.sibenik(data, subdivide=0.8)
    settings = PortalsSettings(PortalWish(file=SIBENIK), rays=16384, suns=False, **PAPER)
    light, _, figures = baked(scene, work / "sibenik.prelight", settings)
    return (
        figures
        | relights(light, _sky(data))
        | {"paper": {"minutes": [56, 14], "megabytes": [87.0, 35.3], "fps": 16}}
    )


def car_table(data: Path, work: Path) -> dict[str, Any]:
    """The paper's Table 1, a car: our own, in so many triangles as it has."""
    light, _, figures = baked(
        load_scene("stock:car"), work / "car.prelight", PortalsSettings(rays=16384, suns=False, **PAPER)
    )
    return (
        figures
        | relights(light, _sky(data))
        | {"paper": {"minutes": [60, 23], "megabytes": [70.6, 34.2], "fps": 12}}
    )


def choice(data: Path, work: Path) -> dict[str, Any]:
    """Pulses or Haar: bytes for small and large windows, cubes of 32 and 64, and walls of glass."""
    out: dict[str, Any] = {
        "paper": "pulses 3 to 4 times smaller for small portals; Haar down to 40 % for large"
    }
    for name, window in (("small", rooms.SMALL), ("large", rooms.LARGE), ("wall", 2.9)):
        for cube in (32, 64):
            scene = rooms.box(data, window=window, cells=24, bunny="bun_zipper_res3.ply")
            settings = PortalsSettings(cube=cube, rays=8192, bounces=0)
            light, _, figures = baked(scene, work / "choice.prelight", settings)
            out[f"{name}-{cube}"] = {
                "haar_over_pulses": figures["haar_megabytes"] / figures["pulse_megabytes"],
                "haar_rows": figures["haar_rows"] / figures["rows"],
                "row_error": figures["row_error"],
                **_as_in_the_paper(light),
            }
    return out


def _as_in_the_paper(light: PortalsRelighter) -> dict[str, float]:
    """Coefficients that are not 0 in linear steps of the maximum, Haar's over pulses': a number and its index each."""
    rows, n = light.layer.rows, light.layer.cube
    dense = rows.dense(np.linspace(0, len(rows) - 1, 300).astype(np.int64))
    haar = tables_of(np.ascontiguousarray(dense.T), n)[1].T
    steps = np.abs(haar).max(axis=1, keepdims=True) / 127
    kept = np.rint(haar / steps)
    error = np.linalg.norm(kept * steps - haar) / np.linalg.norm(haar)
    return {
        "linear_nonzero_ratio": float((kept != 0).sum() / (dense > 0).sum()),
        "linear_error": float(error),
    }


def orders(data: Path, work: Path) -> dict[str, Any]:
    """Energy of each order (Eqs. 4 and 5) for the large window and for one of a sixteenth of its area."""
    out: dict[str, Any] = {"paper": "90 % by order 5; by order 8 for a sixteenth of the area"}
    for name, window in (("large", rooms.LARGE), ("small", rooms.SMALL)):
        scene = rooms.box(data, window=window, cells=40, bunny="")
        settings = PortalsSettings(order=12, rays=4096, gather_rays=256, suns=False)
        light, _, _ = baked(scene, work / "orders.prelight", settings)
        energy = light.layer.energy[0].astype(np.float64)
        held = np.cumsum(energy, axis=0) / energy.sum(axis=0)
        out[name] = {
            "energy": energy.tolist(),
            "held": held.tolist(),
            "ninety": int(np.argmax(held.min(axis=1) >= 0.9)),
        }
    return out


def three_phase(_data: Path, work: Path) -> dict[str, Any]:
    """One room, forty hours and three glasses, beside Radiance's three-phase method."""
    return three_phase_beside(_data, work)


def _orders_and_plot(data: Path, work: Path) -> dict[str, Any]:
    found = orders(data, work)
    figures.energies(found)
    return found


_orders_and_plot.__doc__ = orders.__doc__

PARTS = {
    "box-large": _against("large", "by a window of 1.5 m"),
    "box-order-4": _against("order-4", "by that window, bounced light to the paper's order 4"),
    "box-small": _against("small", "by a window of 37.5 cm"),
    "box-tinted": _against("tinted", "by a large bluish window"),
    "box-frosted": _against("frosted", "by a large frosted window, σ = 15°"),
    "box-sun": _against("sun", "in the sun"), "box-refined": _against("refined", "with receivers refined"),
    "box-sun-refined": _against("sun-refined", "in the sun, with receivers refined for it"),
    "box-glossy": glossy_box.glossy_box, "rough-glass": panes.rough_glass, "refining": refining.error_against_triangles,
    "figure-10": figures.figure_10, "figure-11": glossy_box.figure_11,
    "figure-2": figures.figure_2, "figure-refined": figures.figure_refined,
    "box-table": box_table, "choice": choice,
    "orders": _orders_and_plot, "sibenik-table": sibenik_table, "car-table": car_table, "box-million": box_million,
    "sibenik-day": sibenik_day, "sun-reference": sun_reference,
    "three-phase-truth": three_phase_truth, "three-phase": three_phase, "sliding": sliding,
}  # fmt: skip
