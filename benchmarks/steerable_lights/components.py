"""PSNR of pictures from components against direct renders under the real light, and what a pose costs."""

from __future__ import annotations

import json
import statistics
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from reference import Case, Direct, cases, decibels
from setting import Setting, aims, seconds, spot, spot_light

from prelight.baking.span_images import Evened
from prelight.baking.steerable import bake_steerable
from prelight.baking.steerable_settings import BakedLamp, SteerableSettings
from prelight.bases.steering import SpotBasis
from prelight.drawing.figures import enlarged, panels, save_figure
from prelight.drawing.picture import Picture
from prelight.drawing.plots import Axis, line_plot
from prelight.encoding.principal_components import Keep, gram, principal_components, to_bytes
from prelight.lighting.spot import Spot
from prelight.relighting.steerable_bake import SteerableBake

COUNTS = (1, 2, 4, 8, 12, 16, 20, 28, 36, 50, 64, 81, 120, 200, 400)
ENOUGH = 35.0
MORE_SAMPLES = {"81 panels": 8}  # than are asked for, else 4: a narrow light on a panel is noisiest


@dataclass(frozen=True)
class Ours:
    """Span images (S, pixels, 3) of a case, pictures (P, pixels, 3) of its lights by class of path, and their noise."""

    span: np.ndarray
    eye: np.ndarray
    lamp: np.ndarray
    noise: list[float]  # mean square

    @classmethod
    def of(cls, setting: Setting, case: Case, *, by_chance: bool = False) -> Ours:
        samples = MORE_SAMPLES.get(case.name, 4) * setting.samples
        tracer = setting.tracer(case.lamp, samples=samples, particles=samples // 16, by_chance=by_chance)
        weights = np.stack([coefficients for coefficients, _ in case.lights])
        rows, total = setting.traced(tracer, weights)
        span = np.ascontiguousarray((rows.images + total.images).transpose(2, 0, 1))
        variance = rows.posed_variance + total.posed_variance
        # The lamp itself in a mirror is left out: it is beyond the peak, where nothing counts.
        noise = [float(np.minimum(v, np.percentile(v, 99.5)).mean()) for v in variance.transpose(1, 0, 2)]
        return cls(span, rows.posed.transpose(1, 0, 2), total.posed.transpose(1, 0, 2), noise)


def components(setting: Setting) -> dict[str, Any]:
    """The worst PSNR over some lights, at each number of components, against all images and against the real light."""
    kept_at = setting.results / "components.json"
    before = json.loads(kept_at.read_text()) if setting.case and kept_at.exists() else {}
    every = cases()
    found = {name: before[name] for name in every if name in before}
    for name in [setting.case] if setting.case else every:
        found[name] = _components(setting, every[name])
    lines = {
        name: (list(map(float, one["at"])), [at["against_the_real_light"] for at in one["at"].values()])
        for name, one in found.items()
    }
    plot = line_plot(lines, x=Axis("components", log=True), y=Axis("worst PSNR, dB", log=False))
    save_figure(plot, setting.results / "components.png", force=True)
    return found


def _components(setting: Setting, case: Case) -> dict[str, Any]:
    ours, basis = Ours.of(setting, case), case.basis
    weights = np.stack([coefficients for coefficients, _ in case.lights])
    directs = [Direct(setting, case, light) for light in range(len(case.lights))]
    G = gram(Evened(ours.span, basis))
    at_count, pictures = {}, {}
    for count in sorted({c for c in (*COUNTS, case.papers, basis.lights) if c <= basis.lights}):
        kept = principal_components(G, basis, keep=Keep(count=count))
        images = kept.images(ours.span)
        relit = [np.einsum("k,kpc->pc", kept.mixing @ c, images) for c in weights]
        each = [d.psnr(p, n) for d, p, n in zip(directs, relit, ours.noise, strict=True)]
        alone = [_psnr(p, np.einsum("s,spc->pc", c, ours.span)) for p, c in zip(relit, weights, strict=True)]
        at_count[count] = {
            "against_the_real_light": min(one["as_it_is"] for one in each),
            "beyond_both_noises": min(one["beyond_noise"] for one in each),
            "against_all_images": min(alone),
        }
        pictures[count] = relit[0]
    needed = [c for c, one in at_count.items() if one["against_the_real_light"] >= ENOUGH]
    shown = [directs[0].picture, pictures[basis.lights], pictures[case.papers]]
    words = ["Mitsuba's path tracer", f"all {basis.lights} basis images", f"{case.papers} components"]
    setting.sheet(shown, words, f"components-{case.name.split(maxsplit=1)[0]}")
    return {
        "paper_keeps": case.papers, "there": at_count[case.papers],
        "papers_rule_keeps": principal_components(G, basis, keep=Keep()).kept,
        "enough_from": min(needed) if needed else None, "size": setting.size,
        "our_samples": MORE_SAMPLES.get(case.name, 4) * setting.samples,
        "our_noise_dB": [decibels(d.peak**2 / n) for d, n in zip(directs, ours.noise, strict=True)],
        "reference_samples": directs[0].samples,
        "noise_of_the_reference_dB": [decibels(d.peak**2 / d.left) for d in directs],
        "halves_of_the_reference_dB": [d.halves() for d in directs], "at": at_count,
    }  # fmt: skip


def classes(setting: Setting) -> dict[str, Any]:
    """Which paths are needed for a picture to be as the direct render: PSNR with each class, and where it differs."""
    case = cases()[setting.case or "36 spots"]
    direct, ours = Direct(setting, case, 0), Ours.of(setting, case)
    chance = Ours.of(setting, case, by_chance=True)
    parts = {
        "from the eye alone": ours.eye[0],
        "and L S+ D ... D E from the lamp": ours.eye[0] + chance.lamp[0],
        "and L S+ D ... S+ E, joined": ours.eye[0] + ours.lamp[0],
        "or by chance": chance.eye[0] + chance.lamp[0],
    }
    found = {name: direct.psnr(picture, ours.noise[0]) for name, picture in parts.items()}
    shown = [_displayed(setting, direct.picture / direct.peak)]
    shown += [
        _displayed(setting, 0.5 + 4 * (direct.cut(p) - direct.picture) / direct.peak, linear=True)
        for p in parts.values()
    ]
    words = [
        "Mitsuba's path tracer",
        "from the eye, less it",
        "and from the lamp",
        "and seen in glass",
        "or by chance",
    ]
    save_figure(panels(shown, words), setting.results / "classes.png", force=True)
    whole, shown_in_glass = direct.picture.mean(), (ours.lamp[0] - chance.lamp[0]).mean()
    return found | {
        "case": case.name, "reference_samples": direct.samples,
        "noise_of_the_reference_dB": decibels(direct.peak**2 / direct.left), "halves_dB": direct.halves(),
        "share_from_the_lamp": chance.lamp[0].mean() / whole, "share_seen_in_glass": shown_in_glass / whole,
        "share_seen_in_glass_by_chance": (chance.eye[0] - ours.eye[0]).mean() / whole,
    }  # fmt: skip


def _displayed(setting: Setting, picture: np.ndarray, *, linear: bool = False) -> np.ndarray:
    """(pixels, 3) enlarged; ``linear`` shows 0 to 1 as it is, for differences."""
    shape = (setting.size, setting.size, 3)
    if linear:
        return enlarged(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8).reshape(shape), at_least=384)
    shown = Picture(np.maximum(picture, 0).reshape(shape).astype(np.float32))
    return enlarged(shown.display(exposure=shown.stops("auto") - 0.7), at_least=384)


