"""Basis images by another renderer: the list of lights for it, and its pictures read back."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Float32
from ..bases.panels import PanelBasis
from ..bases.products import ProductBasis
from ..bases.steering import SpotBasis
from ..errors import InputError
from ..files import read_regular
from ..images import chromaticities
from ..images.openexr import decode_exr
from ..scene.geometry import Scene
from ..storage.bake import Bake
from ..storage.journal import refuse_target
from ..transport.steered_lamps import SteeredBox, SteeredPanel, SteeredSky, SteeredSpot
from .carrying_out import carry_out
from .scene_arrays import plain
from .steerable import finished, identity
from .steerable_plan import check_memory
from .steerable_settings import BakedLamp, SteerableSettings

_LARGEST_FILE = 1 << 28


def picture_name(lamp: str, light: int) -> str:
    """The file that holds the picture under a basis light."""
    return f"{lamp}_{light:05d}.exr"


def lights_list(scene: Scene, settings: SteerableSettings) -> bytes:
    """The basis lights of every lamp and the eye, as JSON for a person's or a renderer's script.

    A spot's light shines with intensity ((1 + ω·direction)/2)^degree W/sr ((ω·direction)^degree where it has a
    parity); a panel's with radiance ((1 + cos 2π(u − position))/2)^periods along each side; both times each other
    where a panel turns. Pictures are linear, Rec.709.
    """
    name, camera = settings.eye_in(scene)
    images = settings.images
    document = {
        "eye": {"name": name, **plain(camera.to_dict())},
        "width": images.width,
        "height": images.height,
        "pixel_filter": "tent, two pixels wide",
        "lamps": [_lamp(one) for one in settings.lamps],
    }
    return (json.dumps(document, indent=1) + "\n").encode()


def _lamp(one: BakedLamp) -> dict[str, Any]:
    basis = one.basis
    _check_physical(one)
    panel = basis.panel if isinstance(basis, ProductBasis) else basis
    panel = panel if isinstance(panel, PanelBasis) else None
    spot = basis.spot if isinstance(basis, ProductBasis) else basis if isinstance(basis, SpotBasis) else None
    aims = [None] if spot is None else spot.directions.tolist()
    places = [None] if panel is None else panel.positions.tolist()
    lights = []
    for k, (place, aim) in enumerate((place, aim) for place in places for aim in aims):
        light: dict[str, Any] = {"picture": picture_name(one.name, k)}
        if place is not None:
            light["position"] = place
        if aim is not None:
            light["direction"] = aim
        lights.append(light)
    shape = {}
    if spot is not None:
        power = "((1 + w·direction)/2)" if one.parity == "all" else "(w·direction)"
        unit = {SteeredSpot: "intensity, W/sr", SteeredSky: "radiance"}.get(type(one.lamp), "times radiance")
        way = "toward the sky" if isinstance(one.lamp, SteeredSky) else "in which light leaves"
        shape["by direction"] = f"{unit}: {power}^{spot.degree}; w is the unit direction {way}"
    if panel is not None:
        unit = "glow, W/sr/m³" if isinstance(one.lamp, SteeredBox) else "radiance"
        waves = [
            f"((1 + cos 2π({axis} − position[{k}]))/2)^{n}"
            for k, (axis, n) in enumerate(zip("uvw", panel.harmonics, strict=False))
        ]
        shape["by place"] = f"{unit}: {' · '.join(waves)}"
    return {"name": one.name, **one.lamp.to_dict(), "shape": shape, "lights": lights}


def _check_physical(one: BakedLamp) -> None:
    """Raises InputError for a lamp whose basis lights no other renderer has."""
    if isinstance(one.lamp, SteeredPanel) and one.lamp.terms:
        what = "exponentials times polynomials are no lamps that another renderer has; bake it with periods"
        raise InputError(one.name, what)


def bake_from_images(
    scene: Scene,
    path: str | Path,
    folder: str | Path,
    *,
    settings: SteerableSettings,
    resume: bool = False,
    force: bool = False,
) -> Bake:
    """A bake of pictures that another renderer has made, one for each basis light, named as the list names them.

    Raises
    ------
    InputError
        A picture is missing, is not of the settings' size or holds values that are not finite; memory is short.
    OutputError
        ``path`` exists or cannot be written.
    """
    refuse_target(Path(path), force=force)
    check_memory(settings, len(scene.triangles))
    if settings.deep:
        raise InputError("deep", "pictures of another renderer have their first bounce in them; leave it out")
    for one in settings.lamps:
        _check_physical(one)
    spans = {one.name: _span_of(one, Path(folder), settings) for one in settings.lamps}
    return carry_out(
        Path(path),
        lambda writer: finished(scene, settings, writer, lambda one: spans[one.name], told=({}, {})),
        identity=identity(scene, settings),
        kept=lambda _: "nothing",
        resume=resume,
        force=force,
    )


def _span_of(
    one: BakedLamp, folder: Path, settings: SteerableSettings
) -> Float32[np.ndarray, "functions pixels 3"]:
    """Span images, by the pseudo-inverse of the basis lights."""
    if not folder.is_dir():
        raise InputError(folder, "no such folder; expected one with a picture for each basis light")
    images, basis = settings.images, one.basis
    pictures = np.empty((basis.lights, images.pixels, 3), np.float32)
    for k in range(basis.lights):
        file = folder / picture_name(one.name, k)
        if not file.is_file():
            names = f"{picture_name(one.name, 0)} to {picture_name(one.name, basis.lights - 1)}"
            raise InputError(file, f"is missing; expected {names}, as the lights list names them")
        picture = _read(file)
        if picture.shape[:2] != (images.height, images.width):
            found = f"{picture.shape[1]}×{picture.shape[0]}"
            raise InputError(
                file, f"is {found}, expected {images.width}×{images.height} as all others; see --size"
            )
        pictures[k] = picture.reshape(-1, 3)
    if not np.isfinite(pictures).all():
        raise InputError(folder, "a picture has values that are not finite; render it again")
    return basis.span_images(pictures).astype(np.float32)


def _read(file: Path) -> Float32[np.ndarray, "height width 3"]:
    """An OpenEXR picture in Rec.709; unlike a map of radiance it may have negative values, as odd lights have."""
    picture, matrix = decode_exr(file, read_regular(file, limit=_LARGEST_FILE))
    if matrix is not None:
        chromaticities.convert(picture, matrix)
    return picture
