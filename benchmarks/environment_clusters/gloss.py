"""Image relighting: one glossy object in a diffuse scene with and without zones, and pixels by the path tracer."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

import prelight as pl
from prelight.baking.layer_receivers import LayerReceivers
from prelight.checking.against import Comparison
from prelight.drawing.figures import save_figure
from scenes import baked, maps, relative

R = 128
MAPS = ("grace", "galileo", "kloppenheim (sun)")


def glossy_sculpture() -> pl.Scene:
    """The small stock sculpture, its band lacquered, plinth and floor diffuse."""
    scene = pl.load_scene("stock:sculpture-small")
    band = replace(scene.materials[0], name="lacquer", roughness=0.25, specular=1.0)
    return replace(scene, materials=(band, *scene.materials[1:]))


@contextmanager
def one_cut_for_all() -> Generator[None]:
    """As in the paper: whatever a vertex is made of, it shares the one tree with all others."""
    by_material = LayerReceivers._sorts
    plain = cached_property(lambda receivers: np.ones(receivers.count, np.int32))
    plain.__set_name__(LayerReceivers, "_sorts")
    LayerReceivers._sorts = plain
    try:
        yield
    finally:
        LayerReceivers._sorts = by_material


def zones(data: Path, work: Path) -> dict:
    """The paper's limitation: the error of a glossy object among diffuse ones, and at its highlight.

    One cut of the tree for all, as in the paper, beside zones by material; exact integration at all glossy
    vertices that the eye sees; strong lights left in their clusters. The highlight: the brightest hundredth.
    """
    scene, environments = glossy_sculpture(), {name: pl.Environment.open(maps(data)[name]) for name in MAPS}
    settings = {"resolution": R, "tolerance": 0.0135, "camera": "front"}
    with one_cut_for_all():
        one, figures = baked(scene, work / "lacquer-one-cut.prelight", **settings)
    result: dict = {"one cut for all": figures | {"maps": {}}}
    by_zone, figures = baked(scene, work / "lacquer-zones.prelight", **settings)
    result["zones by material"] = figures | {"maps": {}}
    glossy = np.flatnonzero(scene.material_of_vertex == 0)
    for name, environment in environments.items():
        truth = None
        for label, found in (("zones by material", by_zone), ("one cut for all", one)):
            light = pl.Relighter(found, trace_strong=False)
            light.environment = environment
            if truth is None:
                work_ = Comparison(light, count=0)
                work_.rows = glossy.astype(np.int32)
                work_.run(samples=None)
                truth = work_.reference
                seen = truth.any(axis=1)
                bright = truth.sum(axis=1) >= np.percentile(truth[seen].sum(axis=1), 99)
            ours = light.radiance[glossy]
            result[label]["maps"][name] = {
                "glossy": relative(ours[seen], truth[seen]),
                "highlight": relative(ours[bright], truth[bright]),
            }
    return result


def pixels(data: Path, work: Path) -> dict:
    """The glossy still life at its camera's pixels, four samples each, against the path tracer's 4,096."""
    scene = pl.load_scene("stock:still-life")
    path = work / "still-life-pixels.prelight"
    found, figures = baked(
        scene, path, resolution=64, tolerance=0.02, receivers="pixels", camera="front", width=256, height=144
    )
    light = pl.Relighter(found)
    result: dict = figures | {"maps": {}}
    for name in MAPS:
        light.environment = pl.Environment.open(maps(data)[name])
        work_ = Comparison(light, count=0)
        relit = light.refresh().milliseconds
        result["maps"][name] = work_.run(samples=4096) | {"relight_milliseconds": relit}
        if name == MAPS[0]:
            figure = work_.picture(light.camera(), width=256, height=144, emphasis=None)
            save_figure(figure, Path(__file__).parent / "results" / "glossy-pixels.png", force=True)
    return result
