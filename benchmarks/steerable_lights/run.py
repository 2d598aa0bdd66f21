"""Do steerable lights stand where their paper stands? See README.md."""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
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
)

from prelight.baking.span_images import Evened
from prelight.bases.panels import PanelBasis
from prelight.bases.products import ProductBasis
from prelight.bases.steering import SpotBasis
from prelight.checking.comparison import compare
from prelight.drawing.figures import enlarged, panels, save_figure
from prelight.drawing.picture import Picture
from prelight.drawing.plots import Axis, line_plot
from prelight.encoding.principal_components import Keep, gram, principal_components
from prelight.transport.steered_reference import path_traced_picture

RESULTS = Path(__file__).parent / "results"
PAPER = {"figure 1": (36, 12), "figures 3 and 4": (81, 20), "figure 5": (400, 50)}


def one_pass(setting: Setting) -> dict[str, Any]:
    """The cost of all basis images against that of one picture by Mitsuba's path tracer, in turn."""
    plain = {"emission": None, "width": setting.size, "height": setting.size, "depth": setting.depth}

    def picture() -> Any:
        return path_traced_picture(
            setting.surfaces, spot(0), setting.camera, samples=setting.samples, **plain
        )

    found = {}
    for degree in (0, 3, 5, 9):
        tracer = setting.tracer(spot(degree))
        eye, both, theirs = [], [], []
        setting.traced(tracer), picture()
        for _ in range(3):
            eye.append(seconds(lambda t=tracer: t.pixels(0, t.settings.pixels)))
            both.append(seconds(lambda t=tracer: setting.traced(t)))
            theirs.append(seconds(picture))
        one = statistics.median(theirs)
        M = (degree + 1) ** 2
        found[str(M)] = {
            "one_picture_by_mitsuba_seconds": one,
            "from_the_eye_over_one_picture": statistics.median(eye) / one,
            "all_over_one_picture": statistics.median(both) / one,
            "one_by_one_over_all": M * one / statistics.median(both),
        }
    return found


def agreement(setting: Setting) -> dict[str, Any]:
    """Weighted span images against direct renders with the real light, and with one degree too few."""
    found = {}
    at = np.random.default_rng(3).uniform(0.3, 0.7, 2)
    for degree in (1, 3, 5, 9):
        for name, light_of in (("spot", spot_light), ("Legendre", legendre_light)):
            weights, emission = light_of(degree, aims(1, degree)[0])
            less = weights.copy()
            less[degree**2 :] = 0
            found[f"{name} {degree}"] = _held(setting, spot(degree, radius=0.15), emission, weights, less)
    weights, emission = panel_light(4, at)
    less, _ = panel_light(4, at + np.array([0.05, 0.0]))
    found["panel, 81 lights"] = _held(setting, panel(4), emission, weights, less)
    weights, emission = panel_light(2, at, degree=3, aim=aims(1, 7)[0])
    less, _ = panel_light(2, at, degree=3, aim=aims(1, 8)[0])
    found["panel, 400 lights"] = _held(setting, panel(2, 3), emission, weights, less)
    return found


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


def components(setting: Setting) -> dict[str, Any]:
    """PSNR of relit pictures against all basis images, at each number of components."""
    at = np.random.default_rng(4).uniform(0.25, 0.75, (4, 2))
    cases: dict[str, tuple[Any, Any, list[np.ndarray], int]] = {
        "36 spots": (spot(5), SpotBasis(5), [spot_light(5, aim)[0] for aim in aims(4)], 12),
        "81 panels": (panel(4), PanelBasis((4, 4)), [panel_light(4, p)[0] for p in at], 20),
        "400 panels and spots": (
            panel(2, 3), ProductBasis(PanelBasis((2, 2)), SpotBasis(3)),
            [panel_light(2, p, degree=3, aim=aim)[0] for p, aim in zip(at, aims(4), strict=True)], 50,
        ),
    }  # fmt: skip
    found, lines = {}, {}
    for name, (lamp, basis, lights, papers) in cases.items():
        span = setting.span(lamp)
        G, truths = gram(Evened(span, basis)), [np.einsum("s,spc->pc", c, span) for c in lights]
        counts = sorted({1, 2, 4, 8, 12, 16, 20, 28, 36, 50, 64, 81, papers})
        at_count = {}
        for count in (c for c in counts if c <= basis.lights):
            kept = principal_components(G, basis, keep=Keep(count=count))
            images = kept.images(span)
            relit = [np.einsum("k,kpc->pc", kept.mixing @ c, images) for c in lights]
            at_count[count] = min(psnr(ours, truth) for ours, truth in zip(relit, truths, strict=True))
        rule = principal_components(G, basis, keep=Keep())
        found[name] = {
            "paper_keeps": papers, "worst_psnr_there": at_count[papers], "papers_rule_keeps": rule.kept,
            "worst_psnr": at_count,
        }  # fmt: skip
        lines[name] = (list(map(float, at_count)), list(at_count.values()))
    plot = line_plot(lines, x=Axis("components", log=True), y=Axis("worst PSNR, dB"))
    save_figure(plot, RESULTS / "components.png", force=True)
    return found


