"""The papers' scenes, and their bakes, made once and kept in the work folder."""

from __future__ import annotations

import gc
import resource
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import prelight as pl
from prelight.baking.environment import bake_planned
from prelight.baking.environment_plan import plan_environment
from prelight.baking.environment_settings import EnvironmentSettings
from prelight.errors import InputError
from prelight.material import Material
from prelight.scene.floor import with_floor

SCANS = {"bunny": "bunny/bun_zipper.ply", "dragon": "dragon/dragon_vrip_res2.ply"}
FLOOR = 3.0  # times the model's largest extent: the papers do not say
BROWN = (0.35, 0.16, 0.07)


def scan(data: Path, name: str, *, floor: float = FLOOR) -> pl.Scene:
    """A Stanford scan on the papers' floor of 193×193 vertices."""
    return pl.load_scene(data / SCANS[name], floor=floor)


def brown_figure(data: Path) -> pl.Scene:
    """In the place of the Happy Buddha: a figure of 35,947 vertices, brown and glossy, on a glossy floor.

    The papers' own (32,328 vertices, of an unpublished BRDF) cannot be had.
    """
    bunny = pl.load_scene(data / SCANS["bunny"], albedo=BROWN)
    lacquer = Material("lacquer", BROWN, roughness=0.35, specular=1.0)
    figure = replace(bunny, materials=(lacquer,))
    return with_floor(
        figure, FLOOR, albedo=(0.3, 0.3, 0.3), material=Material("floor", roughness=0.3, specular=1.0)
    )


def baked(scene: pl.Scene, path: Path, **settings) -> tuple[pl.Bake, dict]:
    """The bake at ``path``, made or finished first if need be, and what it says of itself."""
    plan, before = None, _peak()
    try:
        found = pl.Bake.open(path)
    except InputError:
        plan = plan_environment(scene, EnvironmentSettings(**({"bounces": 0} | settings)))
        started = time.perf_counter()

        def report(done: float, left: float, clusters: int) -> None:
            print(f"\r{path.name}: {done:.0%}, {left:.0f} s left, {clusters} clusters   ", end="", flush=True)

        found = bake_planned(scene, path, plan=plan, resume=True, report=report)
        print(f"\r{path.name}: {time.perf_counter() - started:.0f} s" + " " * 40)
    layer = found.layers["environment"]
    figures = {
        "receivers": len(found.receivers),
        "triangles": len(found.triangles),
        "resolution": layer.parameters["resolution"],
        "epsilon": layer.parameters["epsilon"],
        "clusters": layer.coefficients,
        "bytes": found.manifest.bytes_of("layers/"),
        "rays": layer.rays,
        "seconds": found.seconds,
    }
    if plan is not None:
        if _peak() > before:  # of the process: where something earlier took more, nothing is known
            figures["peak_memory"] = _peak()
        figures["planned"] = {"clusters": plan.clusters, "seconds": plan.seconds, "bytes": plan.bytes}
    gc.collect()
    return found, figures


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def maps(data: Path) -> dict[str, Path]:
    """Six measured rooms and squares, and two skies whose sun carries most of the light."""
    probes, skies = data / "probes", data / "skies"
    return {
        "grace": probes / "grace_cross.hdr",
        "galileo": probes / "galileo_cross.hdr",
        "uffizi": probes / "uffizi_latlong.hdr",
        "campus": probes / "campus_cross.hdr",
        "beach": probes / "beach_cross.hdr",
        "rnl": probes / "rnl_cross.hdr",
        "noon grass (sun)": skies / "noon_grass_1k.hdr",
        "kloppenheim (sun)": skies / "kloppenheim_05_1k.hdr",
    }


def relative(ours: np.ndarray, true: np.ndarray) -> dict[str, float]:
    """Figures of an error, all channels together."""
    return {
        "relative_rms": float(np.sqrt(((ours - true) ** 2).sum() / (true**2).sum())),
        "mean_difference": float(np.abs(ours - true).sum() / true.sum()),
        "signed_mean": float((ours - true).sum() / true.sum()),
        "worst_of_largest": float(np.abs(ours - true).max() / true.max()),
        "99th_percentile_of_mean": float(np.percentile(np.abs(ours - true), 99) / true.mean()),
    }
