"""What an environment bake is asked for, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..bases.cube_map import MAX_RESOLUTION
from ..camera import Camera
from ..errors import InputError
from ..scene.geometry import Scene
from .clustering import ClusterTest
from .sun_paths import SunPaths

DEFAULT_TOLERANCE = 0.0135  # the Bunny of the paper at ε = 5e-5
LEAST_MEMORY = 500_000_000
MOST_ZONES = 4096
MOST_PIXELS_PER_SIDE = 2048
MOST_BOUNCES = 1000
GATHER_RAYS = 1024
MOST_GATHER_RAYS = 1 << 14
MOST_GLOSSY_ORDER = 16
PHOTONS = 1 << 22  # of the whole sky, where a material needs them
MOST_PHOTONS = 1 << 28
VERTICES, PIXELS = "vertices", "pixels"


@dataclass(frozen=True)
class EnvironmentSettings:
    """What to bake.

    Parameters
    ----------
    resolution
        R: the environment is a cube map of 6·R·R lights; 1 to 4096.
    tolerance
        τ, the RMS over the receivers of a zone, in units of transfer (a fully lit receiver facing the light
        has 1/π), by which a light may differ from its cluster. Default 0.0135.
    epsilon
        The paper's ε = τ/√N instead of ``tolerance``, N all receivers; give one of the two.
    samples_per_side
        s: s×s sample lights for each node of the quadtree; 2 to 9.
    memory
        Bytes the process may use; default half of this machine's.
    receivers
        "vertices", or "pixels": what one fixed eye sees, at its pixels.
    camera
        The eye, or its name in the scene. Pixels need one; at vertices it makes all that is not Lambertian
        answer as seen from there (and only from there). Without it every surface is diffuse.
    width, height
        Of the picture whose pixels are receivers; 1 to 2048 each.
    pixel_samples
        Points whose mean a pixel is; a square number, 1 to 64.
    zones
        About how many parts the receivers are divided into by place, each with its own clusters; 1 to 4096.
        What differs in kind (Lambertian, glossy, mirroring) is divided in any case where the eye is fixed.
    sun_paths
        A latitude, −90 to 90, or "any": where the sun stands there through a year (north is −Z), a light may
        differ from its cluster by a quarter of the tolerance only; "any" is all above the horizon.
    glossy_order
        Order of the harmonics that hold what glossy vertices send into all directions, 1 to 16; 0 for none: then every
        surface is diffuse unless a camera is given.
    bounces
        How often light may bounce: None for as often as it matters, 0 for direct light only, at most 1000.
    gather_rays
        Rays from each receiver that find what light has bounced towards it; a square number up to 16,384.
    photons
        Of the whole sky, that find what clear glass and mirrors send on, and its bounces; 0 for none: then glass casts
        plain shadows. None for four millions where a material needs them.
    """

    resolution: int = 256
    tolerance: float | None = None
    epsilon: float | None = None
    samples_per_side: int = 3
    memory: int | None = None
    receivers: str = VERTICES
    camera: Camera | str | None = None
    width: int = 256
    height: int = 144
    pixel_samples: int = 4
    zones: int = 1
    bounces: int | None = None
    gather_rays: int = GATHER_RAYS
    sun_paths: float | str | None = None
    glossy_order: int = 0
    photons: int | None = None

    def __post_init__(self) -> None:
        for name, value, least, most in (
            ("resolution", self.resolution, 1, MAX_RESOLUTION),
            ("samples-per-side", self.samples_per_side, 2, 9),
            ("zones", self.zones, 1, MOST_ZONES),
            ("width", self.width, 1, MOST_PIXELS_PER_SIDE),
            ("height", self.height, 1, MOST_PIXELS_PER_SIDE),
            ("pixel-samples", self.pixel_samples, 1, 64),
            ("bounces", 0 if self.bounces is None else self.bounces, 0, MOST_BOUNCES),
            ("gather-rays", self.gather_rays, 1, MOST_GATHER_RAYS),
            ("glossy-order", self.glossy_order, 0, MOST_GLOSSY_ORDER),
            ("photons", 0 if self.photons is None else self.photons, 0, MOST_PHOTONS),
        ):
            if not (isinstance(value, int) and not isinstance(value, bool) and least <= value <= most):
                raise InputError(name, f"{value!r}, expected a whole number from {least} to {most}")
        if math.isqrt(self.pixel_samples) ** 2 != self.pixel_samples:
            raise InputError(
                "pixel-samples", f"{self.pixel_samples}, expected a square number such as 1, 4 or 9"
            )
        if math.isqrt(self.gather_rays) ** 2 != self.gather_rays:
            raise InputError(
                "gather-rays", f"{self.gather_rays}, expected a square number such as 256, 1024 or 4096"
            )
        if self.tolerance is not None and self.epsilon is not None:
            raise InputError(
                "tolerance", "give --tolerance or --epsilon, not both: tolerance = epsilon·√receivers"
            )
        for name in ("tolerance", "epsilon"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and 0 < value <= 1):
                raise InputError(name, f"{value!r}, expected a number above 0 and at most 1")
        if self.sun_paths is not None:
            SunPaths.read(self.sun_paths)
        if self.memory is not None and self.memory < LEAST_MEMORY:
            raise InputError(
                "memory", f"{self.memory / 1e9:.2f} GB, a bake needs at least {LEAST_MEMORY / 1e9} GB"
            )
        if self.receivers not in (VERTICES, PIXELS):
            raise InputError("receivers", f"{self.receivers!r}, expected {VERTICES} or {PIXELS}")
        if self.glossy_order and self.camera is not None:
            raise InputError(
                "glossy-order", f"{self.glossy_order}, but --camera fixes the eye; leave one of the two out"
            )
        if self.receivers == PIXELS and self.camera is None:
            raise InputError(
                "camera", "none given; pixels are those of a camera: name one of the scene's or give one"
            )

    def tolerance_for(self, receivers: int) -> float:
        """τ for this number of receivers."""
        if self.epsilon is not None:
            return self.epsilon * math.sqrt(receivers)
        return DEFAULT_TOLERANCE if self.tolerance is None else self.tolerance

    def test_for(self, receivers: int) -> ClusterTest:
        """The clustering test of a layer of this number of receivers."""
        return ClusterTest(self.resolution, self.tolerance_for(receivers), self.samples_per_side, self.sun)

    @property
    def sun(self) -> SunPaths | None:
        """Where the tree is finer."""
        return None if self.sun_paths is None else SunPaths.read(self.sun_paths)

    def eye_in(self, scene: Scene) -> tuple[str, Camera] | None:
        """The fixed eye and its name; raises InputError for a name the scene does not know."""
        if self.camera is None:
            return None
        if isinstance(self.camera, Camera):
            return next(((n, c) for n, c in scene.cameras.items() if c == self.camera), ("eye", self.camera))
        if self.camera not in scene.cameras:
            known = ", ".join(scene.cameras) or "none"
            raise InputError("camera", f"{self.camera!r} is not in {scene.name}, whose cameras are: {known}")
        return self.camera, scene.cameras[self.camera]