def _psnr(ours: np.ndarray, truth: np.ndarray) -> float:
    error = float(np.square(ours - truth, dtype=np.float64).mean())
    return float(10 * np.log10(np.percentile(truth, 99) ** 2 / max(error, 1e-300)))


def poses(setting: Setting) -> dict[str, Any]:
    """A pose relit from a bake against one rendered by Mitsuba at the same error; how many pay for the bake."""
    coefficients, _ = spot_light(5, aims(1)[0])
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
    case = cases()["36 spots"]
    span = setting.span(lamp)
    kept = principal_components(gram(Evened(span, SpotBasis(5))), SpotBasis(5), keep=Keep(count=12))
    planes = to_bytes(kept, kept.images(span))
    ours = np.einsum("k,kpc->pc", kept.mixing @ coefficients, planes.decoded(12))
    direct = Direct(setting, case, 0)
    error = float(np.square(direct.cut(ours) - direct.picture, dtype=np.float64).mean())
    error = max(error - direct.left, 1e-2 * direct.left)
    of_one = direct.noise * direct.each  # mean square of a sample, without sparks: they would favour us
    samples = max(of_one / error, 1.0)
    render = samples * direct.seconds / direct.samples
    relit = statistics.median(taken)
    return {
        "psnr_of_the_relit_picture": 10 * np.log10(direct.peak**2 / error),
        "bake_seconds": bake_seconds, "relight_seconds": relit,
        "samples_of_mitsuba_at_equal_error": samples, "render_seconds_at_equal_error": render,
        "times_faster_a_pose": render / relit, "poses_until_paid": bake_seconds / max(render - relit, 1e-9),
    }  # fmt: skip
