"""What a steerable bake is asked for, checked."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..bases.exponentials import ExponentialBasis
from ..bases.panels import PanelBasis
from ..bases.products import ProductBasis
from ..bases.steering import SpotBasis
from ..camera import Camera
from ..encoding.principal_components import Keep
from ..errors import InputError
from ..scene.geometry import Scene
from ..transport.basis_images import ImageSettings
from ..transport.steered_lamps import SteeredBox, SteeredLamp, SteeredPanel, SteeredSky, SteeredSpot

Basis = SpotBasis | PanelBasis | ExponentialBasis | ProductBasis
Point = tuple[float, float, float]
MOST_LAMPS = 64
MOST_DEEP = 256  # samples of a pixel
LEAST_MEMORY = 500_000_000
DEFAULT_KEEP = Keep(error=0.01)
_NAME = re.compile(r"[a-z][a-z0-9_]{0,39}")


@dataclass(frozen=True)
class BakedLamp:
    """A lamp of a bake: its name, which a rig calls it by, and the distributions it is baked for.

    ``parity``: of a spot, or of a panel's directions: "all", or "even" or "odd" (as the degree is) for those with
    f(−ω) = ±f(ω), which take half the images.
    """

    name: str
    lamp: SteeredLamp
    parity: str = "all"

    def __post_init__(self) -> None:
        if not _NAME.fullmatch(self.name):
            what = f"{self.name!r}, expected a small letter, then small letters, digits or _, 40 at most"
            raise InputError("lamp name", what)
        if self.parity not in ("all", "even", "odd"):
            raise InputError("parity", f"{self.parity!r}, expected all, even or odd")
        _ = self.basis  # says what is wrong with it

    @property
    def basis(self) -> Basis:
        """The span of its light, and the sampled set of basis lights."""
        lamp = self.lamp
        directions = None if lamp.degree is None else SpotBasis(lamp.degree, parity=self.parity)  # ty: ignore
        if isinstance(lamp, SteeredSpot | SteeredSky):
            assert directions is not None
            return directions
        axis = lamp.axis if isinstance(lamp, SteeredPanel) else None
        places = ExponentialBasis((axis, axis), orthonormal=True) if axis else PanelBasis(lamp.periods)
        return places if directions is None else ProductBasis(places, directions)

    @property
    def traced(self) -> np.ndarray:
        """Which of the functions that are traced span its light, (S,) int64."""
        basis = self.basis
        if isinstance(basis, PanelBasis | ExponentialBasis):
            return np.arange(basis.functions)
        spot = basis if isinstance(basis, SpotBasis) else basis.spot
        every = (spot.degree + 1) ** 2
        return (np.arange(self.lamp.functions // every)[:, None] * every + spot.kept).ravel()

    def place(self) -> dict[str, Any]:
        """Kind, origin and edges, as `lighting.places.Place` takes them."""
        lamp = self.lamp
        if isinstance(lamp, SteeredSky):
            return {"kind": "sky", "origin": [0.0, 0.0, 0.0], "edges": []}
        if isinstance(lamp, SteeredSpot):
            return {"kind": "spot", "origin": list(lamp.position), "edges": []}
        edges = [list(lamp.side_u), list(lamp.side_v)]
        if isinstance(lamp, SteeredBox):
            return {"kind": "box", "origin": list(lamp.corner), "edges": [*edges, list(lamp.side_w)]}
        return {"kind": "panel", "origin": list(lamp.corner), "edges": edges}

    def basis_text(self) -> str:
        """The basis as JSON, as a bake keeps it."""
        lamp = self.lamp
        described: dict[str, Any] = {"kind": "spot", "degree": lamp.degree, "parity": self.parity}
        if isinstance(lamp, SteeredPanel | SteeredBox):
            described = {"kind": "panel", "harmonics": list(lamp.periods)}
            if isinstance(lamp, SteeredPanel) and lamp.terms:
                described = {"kind": "exponential", "terms": [list(term) for term in lamp.terms]}
            if lamp.degree is not None:
                described |= {"kind": "product", "degree": lamp.degree, "parity": self.parity}
        return json.dumps(described, sort_keys=True)


@dataclass(frozen=True)
class SteerableSettings:
    """What to bake.

    Parameters
    ----------
    lamps
        One to 64, with different names; each becomes a layer.
    camera
        The fixed eye, or its name in the scene; the scene's first if not said.
    images
        Size and quality, the same for all.
    keep
        How many components: pictures within 1 % RMS if not said; the paper's rule is ``Keep()``, 0.9 of the sum of
        singular values; "all" for every basis light.
    deep
        Samples of a pixel in which the first bounce is kept apart, exact for every shape; 0 keeps none, else
        basis images hold the later bounces alone. At most 256.
    memory
        Bytes the process may use; default half of this machine's.
    """

    lamps: tuple[BakedLamp, ...]
    camera: Camera | str | None = None
    images: ImageSettings = field(default_factory=ImageSettings)
    keep: Keep | str = DEFAULT_KEEP
    deep: int = 0
    memory: int | None = None

    def __post_init__(self) -> None:
        if not 1 <= len(self.lamps) <= MOST_LAMPS:
            raise InputError("lamps", f"{len(self.lamps)}, expected 1 to {MOST_LAMPS} spots and panels")
        names = [lamp.name for lamp in self.lamps]
        if double := next((name for name in names if names.count(name) > 1), None):
            raise InputError("lamp name", f"{double!r} is given twice; a rig could not tell them apart")
        if isinstance(self.deep, bool) or not isinstance(self.deep, int) or not 0 <= self.deep <= MOST_DEEP:
            raise InputError("deep", f"{self.deep!r}, expected a whole number from 0 to {MOST_DEEP}")
        if self.deep and not self.images.indirect_only:
            object.__setattr__(self, "images", replace(self.images, indirect_only=True))
        if self.deep and any(isinstance(lamp.lamp, SteeredBox) for lamp in self.lamps):
            raise InputError("deep", "the first bounce of a box of light is not kept apart; bake it without")
        if isinstance(self.keep, str) and self.keep != "all":
            raise InputError("keep", f"{self.keep!r}, expected a rule or all")
        if self.memory is not None and self.memory < LEAST_MEMORY:
            raise InputError(
                "memory", f"{self.memory / 1e9:.2f} GB, a bake needs at least {LEAST_MEMORY / 1e9} GB"
            )
        if isinstance(self.keep, Keep):
            for lamp in self.lamps:
                self.keep.number(np.ones(lamp.basis.functions))

    @classmethod
    def of(  # noqa: PLR0913  (one by one, for notebooks)
        cls,
        spots: Mapping[str, Point] | None = None,
        panels: Mapping[str, tuple[Point, Point, Point]] | None = None,
        *,
        degree: int = 5,
        periods: int = 4,
        panel_degree: int | None = None,
        radius: float = 0.02,
        camera: Camera | str | None = None,
        width: int = 256,
        height: int = 256,
        samples: int = 256,
        keep: Keep | str = DEFAULT_KEEP,
        deep: int = 0,
    ) -> SteerableSettings:
        """Settings in a line, as the options of ``prelight bake steerable`` are.

        ``spots``: where each is, by name; ``panels``: corner, first and second side of each; metres. ``radius`` of the
        spots, metres. ``samples``: paths through each pixel. Raises InputError.
        """
        images = ImageSettings(width, height, samples)
        lamps = [BakedLamp(name, SteeredSpot(at, degree, radius)) for name, at in (spots or {}).items()]
        for name, (corner, side_u, side_v) in (panels or {}).items():
            panel = SteeredPanel(corner, side_u, side_v, (periods, periods), panel_degree)
            lamps.append(BakedLamp(name, panel))
        return cls(tuple(lamps), camera, images, keep=keep, deep=deep)

    def eye_in(self, scene: Scene) -> tuple[str, Camera]:
        """The eye and its name; raises InputError for a name that the scene does not know."""
        if isinstance(self.camera, Camera):
            return next(((n, c) for n, c in scene.cameras.items() if c == self.camera), ("eye", self.camera))
        known = ", ".join(scene.cameras) or "none"
        if self.camera is None:
            if not scene.cameras:
                raise InputError("camera", f"{scene.name} has none; give one as a JSON file")
            return next(iter(scene.cameras.items()))
        if self.camera not in scene.cameras:
            raise InputError("camera", f"{self.camera!r} is not in {scene.name}, whose cameras are: {known}")
        return self.camera, scene.cameras[self.camera]

    def check_in(self, scene: Scene) -> None:
        """Raises InputError for a lamp far outside the scene: a slip of the pen, rather than a sun."""
        used = scene.positions[np.unique(scene.triangles)]
        low, high = used.min(axis=0), used.max(axis=0)
        far = float(np.linalg.norm(high - low))
        for one in self.lamps:
            if one.lamp.middle is None:
                continue
            away = np.maximum(np.maximum(low - one.lamp.middle, one.lamp.middle - high), 0.0)
            if np.linalg.norm(away) > far:
                where = ", ".join(f"{x:g}" for x in one.lamp.middle)
                box = " to ".join(", ".join(f"{x:.3g}" for x in corner) for corner in (low, high))
                raise InputError(
                    one.name,
                    f"at {where}, farther outside the scene ({box}) than that is large; move it nearer",
                )

    def keep_text(self) -> str:
        """The rule in a word, part of a bake's identity."""
        return str(self.keep)
