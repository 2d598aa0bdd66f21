"""Tables 1 and 2 of the paper and the ε of its section 6.1: clusters, bytes and seconds, beside the paper's."""

from __future__ import annotations

import statistics
import time
from pathlib import Path

import numpy as np

import prelight as pl
from prelight.relighting.environment import EnvironmentRelighter
from prelight.relighting.layer import EnvironmentLayer
from scenes import FLOOR, baked, brown_figure, maps, scan

TABLE_2 = {  # R: clusters at ε = 5e-5, at 4e-5
    256: (8832, 14736),
    1024: (9831, 19365),
    4096: (10170, 21393),
}
SWEEP = {5e-5: 9831, 1e-4: 1023, 2.5e-4: 63}  # at R = 1024


def relight_seconds(found: pl.Bake, environment: Path, *, repeats: int = 9) -> dict[str, float]:
    """A full relight: the product alone, and with the texels of a new cube map summed into clusters."""
    layer = EnvironmentLayer(found)
    live = EnvironmentRelighter(layer, found.receivers.albedo)
    cube = pl.Environment.open(environment).cube(layer.resolution)
    live.set_cube(cube)
    product, whole = [], []
    for k in range(repeats):
        started = time.perf_counter()
        live.refresh()
        product.append(time.perf_counter() - started)
        cube *= np.float32(1.01 if k % 2 else 1 / 1.01)
        started = time.perf_counter()
        live.set_cube(cube)
        whole.append(time.perf_counter() - started)
    return {
        "product_milliseconds": statistics.median(product) * 1e3,
        "new_map_milliseconds": statistics.median(whole) * 1e3,
    }


def bunny(data: Path, work: Path) -> dict:
    """Table 1, first column: 9,831 clusters, 405 MB, 50 minutes, 6.5 seconds."""
    found, figures = baked(
        scan(data, "bunny"), work / "bunny-1024-5e-5.prelight", resolution=1024, epsilon=5e-5
    )
    figures |= relight_seconds(found, maps(data)["grace"])
    return beside(figures, clusters=9831, bytes=405e6, seconds=50 * 60, product_milliseconds=6500)


def dragon(data: Path, work: Path) -> dict:
    """Table 1, second column: 5,337 clusters, 326 MB, 35 minutes, 8 seconds; on a floor of twice its extent."""
    return _dragon(data, work, 2.0)


def dragon_on_the_bunnys_floor(data: Path, work: Path) -> dict:
    """The same on a floor of three times its extent, which fits the Bunny's counts and not the Dragon's."""
    return _dragon(data, work, FLOOR)


def _dragon(data: Path, work: Path, floor: float) -> dict:
    path = work / f"dragon-floor-{floor:g}-1024-5e-5.prelight"
    found, figures = baked(scan(data, "dragon", floor=floor), path, resolution=1024, epsilon=5e-5)
    figures |= relight_seconds(found, maps(data)["grace"])
    return beside(figures, clusters=5337, bytes=326e6, seconds=35 * 60, product_milliseconds=8000)


def figure(data: Path, work: Path) -> dict:
    """Table 1, third column, in kind: 4,701 clusters, 623 MB, 8 minutes, 3.5 seconds; image relighting, R = 256."""
    scene = brown_figure(data)
    camera = next(iter(scene.cameras))
    path = work / "figure-256-5e-5.prelight"
    found, figures = baked(scene, path, resolution=256, epsilon=5e-5, camera=camera, samples_per_side=3)
    figures |= relight_seconds(found, maps(data)["campus"])
    return beside(figures, clusters=4701, bytes=623e6, seconds=8 * 60, product_milliseconds=3500)


def table_2(data: Path, work: Path) -> dict:
    """Clusters at three resolutions and two ε, and how little they grow."""
    scene, result = scan(data, "bunny"), {}
    for R, papers in TABLE_2.items():
        for epsilon, paper in zip((5e-5, 4e-5), papers, strict=True):
            path = work / f"bunny-{R}-{epsilon * 1e5:g}e-5.prelight"
            _, figures = baked(scene, path, resolution=R, epsilon=epsilon)
            result[f"R={R} ε={epsilon:g}"] = beside(figures, clusters=paper)
    for epsilon in (5e-5, 4e-5):
        coarse, fine = (result[f"R={R} ε={epsilon:g}"]["clusters"] for R in (256, 4096))
        result[f"growth from R=256 to 4096 at ε={epsilon:g}"] = fine / coarse
    return result


def sweep(data: Path, work: Path) -> dict:
    """Section 6.1: clusters at R = 1024 as ε grows."""
    scene, result = scan(data, "bunny"), {}
    for epsilon, paper in SWEEP.items():
        path = work / f"bunny-1024-{epsilon * 1e5:g}e-5.prelight"
        _, figures = baked(scene, path, resolution=1024, epsilon=epsilon)
        result[f"ε={epsilon:g}"] = beside(figures, clusters=paper)
    return result


def beside(ours: dict, **paper: float) -> dict:
    """Our figures, the paper's, and ours over the paper's."""
    return ours | {
        "paper": paper,
        "over_paper": {name: ours[name] / value for name, value in paper.items() if ours.get(name)},
    }
