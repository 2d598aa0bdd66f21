"""What is measured."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
from measuring import against_path_tracer, baked, chosen_receivers, relights

import rooms
from prelight.baking.portals_settings import PortalsSettings
from prelight.bases.harmonic_cells import cell_harmonics
from prelight.drawing.view import View
from prelight.encoding.pulse_or_haar import tables_of
from prelight.lighting.daylight import Daylight
from prelight.lighting.environment import Environment
from prelight.lighting.frost import frosted
from prelight.lighting.glass import Glass
from prelight.lighting.moment import Site
from prelight.lighting.rig import Rig
from prelight.relighting.portals import PortalsRelighter
from prelight.scene.loading import load_scene
from prelight.scene.portals import PortalWish
from prelight.transport.path_traced_light import LitScene, as_diffuse

PAPER = {"gather_rays": 4096, "bounces": 9, "order": 4}
PICTURES = Path(__file__).parent / "results" / "pictures"
SIBENIK = str(rooms.HERE / "sibenik.toml")


def _sky(data: Path, name: str = "kloppenheim_05_1k.hdr", turn: float = 90.0) -> Environment:
    """Turned so that its brightest side stands before the window."""
    return Environment.open(data / "skies" / name).rotated(turn)


def _box(
    data: Path, work: Path, glass: Glass, *, window: float, known=None, factor=(1.0, 1.0, 1.0)
) -> dict[str, Any]:
    scene, sky = rooms.box(data, window=window), _sky(data)
    light, room, figures = baked(scene, work / f"box-{window}.prelight", PortalsSettings(rays=4096, **PAPER))
    light.light(Rig(sky, portals=(glass,)))
    cube = sky.cube(light.layer.cube)
    cube = cube if known is None else known(cube, light)
    return figures | against_path_tracer(light, room, cube, factor=factor)


def box_large(data: Path, work: Path) -> dict[str, Any]:
    """The paper's box with a bunny by a large window (1.5 m), against the path tracer."""
    return _box(data, work, Glass(), window=rooms.LARGE)


def box_small(data: Path, work: Path) -> dict[str, Any]:
    """The same by a small window (37.5 cm)."""
    return _box(data, work, Glass(), window=rooms.SMALL)


def box_tinted(data: Path, work: Path) -> dict[str, Any]:
    """The same by a large bluish window."""
    tint = (0.35, 0.55, 0.95)
    return _box(data, work, Glass(tint=tint), window=rooms.LARGE, factor=tint)


def box_frosted(data: Path, work: Path) -> dict[str, Any]:
    """The same by a large frosted window (σ = 15°): against the blurred sky."""
    return _box(
        data, work, Glass(kind="frosted", frost_deg=15.0), window=rooms.LARGE,
        known=lambda cube, light: frosted(cube, 15.0, light.layer.outward[0]),
    )  # fmt: skip


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
    scene = rooms.box(data, cells=290)
    light, _, figures = baked(
        scene, work / "million.prelight", PortalsSettings(rays=1024, gather_rays=256, suns=False)
    )
    return figures | relights(light, _sky(data)) | {"paper": {"megabytes": 300, "fps": 27}}


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


def sibenik_day(data: Path, work: Path) -> dict[str, Any]:
    """Sixteen hours of a day in Sibenik at 1,000 receivers, against the path tracer."""
    scene = rooms.sibenik(data, subdivide=0.8)
    light, room, figures = baked(
        scene, work / "day.prelight", PortalsSettings(PortalWish(file=SIBENIK), rays=4096, gather_rays=1024)
    )
    # All portals clear: what stained glass does is a factor for each, which the path tracer's holes have not.
    clear, hours = (Glass("*", tint=(1.0, 1.0, 1.0)),), []
    light.light(Rig(Environment.constant((1.0, 1.0, 1.0)), portals=clear))
    chosen = chosen_receivers(room, light).astype(np.int32)
    for k in range(16):
        first = datetime(2026, 6, 21, 4, 30, tzinfo=timezone(timedelta(hours=2)))
        sky = Daylight(Site(43.7, 15.9), first + timedelta(hours=k)).environment()
        light.light(Rig(sky, portals=clear))
        truth = LitScene(as_diffuse(room.open), sky=sky.cube(32)).light(
            chosen, origins=room.origins, samples=1024
        )
        mean = float(truth.total.mean())
        noise = float(np.sqrt(truth.total_variance).mean()) * math.sqrt(2 / math.pi)
        hours.append(
            {
                "difference": float(np.abs(light.irradiance[chosen] - truth.total).mean()) / mean,
                "noise": noise / mean,
            }
        )
    each = [hour["difference"] for hour in hours]
    return figures | {"hours": hours, "mean": float(np.mean(each)), "worst": max(each)}


