"""Do steerable lights stand where their paper stands? See README.md."""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from components import classes, components, poses
from fixed_lights import fixed_lights
from reference import references
from setting import (
    Setting,
    aims,
    legendre_light,
    panel,
    panel_light,
    psnr,
    seconds,
    spot,
    spot_light,
    toward,
)
from speed import relighting

from prelight.baking.span_images import Evened
from prelight.bases.panels import PanelBasis
from prelight.bases.products import ProductBasis
from prelight.bases.steering import SpotBasis
from prelight.checking.comparison import compare
from prelight.encoding.principal_components import Keep, gram, principal_components
from prelight.transport.steered_reference import path_traced_picture

ROUNDS = 3
RESULTS = Path(__file__).parent / "results"
PAPER = {"figure 1": (36, 12), "figures 3 and 4": (81, 20), "figure 5": (400, 50)}


def one_pass(setting: Setting) -> dict[str, Any]:
    """The cost of all basis images against that of one picture by Mitsuba's path tracer, in turn; and their noise."""
    plain = {"emission": None, "width": setting.size, "height": setting.size, "depth": setting.depth}

    def picture(seed: int = 0) -> np.ndarray:
        found, _ = path_traced_picture(
            setting.surfaces, spot(0), setting.camera, samples=setting.samples, seed=seed, **plain
        )
        return found.reshape(-1, 3)

    found: dict[str, Any] = {}
    for degree in (0, 3, 5, 9):
        tracer = setting.tracer(spot(degree))
        eye, lamp, theirs = [], [], []
        setting.traced(tracer), picture()
        for _ in range(ROUNDS):
            total = tracer.nothing()
            tracer._image = None  # the lamp in mirrors, which is kept: it is to be counted each time
            eye.append(seconds(lambda t=tracer: t.pixels(0, t.settings.pixels)))
            lamp.append(
                seconds(lambda t=tracer, n=total: [t.add_batch(b, n) for b in range(t.batches)] and None)
            )
            theirs.append(seconds(picture))
        one, M = statistics.median(theirs), (degree + 1) ** 2
        both = statistics.median(a + b for a, b in zip(eye, lamp, strict=True))
        found[str(M)] = {
            "one_picture_by_mitsuba_seconds": one,
            "from_the_eye_over_one_picture": statistics.median(eye) / one,
            "all_over_one_picture": both / one,
            "one_by_one_over_all": M * one / both,
        }
    even = np.array([[np.sqrt(4 * np.pi)]])
    pairs = [[], []]
    for seed in (1, 2):
        rows, total = setting.traced(setting.tracer(spot(0), seed=seed), even)
        pairs[0].append((rows.posed + total.posed)[:, 0])
        pairs[1].append(picture(seed))
    ours, mitsubas = (_noise(*pair) for pair in pairs)
    squared = (ours / mitsubas) ** 2
    found["noise_over_mitsubas"] = ours / mitsubas
    found["36_over_one_picture_at_equal_noise"] = found["36"]["all_over_one_picture"] * squared
    return found


def _noise(a: np.ndarray, b: np.ndarray) -> float:
    """RMS of the noise between two pictures; what is beyond 99.5 % of the pixels counts as those."""
    square = np.square(a - b, dtype=np.float64).sum(axis=1) / 2
    return float(np.sqrt(np.minimum(square, np.percentile(square, 99.5)).mean()))


