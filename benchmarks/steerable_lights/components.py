"""PSNR of pictures from components against direct renders under the real light, and what a pose costs."""

from __future__ import annotations

import math
import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from setting import Setting, aims, panel, panel_light, seconds, spot, spot_light

from prelight.baking.span_images import Evened
from prelight.baking.steerable import bake_steerable
from prelight.baking.steerable_settings import BakedLamp, SteerableSettings
from prelight.bases.panels import PanelBasis
from prelight.bases.products import ProductBasis
from prelight.bases.steering import SpotBasis
from prelight.drawing.figures import save_figure
from prelight.drawing.plots import Axis, line_plot
from prelight.encoding.principal_components import Keep, gram, principal_components, to_bytes
from prelight.lighting.spot import Spot
from prelight.relighting.steerable_bake import SteerableBake
from prelight.transport.steered_reference import path_traced_picture

COUNTS = (1, 2, 4, 8, 12, 16, 20, 28, 36, 50, 64, 81, 120, 200, 400)
LIGHTS, RENDERS, ENOUGH = 2, 8, 35.0
MORE_SAMPLES = {"81 panels": 16}  # than are asked for, else 4: a narrow light on a panel is noisiest


class Direct:
    """A picture by Mitsuba's path tracer under the real light, in several renders of different seeds.

    Light that a small lamp sends over a mirror onto a surface is met by chance alone, in single pixels a thousand times
    too bright. The median of the renders has none of it, nor have our pictures, of paths from the eye alone. What
    is brighter than the peak, the 99th percentile, is as bright as that in all pictures: the lamp in the mirror ball.
    """

    def __init__(self, setting: Setting, lamp: Any, emission: Any) -> None:
        renders, self.seconds = [], 0.0
        each = max(2, math.isqrt(setting.reference_samples // RENDERS)) ** 2
        for seed in range(RENDERS):
            started = time.perf_counter()
            picture, _ = path_traced_picture(
                setting.surfaces, lamp, setting.camera, emission=emission, width=setting.size, height=setting.size,
                samples=each, depth=setting.depth, seed=100 + seed, sampler="multijitter",
            )  # fmt: skip
            self.seconds += time.perf_counter() - started
            renders.append(picture.reshape(-1, 3))
        self.samples = each * RENDERS
        self.peak = float(np.percentile(np.median(np.stack(renders), axis=0), 99))
        every = np.minimum(np.stack(renders), self.peak)
        self.picture = np.median(every, axis=0)
        left = np.median(np.abs(every - self.picture), axis=0) / 0.6745  # of one render, without sparks
        self.noise = float(np.square(left).mean())  # mean square of one render
        self.left = self.noise * np.pi / 2 / RENDERS  # of their median

    def cut(self, picture: np.ndarray) -> np.ndarray:
        """A picture as it is compared: no pixel beyond the peak."""
        return np.clip(picture, 0.0, self.peak)

    def psnr(self, picture: np.ndarray, own_noise: float) -> dict[str, float]:
        """Linear, against the 99th percentile: as it is, and without what both pictures' noise explains."""
        square = float(np.square(self.cut(picture) - self.picture, dtype=np.float64).mean())
        beyond = max(square - self.left - own_noise, 1e-2 * (self.left + own_noise))
        return {
            "as_it_is": 10 * np.log10(self.peak**2 / square),
            "beyond_noise": 10 * np.log10(self.peak**2 / beyond),
        }


def cases() -> dict[str, tuple[Any, Any, list[Any], int]]:
    """Lamp, basis, lights that are neither basis lights nor their neighbours, and how many the paper keeps."""
    at = np.random.default_rng(4).uniform(0.3, 0.7, (LIGHTS, 2))
    return {
        "36 spots": (spot(5), SpotBasis(5), [spot_light(5, aim) for aim in aims(LIGHTS)], 12),
        "81 panels": (panel(4), PanelBasis((4, 4)), [panel_light(4, p) for p in at], 20),
        "400 panels and spots": (
            panel(2, 3), ProductBasis(PanelBasis((2, 2)), SpotBasis(3)),
            [panel_light(2, p, degree=3, aim=aim) for p, aim in zip(at, aims(LIGHTS), strict=True)], 50,
        ),
    }  # fmt: skip


def components(setting: Setting) -> dict[str, Any]:
    """The worst PSNR over some lights, at each number of components, against all images and against the real light."""
    found, lines = {}, {}
    for name, (lamp, basis, lights, papers) in cases().items():
        tracer = setting.tracer(
            lamp, samples=MORE_SAMPLES.get(name, 4) * setting.samples
        )  # of which paths from the lamp are left out
        weights = np.stack([c for c, _ in lights])
        rows = tracer.pixels(0, tracer.settings.pixels, weights=weights)
        span = np.ascontiguousarray(rows.images.transpose(2, 0, 1))
        directs = [Direct(setting, lamp, emission) for _, emission in lights]
        own = [float(np.median(rows.posed_variance[:, p].mean(axis=1))) for p in range(len(lights))]
        G = gram(Evened(span, basis))
        at_count, pictures = {}, {}
        for count in sorted({c for c in (*COUNTS, papers, basis.lights) if c <= basis.lights}):
            kept = principal_components(G, basis, keep=Keep(count=count))
            images = kept.images(span)
            relit = [np.einsum("k,kpc->pc", kept.mixing @ c, images) for c in weights]
            each = [d.psnr(p, n) for d, p, n in zip(directs, relit, own, strict=True)]
            alone = [_psnr(p, np.einsum("s,spc->pc", c, span)) for p, c in zip(relit, weights, strict=True)]
            at_count[count] = {
                "against_the_real_light": min(one["as_it_is"] for one in each),
                "beyond_both_noises": min(one["beyond_noise"] for one in each),
                "against_all_images": min(alone),
            }
            pictures[count] = relit[0]
        needed = [c for c, one in at_count.items() if one["against_the_real_light"] >= ENOUGH]
        found[name] = {
            "paper_keeps": papers, "there": at_count[papers],
            "papers_rule_keeps": principal_components(G, basis, keep=Keep()).kept,
            "enough_from": min(needed) if needed else None, "noise_of_the_real_light_dB": [
                10 * np.log10(d.peak**2 / d.left) for d in directs
            ],
            "reference_samples": directs[0].samples, "at": at_count,
        }  # fmt: skip
        counts = list(map(float, at_count))
        lines[name] = (counts, [one["against_the_real_light"] for one in at_count.values()])
        _sheet(setting, name, directs[0].picture, pictures, papers=papers, every=basis.lights)
    plot = line_plot(lines, x=Axis("components", log=True), y=Axis("worst PSNR, dB"))
    save_figure(plot, setting.results / "components.png", force=True)
    return found


def _sheet(
    setting: Setting,
    name: str,
    direct: np.ndarray,
    pictures: dict[int, np.ndarray],
    *,
    papers: int,
    every: int,
) -> None:
    shown = [direct, pictures[every], pictures[papers]]
    words = ["Mitsuba's path tracer", f"all {every} basis images", f"{papers} components"]
    setting.sheet(shown, words, f"components-{name.split(maxsplit=1)[0]}")


def _psnr(ours: np.ndarray, truth: np.ndarray) -> float:
    error = float(np.square(ours - truth, dtype=np.float64).mean())
    return float(10 * np.log10(np.percentile(truth, 99) ** 2 / max(error, 1e-300)))


def poses(setting: Setting) -> dict[str, Any]:
    """A pose relit from a bake against one rendered by Mitsuba at the same error; how many pay for the bake."""
    coefficients, emission = spot_light(5, aims(1)[0])
    lamp = spot(5)
    images = setting.images()
    settings = SteerableSettings((BakedLamp("key", lamp),), "front", images, keep=Keep(count=12))
    with tempfile.TemporaryDirectory() as folder:
        bake_seconds = seconds(
            lambda: bake_steerable(setting.scene, Path(folder) / "warm.prelight", settings=settings)
        )
        bake_seconds = min(
            bake_seconds,
            seconds(lambda: bake_steerable(setting.scene, Path(folder) / "a.prelight", settings=settings)),
        )
        live = SteerableBake(Path(folder) / "a.prelight")
        taken = []
        for aim in aims(30, 5):
            light = Spot((1.0, 1.0, 1.0), direction=tuple(aim.tolist()))
            taken.append(seconds(lambda one=light: live.light([one])))
    tracer = setting.tracer(
        lamp
    )  # the same without light over mirrors, which the direct render meets by chance
    span = np.ascontiguousarray(tracer.pixels(0, tracer.settings.pixels).images.transpose(2, 0, 1))
    kept = principal_components(gram(Evened(span, SpotBasis(5))), SpotBasis(5), keep=Keep(count=12))
    planes = to_bytes(kept, kept.images(span))
    ours = np.einsum("k,kpc->pc", kept.mixing @ coefficients, planes.decoded(12))
    direct = Direct(setting, lamp, emission)
    error = float(np.square(direct.cut(ours) - direct.picture, dtype=np.float64).mean())
    error = max(error - direct.left, 1e-2 * direct.left)
    of_one = direct.noise * (direct.samples // RENDERS)  # mean square of a single sample, without sparks
    samples = max(of_one / error, 1.0)
    render = samples * direct.seconds / direct.samples
    relit = statistics.median(taken)
    return {
        "psnr_of_the_relit_picture": 10 * np.log10(direct.peak**2 / error),
        "bake_seconds": bake_seconds, "relight_seconds": relit,
        "samples_of_mitsuba_at_equal_error": samples, "render_seconds_at_equal_error": render,
        "times_faster_a_pose": render / relit, "poses_until_paid": bake_seconds / max(render - relit, 1e-9),
    }  # fmt: skip
