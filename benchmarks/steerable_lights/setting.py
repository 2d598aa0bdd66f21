"""What the parts of this benchmark share: the scene, its lamps, the reference and figures of merit."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from prelight.bases import spherical_harmonics as sh
from prelight.bases.panels import PanelBasis
from prelight.bases.products import ProductBasis
from prelight.bases.steering import SpotBasis
from prelight.drawing.figures import enlarged, panels, save_figure
from prelight.drawing.picture import Picture
from prelight.rays.surfaces import SurfaceScene
from prelight.scene.stock import chess
from prelight.scene.stock.catalogue import stock_scene
from prelight.transport.basis_images import BasisTracer, ImageSettings, TracedRows
from prelight.transport.steered_lamps import SteeredLamp, SteeredPanel, SteeredSpot
from prelight.transport.steered_reference import Emission


@dataclass(frozen=True)
class Setting:
    """The chessmen at some size and quality."""

    size: int
    samples: int
    light_paths: int
    depth: int = 10
    reference_samples: int = 4096
    rivals: dict[str, str] = field(default_factory=dict)  # folders where they are installed
    work: str | None = None  # a folder where direct renders are kept
    case: str | None = None  # the one to be measured; all without
    renderer: str | None = None  # of fixed lights, the one to be measured; and with how many lamps
    lamps: int | None = None
    renders: int = 8  # that a reference is the mean of
    pieces: int = 1_000_000  # renders to be made at once
    results: Path = Path(__file__).parent / "results"

    @cached_property
    def scene(self) -> Any:
        return stock_scene("steerable-small")

    @cached_property
    def surfaces(self) -> SurfaceScene:
        return SurfaceScene(self.scene)

    @property
    def camera(self) -> Any:
        return self.scene.cameras["front"]

    def images(self, **changed: Any) -> ImageSettings:
        known = {"samples": self.samples, "particles": self.light_paths, "depth": self.depth}
        return ImageSettings(self.size, self.size, **{**known, **changed})

    def tracer(self, lamp: SteeredLamp, **changed: Any) -> BasisTracer:
        return BasisTracer(
            self.scene, lamp, self.camera, settings=self.images(**changed), surfaces=self.surfaces
        )

    def traced(self, tracer: BasisTracer, weights: np.ndarray | None = None) -> tuple[TracedRows, TracedRows]:
        """What paths from the eye bring, and those from the lamp."""
        rows = tracer.pixels(0, tracer.settings.pixels, weights=weights)
        total = tracer.nothing(poses=0 if weights is None else len(weights))
        for batch in range(tracer.batches):
            tracer.add_batch(batch, total, weights=weights)
        return rows, total

    def span(self, lamp: SteeredLamp, **changed: Any) -> np.ndarray:
        """Span images (S, pixels, 3)."""
        rows, total = self.traced(self.tracer(lamp, **changed))
        return np.ascontiguousarray((rows.images + total.images).transpose(2, 0, 1))

    def sheet(self, pictures: list[np.ndarray], captions: list[str], name: str) -> None:
        """Pictures (pixels, 3) of one exposure beside each other."""
        shown = [np.maximum(p, 0).reshape(self.size, self.size, 3).astype(np.float32) for p in pictures]
        stops = min(Picture(p).stops("auto") for p in shown) - 0.7
        displayed = [enlarged(Picture(p).display(exposure=stops), at_least=384) for p in shown]
        save_figure(panels(displayed, captions), self.results / f"{name}.png", force=True)


def spot(degree: int, *, radius: float = 0.02) -> SteeredSpot:
    return SteeredSpot(chess.SPOT_AT, degree, radius)


def panel(periods: int, degree: int | None = None) -> SteeredPanel:
    return SteeredPanel(*chess.PANEL, (periods, periods), degree)


def aims(count: int, seed: int = 0) -> list[np.ndarray]:
    """Directions from the spot to random places on the board."""
    rng = np.random.default_rng(seed)
    found = rng.uniform((-0.35, 0.0, -0.35), (0.35, 0.2, 0.35), (count, 3)) - chess.SPOT_AT
    return list(found / np.linalg.norm(found, axis=1, keepdims=True))


def toward(target: tuple[float, float, float]) -> np.ndarray:
    """The direction from the spot to a place."""
    way = np.array(target) - chess.SPOT_AT
    return way / np.linalg.norm(way)


def spot_light(degree: int, aim: np.ndarray) -> tuple[np.ndarray, Emission]:
    """((1 + ω·p)/2)^N: coefficients, and the real light for Mitsuba."""

    def emission(mi: Any, d: Any, u: Any, v: Any) -> Any:
        return mi.Color3f(((1 + _along(d, aim)) / 2) ** degree)

    return SpotBasis(degree).coefficients(sh.power_factors(degree), aim), emission


def legendre_light(degree: int, aim: np.ndarray) -> tuple[np.ndarray, Emission]:
    """1 + P_N(ω·p): half of it is in the top band, so that one degree less cannot hold it."""
    powers = np.polynomial.legendre.leg2poly([0] * degree + [1])
    powers[0] += 1

    def emission(mi: Any, d: Any, u: Any, v: Any) -> Any:
        cosine, total = _along(d, aim), 0
        for factor in powers[::-1]:
            total = total * cosine + float(factor)
        return mi.Color3f(total)

    return SpotBasis(degree).coefficients(sh.polynomial_factors(powers.tolist()), aim), emission


def panel_light(
    periods: int, at: np.ndarray, *, degree: int | None = None, aim: Any = None
) -> tuple[np.ndarray, Emission]:
    """The basis lights' own shape shifted to ``at``, and aimed where it turns."""
    basis = PanelBasis((periods, periods))
    placed = basis.shifted(basis.own_shape, at - 0.0)
    weights = placed
    if degree is not None:
        both = ProductBasis(basis, SpotBasis(degree))
        weights = both.coefficients(placed, both.spot.coefficients(sh.power_factors(degree), aim))

    def emission(mi: Any, d: Any, u: Any, v: Any) -> Any:
        import drjit as dr

        value = mi.Float(1) if degree is None else ((1 + _along(d, aim)) / 2) ** degree
        for x, place in ((u, at[0]), (v, at[1])):
            value = value * ((1 + dr.cos(2 * np.pi * (x - float(place)))) / 2) ** periods
        return mi.Color3f(value)

    return weights, emission


def _along(d: Any, aim: np.ndarray) -> Any:
    return d.x * float(aim[0]) + d.y * float(aim[1]) + d.z * float(aim[2])


def psnr(ours: np.ndarray, truth: np.ndarray) -> float:
    """Linear, against the 99th percentile."""
    error = float(np.square(ours - truth, dtype=np.float64).mean())
    return float(10 * np.log10(np.percentile(truth, 99) ** 2 / max(error, 1e-300)))


def seconds(act: Callable[[], Any]) -> float:
    started = time.perf_counter()
    act()
    return time.perf_counter() - started