def agreement(setting: Setting) -> dict[str, Any]:
    """Weighted span images against direct renders with the real light, and with one degree too few."""
    kept_at = setting.results / "agreement.json"
    before = json.loads(kept_at.read_text()) if setting.case and kept_at.exists() else {}
    setting = replace(setting, size=setting.size // 2)
    at, cases = np.random.default_rng(3).uniform(0.3, 0.7, 2), {}
    for degree in (1, 3, 5, 9):
        for name, light_of in (("spot", spot_light), ("Legendre", legendre_light)):
            weights, emission = light_of(degree, aims(1, degree)[0])
            less = weights.copy()
            less[degree**2 :] = 0
            cases[f"{name} {degree}"] = (spot(degree, radius=0.15), emission, weights, less)
    weights, emission = panel_light(4, at)
    less, _ = panel_light(4, at + np.array([0.05, 0.0]))
    cases["panel, 81 lights"] = (panel(4), emission, weights, less)
    weights, emission = panel_light(2, at, degree=3, aim=aims(1, 7)[0])
    less, _ = panel_light(2, at, degree=3, aim=aims(1, 8)[0])
    cases["panel, 400 lights"] = (panel(2, 3), emission, weights, less)
    return {
        name: _held(setting, *case) if setting.case is None or name.startswith(setting.case) else before[name]
        for name, case in cases.items()
        if setting.case is None or name.startswith(setting.case) or name in before
    }


def _held(
    setting: Setting, lamp: Any, emission: Any, weights: np.ndarray, wrong: np.ndarray
) -> dict[str, Any]:
    tracer = setting.tracer(lamp, by_chance=True)
    rows, total = setting.traced(tracer, np.stack([weights, wrong]))
    mean, variance = rows.posed + total.posed, rows.posed_variance + total.posed_variance
    theirs, noise = path_traced_picture(
        setting.surfaces, lamp, setting.camera, emission=emission, width=setting.size, height=setting.size,
        samples=setting.samples, depth=setting.depth, seed=5,
    )  # fmt: skip
    shown = ("relative_rms", "noise", "z_rejected_share", "pooled_z", "detectable_bias")
    figures = [
        compare(mean[:, p], theirs.reshape(-1, 3), variance[:, p] + noise.reshape(-1, 3)) for p in (0, 1)
    ]
    return {
        kind: {name: getattr(one, name) for name in shown}
        for kind, one in zip(("right", "one too few, or beside"), figures, strict=True)
    }


def figures(setting: Setting) -> dict[str, Any]:
    """Figures 1 to 5 of the paper in kind, on our scene, each from as many images as the paper used."""
    warm, cold = np.array([1.0, 0.75, 0.45]), np.array([0.4, 0.65, 1.0])
    relit = _relit(setting, spot(5), SpotBasis(5), 12)
    sideways = [toward((-0.5, 0.35, -0.3)), toward((0.75, 0.0, 0.6))]
    left, middle = (relit(spot_light(5, aim)[0]) for aim in sideways)
    shown = [left, middle, left * warm + middle * cold]
    setting.sheet(shown, ["12 of 36 images, aimed left", "aimed elsewhere", "both at once"], "figure-1")

    relit = _relit(setting, spot(3), SpotBasis(3), None)
    sides = [relit(spot_light(3, aim)[0]) for aim in (*aims(1, 9), sideways[0])]
    setting.sheet(sides, ["16 images, through glass", "aimed elsewhere"], "figure-2")

    lamp, basis = panel(4), PanelBasis((4, 4))
    span = setting.span(lamp)
    whole, twenty = _relit(setting, span, basis, None), _relit(setting, span, basis, 20)
    places = [np.array(p) for p in ((0.3, 0.35), (0.7, 0.35), (0.5, 0.75))]
    shifted = [twenty(panel_light(4, p)[0]) for p in places]
    broad = twenty(basis.product([_low(basis, 1)] * 2))
    colours = sum(picture * colour for picture, colour in zip(shifted, np.eye(3) * 2.4 + 0.1, strict=True))
    setting.sheet(
        [shifted[0], broad, colours], ["20 of 81 images, to the left", "broader", "three at once"], "figure-3"
    )
    weights, emission = panel_light(4, places[0])
    direct, _ = path_traced_picture(
        setting.surfaces, lamp, setting.camera, emission=emission, width=setting.size, height=setting.size,
        samples=setting.samples, depth=setting.depth,
    )  # fmt: skip
    truth = direct.reshape(-1, 3)
    shown = [truth, whole(weights), shifted[0]]
    setting.sheet(shown, ["Mitsuba's path tracer", "81 basis images", "20 components"], "figure-4")

    fifty = _relit(setting, panel(2, 3), ProductBasis(PanelBasis((2, 2)), SpotBasis(3)), 50)
    down, aside = np.array([0.0, -1.0, 0.0]), np.array([0.75, -0.66, 0.0])
    cases = ((places[0], down), (places[0], aside), (places[2], aside))
    turned = [fifty(panel_light(2, p, degree=3, aim=a)[0]) for p, a in cases]
    setting.sheet(turned, ["50 of 400 images, pointing down", "turned", "turned and moved"], "figure-5")
    return {
        "81 against the path tracer, dB (noise of both included)": psnr(whole(weights), truth),
        "20 against 81, dB": psnr(shifted[0], whole(weights)),
    }


def _relit(setting: Setting, lamp: Any, basis: Any, count: int | None) -> Callable[[np.ndarray], np.ndarray]:
    """Pictures of a light's coefficients from so many components, or all images; of a lamp, or its span images."""
    span = lamp if isinstance(lamp, np.ndarray) else setting.span(lamp)
    if count is None:
        return lambda weights: np.einsum("s,spc->pc", weights, span)
    kept = principal_components(gram(Evened(span, basis)), basis, keep=Keep(count=count))
    images = kept.images(span)
    return lambda weights: np.einsum("k,kpc->pc", kept.mixing @ weights, images)


def _low(basis: PanelBasis, power: int) -> np.ndarray:
    from prelight.bases.panels import axis_shift, power_coefficients

    return axis_shift(basis.harmonics[0], 0.5) @ power_coefficients(power, basis.harmonics[0])


PARTS: dict[str, Callable[[Setting], dict[str, Any]]] = {
    "references": references, "one-pass": one_pass, "agreement": agreement, "classes": classes,
    "components": components, "poses": poses, "figures": figures, "relighting": lambda _: relighting(),
    "fixed-lights": fixed_lights,
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", help=", ".join(PARTS))
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--light-paths", type=int, default=16)
    parser.add_argument("--reference-samples", type=int, default=2048)
    parser.add_argument("--cycles", help="a folder where bpy is installed (pip install --target FOLDER bpy)")
    parser.add_argument("--luxcore", help="a folder where pyluxcore is installed")
    parser.add_argument(
        "--work", help="a folder where direct renders are kept; those there are not made again"
    )
    parser.add_argument(
        "--case",
        help="of components: 36 spots, 81 panels or 400 panels and spots; of agreement: spot, Legendre or panel",
    )
    parser.add_argument("--renderer", help="of fixed lights: prelight, cycles or luxcore; all without")
    parser.add_argument("--lamps", type=int, help="of fixed lights: 16 or 64; both without")
    parser.add_argument("--renders", type=int, default=8, help="direct renders of the eight that are used")
    parser.add_argument("--pieces", type=int, default=10**6, help="direct renders to be made at most")
    given = parser.parse_args()
    rivals = {name: getattr(given, name) for name in ("cycles", "luxcore") if getattr(given, name)}
    setting = Setting(
        given.size, given.samples, given.light_paths, reference_samples=given.reference_samples, rivals=rivals,
        work=given.work, case=given.case, renders=given.renders, pieces=given.pieces, renderer=given.renderer,
        lamps=given.lamps,
    )  # fmt: skip
    RESULTS.mkdir(exist_ok=True)
    for part in given.parts or PARTS:
        started = time.perf_counter()
        found = {
            "size": given.size,
            "samples": given.samples,
            "threads": os.cpu_count(),
            **PARTS[part](setting),
        }
        found["seconds"] = time.perf_counter() - started
        if part != "references":
            (RESULTS / f"{part}.json").write_text(json.dumps(found, indent=1) + "\n")
        print(json.dumps({part: found}, indent=1))


if __name__ == "__main__":
    main()
