"""Relighting bakes with layers of several kinds under one rig, for ``prelight relight``."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import arguments, printing

if TYPE_CHECKING:
    from ..lighting.rig import Rig
    from ..relighting.live_layer import LiveLayer
    from ..relighting.pixel_environment import PixelEnvironment
    from ..storage.bake import Bake

Background = str | tuple[float, float, float] | None


@dataclass(frozen=True)
class Shown:
    """What of the options of ``prelight relight`` is about the picture, read."""

    camera: str | None
    size: tuple[int | None, int | None]
    background: Background
    metered: bool
    stops: float
    curve: str
    brightness: tuple[float, str]  # a factor and a tint of all light

    @property
    def factors(self) -> np.ndarray:
        """What the red, green and blue of all light are multiplied by, (3,). Raises InputError."""
        from ..lighting import quantities

        factor = quantities.amount("--scale", self.brightness[0], least=0.0, most=1e20)
        tint = quantities.strength("--tint", arguments.colour("--tint", self.brightness[1]))
        return np.array([factor * own for own in tint], np.float32)


def relight_layers(
    bake: Bake,
    rig: Rig,
    shown: Shown,
    *,
    output: Path | None,
    trace_strong: bool,
    force: bool,
    json: bool,
) -> None:
    """Light every layer with its share of the rig and add them up; the options are those of ``prelight relight``."""
    factors = shown.factors
    with printing.waiting("opening the bake and the light (the first time, compiling too)"):
        from ..relighting.lit_bake import LitBake

        light = LitBake(bake, trace_strong=trace_strong)
        eye = arguments.camera_of(light, shown.camera)
        started = time.perf_counter()
        light.light(rig)
        radiance = None if light.has_pixels else light.radiance(eye.eye)
        whole = (time.perf_counter() - started) * 1e3
    receivers = light.size[0] * light.size[1] if radiance is None else len(radiance)
    figures: dict[str, Any] = {
        "milliseconds": light.milliseconds,
        "all_milliseconds": whole,
        "bytes_read": light.bytes_read,
        "layers": [_figures(layer) for layer in light.all_layers],
        "strong_lights": light.strong_lights,
        "glossy_milliseconds": light.glossy_milliseconds,
        "receivers": receivers,
        "notes": light.notes,
        "output": None if output is None else str(output),
    }
    if output is not None and output.suffix.lower() == ".npy":
        from ..images.formats import write_npy

        if radiance is None:
            radiance = light.picture(eye, background=None, fine=True).linear.reshape(-1, 3)
        write_npy(output, radiance * factors)
    elif output is not None:
        picture = light.picture(
            eye, width=shown.size[0], height=shown.size[1], background=shown.background, fine=True
        )
        behind = None if picture.background is None else picture.background * factors
        picture = replace(picture, linear=picture.linear * factors, background=behind)
        stops = shown.stops + (picture.stops("auto") if shown.metered else 0.0)
        figures["exposure_stops"] = stops
        picture.save(output, force=force, exposure=stops, curve=shown.curve)
    if json:
        printing.say_json(figures)
        return
    for note in light.notes:
        printing.say(f"note: {note}")
    took = light.glossy_milliseconds
    names = ", ".join(layer.name for layer in light.all_layers)
    printing.say(
        f"relit {receivers:,} receivers by {names} in {light.milliseconds:.1f} ms "
        f"({printing.size(light.bytes_read)} read; {whole:.0f} ms with all that is done once)"
        + (f"\nwhat glossy surfaces send into all directions took {took:.0f} ms" if took else "")
        + ("" if output is None else f"\n{output}")
    )


def _figures(layer: LiveLayer | PixelEnvironment) -> dict[str, Any]:
    last = layer.last
    return {"name": layer.name, "milliseconds": last.milliseconds, "bytes_read": last.bytes_read}
