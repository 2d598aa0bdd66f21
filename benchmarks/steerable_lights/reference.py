"""Direct renders under the real light by Mitsuba's ``path``, one by one and kept: a long one is made in pieces."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from setting import Setting, aims, panel, panel_light, spot, spot_light

from prelight.bases.panels import PanelBasis
from prelight.bases.products import ProductBasis
from prelight.bases.steering import SpotBasis
from prelight.transport.steered_reference import path_traced_picture

LIGHTS, RENDERS = 2, 8
MORE = {"36 spots": 4}  # times as many samples: a small lamp met over a mirror is a spark


@dataclass(frozen=True)
class Case:
    """A lamp, its basis, lights (coefficients, emission) beside the basis lights, and how many images are kept."""

    name: str
    lamp: Any
    basis: Any
    lights: list[Any]
    papers: int


def cases() -> dict[str, Case]:
    """The bases of figures 1, 3 and 4, and 5."""
    at = np.random.default_rng(4).uniform(0.3, 0.7, (LIGHTS, 2))
    both = ProductBasis(PanelBasis((2, 2)), SpotBasis(3))
    turned = [panel_light(2, p, degree=3, aim=aim) for p, aim in zip(at, aims(LIGHTS), strict=True)]
    every = (
        Case("36 spots", spot(5), SpotBasis(5), [spot_light(5, aim) for aim in aims(LIGHTS)], 12),
        Case("81 panels", panel(4), PanelBasis((4, 4)), [panel_light(4, p) for p in at], 20),
        Case("400 panels and spots", panel(2, 3), both, turned, 50),
    )
    return {case.name: case for case in every}


class Direct:
    """The mean of several renders of different seeds.

    What is brighter than the peak, the 99th percentile, is as bright as that in all pictures: the lamp in the mirror
    ball. Noise is what is between the renders, sparks and all.
    """

    def __init__(self, setting: Setting, case: Case, light: int, *, most: int = 10**6) -> None:
        each = setting.reference_samples * MORE.get(case.name, 1) // RENDERS
        self.each = max(2, math.isqrt(each)) ** 2
        self.seconds, self.made, found = 0.0, 0, []
        for seed in range(setting.renders):
            name = f"{setting.size}-{self.each}-{case.name.replace(' ', '-')}-{light}-{seed}.npz"
            path = None if setting.work is None else Path(setting.work) / name
            if path is None or not path.exists():
                if self.made == most:
                    continue
                self.made += 1
                render, taken = self._render(setting, case, light, seed)
                if path is not None:
                    path.parent.mkdir(parents=True, exist_ok=True)
                    np.savez(path, render=render, seconds=taken)
            else:
                kept = np.load(path)
                render, taken = kept["render"], float(kept["seconds"])
            found.append(render)
            self.seconds += taken
        self.renders = len(found)
        if found:
            self._renders = np.stack(found).astype(np.float64)

    def _render(self, setting: Setting, case: Case, light: int, seed: int) -> tuple[np.ndarray, float]:
        started = time.perf_counter()
        picture, _ = path_traced_picture(
            setting.surfaces, case.lamp, setting.camera, emission=case.lights[light][1], width=setting.size,
            height=setting.size, samples=self.each, depth=setting.depth, seed=100 + seed, sampler="multijitter",
        )  # fmt: skip
        return picture.reshape(-1, 3).astype(np.float32), time.perf_counter() - started

    @property
    def samples(self) -> int:
        return self.each * self.renders

    @cached_property
    def peak(self) -> float:
        return float(np.percentile(self._renders.mean(axis=0), 99))

    @cached_property
    def picture(self) -> np.ndarray:
        """The mean (pixels, 3), no pixel beyond the peak."""
        return self.cut(self._renders.mean(axis=0))

    @cached_property
    def _bright(self) -> np.ndarray:
        """Pixels in which the lamp itself is seen, and the peak all that counts: noise there is none."""
        return np.median(self._renders, axis=0) > self.peak

    @cached_property
    def left(self) -> float:
        """Mean square noise of the picture."""
        variance = self._renders.var(axis=0, ddof=1) / self.renders
        return float(np.where(self._bright, 0.0, variance).mean())

    @cached_property
    def noise(self) -> float:
        """Mean square noise of one render, without sparks."""
        every = self.cut(self._renders)
        spread = np.median(np.abs(every - np.median(every, axis=0)), axis=0) / 0.6745
        return float(np.square(spread).mean())

    def cut(self, picture: np.ndarray) -> np.ndarray:
        """A picture as it is compared: no pixel beyond the peak."""
        return np.clip(picture, 0.0, self.peak)

    def psnr(self, picture: np.ndarray, own_noise: float = 0.0) -> dict[str, float]:
        """Linear, against the peak: as it is, and without what both pictures' noise explains."""
        square = float(np.square(self.cut(picture) - self.picture, dtype=np.float64).mean())
        beyond = max(square - self.left - own_noise, 1e-2 * (self.left + own_noise))
        return {
            "as_it_is": decibels(self.peak**2 / square),
            "beyond_noise": decibels(self.peak**2 / beyond),
        }

    def halves(self) -> float:
        """PSNR of half of the renders against the others: so alike are two references of half the samples."""
        first, second = (self.cut(half.mean(axis=0)) for half in (self._renders[::2], self._renders[1::2]))
        return decibels(self.peak**2 / float(np.square(first - second).mean()))


def decibels(ratio: float) -> float:
    """Of a ratio of powers."""
    return float(10 * np.log10(ratio))


def references(setting: Setting) -> dict[str, Any]:
    """Direct renders, as many as are asked for at a time; how many are there."""
    left, found = setting.pieces, {}
    for case in cases().values():
        for light in range(LIGHTS):
            if setting.case in (None, case.name):
                direct = Direct(setting, case, light, most=left)
                left -= direct.made
                missing = setting.renders - direct.renders
                found[f"{case.name}, light {light}"] = f"{missing} missing" if missing else "all there"
    return found
