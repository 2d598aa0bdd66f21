"""A rig to begin with: what the layers of a bake can be lit by, as a commented file."""

from __future__ import annotations

import json

import numpy as np

from ..bases.steering import SpotBasis
from ..lighting.quantities import Triple
from ..storage.bake import Bake
from .stored_steerable import basis_of, steerable_names
from .takers import LAMPS, SKIES

_HEAD = """# A rig for {name}: everything that lights it. Change it, then:
#   prelight relight {path} THIS_FILE.toml -o picture.png
# docs/rig.md tells every key. Lines that begin with # are left out.
"""
_SKY = """
# The light around the scene: one of the built-in skies (overcast, noon, sunset, studio, stage) or a map (.hdr, .exr).
[environment]
map = "stock:sunset"
rotate_deg = 0.0            # about +Y, counter-clockwise seen from above
scale = 1.0                 # factor of radiance
tint = [1.0, 1.0, 1.0]

# Or the sun and the clear sky of a place, a day and an hour, instead of [environment]:
# [sun]
# place = [43.74, 15.89]    # degrees north, east
# time = "2026-06-21T15:00" # by the sun; with zone = "Europe/Zagreb" by the clock there
# north_deg = 0.0           # where north lies, from -Z towards +X

# A soft round light in the sky:
# [[disc]]
# name = "key"
# azimuth_deg = -125.0      # 0 is ahead (-Z), 90 right (+X)
# elevation_deg = 35.0
# radius_deg = 8.0
# radiance = [8.0, 7.2, 6.2]
# softness = 0.5
"""
_LAMPS = """
# Lights with a place in the scene, in metres: it reaches from {low} to {high}.
[[lamp]]
name = "lamp"
position = {middle}
radius = {radius}
lumens = {lumens}
kelvin = 3000.0
scale = {scale}               # its dimmer; 0 is off{why}

# [[spot]]
# name = "spot"
# position = {middle}
# target = {below}
# width_deg = 40.0          # of the beam, at half its intensity
# intensity = {intensity}   # W/sr along the beam

# [[panel]]
# name = "panel"
# position = {middle}
# size = [{side}, {side}]
# target = {below}
# lumens = {lumens}
"""
_PORTALS = """
# The glass of the portals: clear, frosted or shut; what it lets through; the share that a blind covers.
"""
_PORTAL = """[[portal]]
name = {name}
glass = "clear"
# tint = [1.0, 0.9, 0.8]    # in place of the colour that it was built with
blind = 0.0

"""


def new_rig(bake: Bake) -> str:
    """The text of a rig that lights a bake, and says in comments what else could.

    Raises InputError where no layer can be lit by this version, DamagedBakeError.
    """
    kinds = {record.kind for record in bake.layers.values()}
    has_sky = bool(kinds & set(SKIES))
    text = _HEAD.format(name=" ".join(bake.manifest.scene.name.split()), path=bake.path.name)
    text += _SKY if has_sky else ""
    text += _lamps(bake, is_lit=not has_sky) if kinds & set(LAMPS) else ""
    text += _portals(bake) if "portals" in kinds else ""
    if steerable_names(bake):
        text += _steerable(bake, is_lit=not has_sky)
    return text


def _lamps(bake: Bake, *, is_lit: bool) -> str:
    """A lamp above the middle, as strong as a white floor under it needs to have a radiance of one."""
    positions = bake.receivers.positions.astype(np.float64)
    low, high = positions.min(axis=0), positions.max(axis=0)
    side = float(np.linalg.norm(high - low))
    middle = 0.5 * (low + high) + np.array([0.0, 0.25, 0.0]) * (high - low)
    below = np.array([middle[0], low[1], middle[2]])
    distance = max(float(middle[1] - low[1]), 0.05 * side, 1e-3)
    watts = np.pi * distance**2  # per steradian
    intensity = _numbers((watts, 0.93 * watts, 0.82 * watts))
    return _LAMPS.format(
        low=_numbers(low.tolist()), high=_numbers(high.tolist()), middle=_numbers(middle.tolist()),
        below=_numbers(below.tolist()), radius=_number(0.01 * side), lumens=_number(4 * np.pi * 683 * watts),
        intensity=intensity, side=_number(0.15 * side), scale="1.0" if is_lit else "0.0",
        why="" if is_lit else ": 1.0 lights it",
    )  # fmt: skip


def _portals(bake: Bake) -> str:
    from .portals_layer import read_portals

    names = read_portals(bake, None).names
    return _PORTALS + "".join(_PORTAL.format(name=json.dumps(name, ensure_ascii=False)) for name in names)


def _steerable(bake: Bake, *, is_lit: bool) -> str:
    """A spot for each layer of spots, a panel for each of panels; in comments where a sky shines already."""
    text, mark = (
        "\n# Lights of layers that were baked for them: aimed and slid within these.\n",
        "" if is_lit else "# ",
    )
    for name in steerable_names(bake):
        said = bake.layers[name].parameters
        basis, place = basis_of(str(said["basis"])), json.loads(str(said["place"]))
        layer = f"layer = {json.dumps(name, ensure_ascii=False)}"
        if isinstance(basis, SpotBasis):
            up = 1.0 if place["kind"] == "sky" else -1.0  # a sky's direction is where light comes from
            rows = ["[[spot]]", layer, f"direction = [0.0, {up}, 0.0]", "intensity = [10.0, 10.0, 10.0]"]
        else:
            middle = _numbers([0.5] * max(2, len(place["edges"])))
            rows = ["[[panel]]", layer, f"position = {middle}", "width = 0.3", "radiance = [1.0, 1.0, 1.0]"]
        text += "".join(f"{mark}{row}\n" for row in rows) + "\n"
    return text


def _number(value: float) -> str:
    return repr(float(f"{value:.3g}"))


def _numbers(values: Triple | list[float]) -> str:
    return "[" + ", ".join(repr(round(float(v), 3)) for v in values) + "]"
