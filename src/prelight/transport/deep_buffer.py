"""The first bounce of a lamp's light, kept sub-pixel by sub-pixel (Teo, Simoncelli and Heeger 1997, section 7).

The paper stores whether each sub-pixel sees the lamp. Here it is what the lamp brings it and how that left, in which
direction and on a panel at which place, so that materials, distances and soft edges of shadows are in it, and any
distribution is exact, however narrow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Float32, Int64
from ..camera import Camera
from ..rays.surfaces import SurfaceScene
from .basis_images import LANES, ImageSettings, stage_seed
from .steered_lamps import SteeredPanel, SteeredSky, SteeredSpot

_STAGE = 3


@dataclass(frozen=True)
class DeepSamples:
    """What reaches each pixel directly: entries ``starts[p]`` to ``starts[p + 1]`` are those of pixel p."""

    starts: Int64[np.ndarray, "pixels+1"]
    colours: Float32[np.ndarray, "entries 3"]  # radiance where the lamp's emission there is 1
    directions: Float32[np.ndarray, "entries 3"]  # in which light left the lamp; of a sky, toward it
    places: Float32[np.ndarray, "entries 2"]  # 0 to 1 along a panel's sides; 0 of others
    aimed: np.ndarray  # (entries,) bool: at its own one of ⌊√samples⌋² squares of a panel; else met by chance


def deep_samples(
    surfaces: SurfaceScene,
    lamp: SteeredSpot | SteeredPanel | SteeredSky,
    camera: Camera,
    *,
    settings: ImageSettings,
    samples: int,
) -> DeepSamples:
    """Light from the lamp by one surface to the eye, ``samples`` paths through each pixel.

    A lamp in a mirror is among it; what is lit and seen in a mirror is not, it is in the basis images.
    """
    from .eye_paths import EyePaths, PathRules

    frame = {"width": settings.width, "height": settings.height}
    paths = EyePaths(
        surfaces, lamp, camera, rules=PathRules(2, 2, by_chance=False, marks_aimed=True), **frame
    )
    step, pixels = max(1, LANES // samples), settings.pixels
    counts, colours, directions, places = [], [], [], []
    for tile, first in enumerate(range(0, pixels, step)):
        here = min(step, pixels - first)
        records = paths.trace(first, here, samples=samples, seed=stage_seed(settings.seed, _STAGE, tile))
        lanes = here * samples
        filled = np.arange(len(records.carried) // lanes)[None, :] < records.counts[:, None]
        lane, slot = np.nonzero(filled)  # pixel after pixel
        entry = slot * lanes + lane
        counts.append(np.bincount(lane // samples, minlength=here))
        colours.append(records.carried[entry, :3] / np.float32(samples))
        directions.append(records.left[entry, :3])
        places.append(np.stack([records.carried[entry, 3], records.left[entry, 3]], axis=1))
    starts = np.concatenate([[0], np.cumsum(np.concatenate(counts))]).astype(np.int64)
    place = np.concatenate(places)
    aimed = place[:, 0] > 1.5
    place[aimed, 0] -= 2
    return DeepSamples(starts, np.concatenate(colours), np.concatenate(directions), place, aimed)