def poses(setting: Setting) -> dict[str, Any]:
    """A pose relit against one rendered by Mitsuba: how many pay for the bake."""
    tracer = setting.tracer(spot(5))
    setting.traced(tracer)
    bake = seconds(lambda: setting.traced(tracer))
    _, emission = spot_light(5, aims(1)[0])

    def picture() -> Any:
        return path_traced_picture(
            setting.surfaces, spot(5), setting.camera, emission=emission, width=setting.size,
            height=setting.size, samples=setting.samples, depth=setting.depth,
        )  # fmt: skip

    picture()
    render = seconds(picture)
    return {"bake_seconds": bake, "render_seconds": render, "poses_until_paid": bake / render}


def figures(setting: Setting) -> dict[str, Any]:
    """Figures 1 to 5 of the paper in kind, on our scene."""
    span = setting.span(spot(5))
    left, middle = (np.einsum("s,spc->pc", spot_light(5, aim)[0], span) for aim in aims(2, 2))
    warm, cold = np.array([1.0, 0.75, 0.45]), np.array([0.4, 0.65, 1.0])
    _sheet(
        setting,
        [left, middle, left * warm + middle * cold],
        ["aimed left", "aimed elsewhere", "both at once"],
        "figure-1",
    )
    narrow = np.einsum("s,spc->pc", spot_light(3, aims(1, 9)[0])[0], setting.span(spot(3)))
    _sheet(setting, [narrow], ["degree 3, through glass"], "figure-2")
    lamp, basis = panel(4), PanelBasis((4, 4))
    span = setting.span(lamp)
    places = [np.array(p) for p in ((0.3, 0.35), (0.7, 0.35), (0.5, 0.75))]
    shifted = [np.einsum("s,spc->pc", panel_light(4, p)[0], span) for p in places]
    broad = np.einsum("s,spc->pc", basis.product([_low(basis, 1)] * 2), span)
    colours = sum(picture * colour for picture, colour in zip(shifted, np.eye(3) * 0.9 + 0.05, strict=True))
    _sheet(setting, [shifted[0], broad, colours], ["to the left", "broader", "three at once"], "figure-3")
    kept = principal_components(gram(Evened(span, basis)), basis, keep=Keep(count=20))
    weights, emission = panel_light(4, places[0])
    twenty = np.einsum("k,kpc->pc", kept.mixing @ weights, kept.images(span))
    direct, _ = path_traced_picture(
        setting.surfaces, lamp, setting.camera, emission=emission, width=setting.size, height=setting.size,
        samples=setting.samples, depth=setting.depth,
    )  # fmt: skip
    _sheet(
        setting,
        [direct.reshape(-1, 3), shifted[0], twenty],
        ["Mitsuba's path tracer", "81 basis images", "20 components"],
        "figure-4",
    )
    span = setting.span(panel(2, 3))
    down, aside = np.array([0.0, -1.0, 0.0]), np.array([0.75, -0.66, 0.0])
    cases = ((places[0], down), (places[0], aside), (places[2], aside))
    turned = [np.einsum("s,spc->pc", panel_light(2, p, degree=3, aim=a)[0], span) for p, a in cases]
    _sheet(setting, turned, ["pointing down", "turned", "turned and moved"], "figure-5")
    truth, ours = direct.reshape(-1, 3), shifted[0]
    return {
        "81 against the path tracer, dB (noise of both included)": psnr(ours, truth),
        "20 against 81, dB": psnr(twenty, ours),
    }


def _low(basis: PanelBasis, power: int) -> np.ndarray:
    from prelight.bases.panels import axis_shift, power_coefficients

    return axis_shift(basis.harmonics[0], 0.5) @ power_coefficients(power, basis.harmonics[0])


def _sheet(setting: Setting, pictures: list[np.ndarray], captions: list[str], name: str) -> None:
    shown = [np.maximum(p, 0).reshape(setting.size, setting.size, 3).astype(np.float32) for p in pictures]
    stops = min(Picture(p).stops("auto") for p in shown) - 0.7
    displayed = [enlarged(Picture(p).display(exposure=stops), at_least=384) for p in shown]
    save_figure(panels(displayed, captions), RESULTS / f"{name}.png", force=True)


PARTS: dict[str, Callable[[Setting], dict[str, Any]]] = {
    "one-pass": one_pass, "agreement": agreement, "components": components, "poses": poses, "figures": figures,
}  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", help=", ".join(PARTS))
    parser.add_argument("--size", type=int, default=128)
    parser.add_argument("--samples", type=int, default=512)
    parser.add_argument("--light-paths", type=int, default=128)
    given = parser.parse_args()
    setting = Setting(given.size, given.samples, given.light_paths)
    for part in given.parts or PARTS:
        found = {"size": given.size, "samples": given.samples, **PARTS[part](setting)}
        (RESULTS / f"{part}.json").write_text(json.dumps(found, indent=1) + "\n")
        print(json.dumps({part: found}, indent=1))


if __name__ == "__main__":
    main()
