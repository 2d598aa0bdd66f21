"""One environment light beside what its cluster keeps of it (paper, figure 5)."""

from __future__ import annotations

import numpy as np

from ..bases.cube_map import face_coordinates, solid_angles, texel_directions
from ..camera import Camera
from ..drawing.figures import Shown, difference_picture, enlarged, panels, readable_factor
from ..errors import InputError
from ..lighting.painting import pointing
from .relighter import Relighter
from .strong_lights import StrongLights

_SIZE = 560, 420
_MOST_EMPHASIS = 20.0  # beyond it shows how bytes are rounded, not what clusters lose
_PANEL = 320  # pixels, that small pictures are enlarged to


def light_figure(light: Relighter, azimuth_deg: float, elevation_deg: float, *, camera: Camera) -> Shown:
    """T_l of the texel in a direction, T_C of its cluster, and their difference: three panels.

    Leaves ``light`` under that light alone. Raises InputError for angles that are not finite, and
    MissingExtraError where materials need the renderer and it is not there.
    """
    if not (np.isfinite(azimuth_deg) and -90 <= elevation_deg <= 90):
        raise InputError(
            "light", f"{azimuth_deg},{elevation_deg}, expected an azimuth and an elevation of −90 to 90"
        )
    R = light.resolution
    face, u, v = (x[0] for x in face_coordinates(pointing(azimuth_deg, elevation_deg)[None]))
    column, row = (int(np.clip((t + 1) * R / 2, 0, R - 1)) for t in (u, v))
    light.light_texel(int(face), row, column, 1.0 / float(solid_angles(R)[row, column]))
    clustered = light.radiance
    d = texel_directions(np.array([(int(face) * R + row) * R + column]), R)
    one = StrongLights(np.array([[face, row, column, 1, 1]], np.int32), d, np.ones((1, 3)))
    alone = light.traced_radiance(one)
    width, height = light.picture_size or _SIZE
    pictures = [
        light.picture_of(radiance, camera, width=width, height=height) for radiance in (alone, clustered)
    ]
    stops = pictures[0].stops("auto")
    shown = [enlarged(picture.display(exposure=stops), at_least=_PANEL) for picture in pictures]
    linear = [enlarged(picture.linear, at_least=_PANEL) for picture in pictures]
    factor = readable_factor(2.0**-stops, *linear, most=_MOST_EMPHASIS)
    difference = difference_picture(*linear, factor=factor, white=2.0**-stops)
    kept = f"its cluster, T_C: {_texels(light, int(face), row, column)}"
    return panels([*shown, difference], ["one light alone, T_l", kept, "difference"])


def _texels(light: Relighter, face: int, row: int, column: int) -> str:
    """How many texels the cluster has that a texel is in; of several zones the smallest and the largest."""
    sizes = sorted(_clusters_at(light, face, row, column), key=lambda size: size[0] * size[1])
    words = [f"{height}×{width}" for height, width in dict.fromkeys((sizes[0], sizes[-1]))]
    plural = "" if words == ["1×1"] else "s"
    zones = f" in {light.zones} zones" if light.zones > 1 else ""
    return " to ".join(words) + f" texel{plural}{zones}"


def _clusters_at(light: Relighter, face: int, row: int, column: int) -> list[tuple[int, int]]:
    """Height×width in texels of each zone's cluster that a texel is in."""
    sizes = []
    for zone in range(light.zones):
        f, r, c, h, w = light.clusters(zone).T
        here = (f == face) & (r <= row) & (row < r + h) & (c <= column) & (column < c + w)
        sizes += [(int(h[k]), int(w[k])) for k in np.flatnonzero(here)]
    return sizes