def choice(data: Path, work: Path) -> dict[str, Any]:
    """Pulses or Haar: bytes for small and large windows, cubes of 32 and 64, and walls of glass."""
    out: dict[str, Any] = {
        "paper": "pulses 3 to 4 times smaller for small portals; Haar down to 40 % for large"
    }
    for name, window in (("small", rooms.SMALL), ("large", rooms.LARGE), ("wall", 2.9)):
        for cube in (32, 64):
            scene = rooms.box(data, window=window, cells=16)
            settings = PortalsSettings(cube=cube, rays=16384, bounces=0)
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
        scene = rooms.box(data, window=window, cells=48, bunny=False)
        settings = PortalsSettings(order=12, rays=4096, gather_rays=1024, suns=False)
        light, _, _ = baked(scene, work / "orders.prelight", settings)
        energy = light.layer.energy[0].astype(np.float64)
        held = np.cumsum(energy, axis=0) / energy.sum(axis=0)
        out[name] = {
            "energy": energy.tolist(),
            "held": held.tolist(),
            "ninety": int(np.argmax(held.min(axis=1) >= 0.9)),
        }
    return out


def direct_in_harmonics(data: Path, work: Path) -> dict[str, Any]:
    """The paper's figure 2: direct light through a small window in harmonics of order 10, beside ours."""
    scene, sky = rooms.box(data, window=rooms.SMALL), _sky(data)
    light, room, _ = baked(scene, work / "figure.prelight", PortalsSettings(rays=4096, bounces=0))
    light.light(Rig(sky))
    ours, n = light.direct, light.layer.cube
    means, integrals = cell_harmonics(10, n)
    blurred = (means @ (integrals.T @ sky.cube(n).reshape(-1, 3))).astype(np.float32)
    rows = np.zeros_like(ours)
    found = light.layer.rows.times(np.ascontiguousarray(blurred))
    rows[light.layer.receiver] = found
    pictures = [_drawn(scene, light, x) for x in (ours, np.maximum(rows, 0))]
    stops = pictures[0].stops("auto")
    PICTURES.mkdir(parents=True, exist_ok=True)
    both = np.concatenate([p.display(exposure=stops) for p in pictures], axis=1)
    _save(both, PICTURES / "direct-in-harmonics.png")
    difference = float(np.abs(rows - ours).mean() / ours.mean())
    return {
        "difference": difference,
        "negative_share": float((rows < -1e-6).mean()),
        "receivers": len(room.scene.positions),
    }


def _drawn(scene, light: PortalsRelighter, irradiance: np.ndarray):
    bake = replace(scene, name="box")
    view = View(bake.positions, bake.triangles, camera=rooms.EYE, width=640, height=480)
    return view.draw(bake.albedo * irradiance)


def _save(pixels: np.ndarray, path: Path) -> None:
    from PIL import Image

    Image.fromarray(pixels).save(path)


PARTS = {
    "box-table": box_table, "box-large": box_large, "box-small": box_small, "box-tinted": box_tinted,
    "box-frosted": box_frosted, "choice": choice, "orders": orders, "figure-2": direct_in_harmonics,
    "sibenik-table": sibenik_table, "car-table": car_table, "box-million": box_million, "sibenik-day": sibenik_day,
}  # fmt: skip
