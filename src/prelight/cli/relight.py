"""``prelight relight``: a bake under a light, as a picture or as radiance."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import InputError
from . import arguments, printing


def relight(
    bake: Path,
    rig: str,
    /,
    *,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    layout: str | None = None,
    rotate: float = 0.0,
    scale: float = 1.0,
    tint: str = "1,1,1",
    camera: str | None = None,
    size: str | None = None,
    strong_lights: str = "rays",
    background: str = "environment",
    exposure: str = "auto",
    curve: str = "filmic",
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Light a bake and write a picture, or the radiance of its receivers.

    Parameters
    ----------
    bake
        NAME.prelight, made by `prelight bake`.
    rig
        An environment map (.hdr or .exr), six pictures of faces (a folder, or a name with {face} in it),
        stock:NAME (stock:sunset, stock:studio, …), or a rig file (.toml) with a table [environment] of map,
        layout, rotate_deg, scale, tint and blend, [[disc]] lights and [[paint]]ed regions (docs/rig.md). For a bake
        of steerable lamps a rig file with [[spot]]s and [[panel]]s.
    output
        .png (as displayed), .exr (linear picture) or .npy (linear radiance of the receivers, (R, 3) float32,
        in receiver order). Without it only the figures are printed.
    layout
        How the map is folded: latlong, angular, cross, horizontal-cross, strip or tall-strip; recognised by
        its proportions if not given.
    rotate
        Turn the environment with its discs about +Y, degrees counter-clockwise seen from above; adds to a
        rig's own turn.
    scale
        Factor of the radiance of all light.
    tint
        Factors of its red, green and blue, such as 1,0.9,0.8.
    camera
        The name of a camera in the bake, or a JSON file with eye, target, up and vertical_fov_deg. Steerable lamps
        are baked for one eye and size: neither this nor --size is for them.
    size
        Width and height of the picture; 1280x720 if not given. Pixel layers have their own and no other.
    strong_lights
        How the few lights that carry much of the energy (a sun) are lit: rays traces their shadows exactly, which
        takes a moment where they moved; clusters leaves them to the bake, as fast and as true as the rest.
    background
        environment (the map behind the scene), none (black), or a linear colour such as 0.1,0.1,0.12.
    exposure
        Stops for .png, or auto; auto+0.5 is half a stop brighter. An .exr stays linear, as radiance.
    curve
        Tone curve of .png: filmic or linear.
    force
        Replace the output.
    json
        Print one JSON object on standard output.
    """
    from ..files import refuse_existing

    if output is not None:
        if output.suffix.lower() not in (".png", ".exr", ".npy"):
            raise InputError(output, "expected a name ending in .png, .exr or .npy")
        refuse_existing(output, force=force)
    width, height = (None, None) if size is None else arguments.picture_size(size)
    if strong_lights not in ("rays", "clusters"):
        raise InputError("--strong-lights", f"{strong_lights!r}, expected rays or clusters")
    metered, stops = arguments.exposure(exposure)
    behind = _background(background)

    from ..relighting.stored_steerable import steerable_names
    from ..storage.bake import Bake

    opened = Bake.open(bake)
    if opened.layers and len(steerable_names(opened)) == len(opened.layers):
        from .relight_steerable import relight_steerable

        if camera is not None or size is not None:
            raise InputError(
                "--camera, --size", "steerable lamps are baked for one eye and size; leave them out"
            )
        if layout is not None or rotate or strong_lights != "rays" or background != "environment":
            options = "--layout, --rotate, --strong-lights, --background"
            raise InputError(options, "of environments; this bake has steerable lamps alone, leave them out")
        relight_steerable(
            opened, rig, output=output, brightness=(scale, tint), exposure=(metered, stops), curve=curve,
            force=force, json=json,
        )  # fmt: skip
        return
    if [layer.kind for layer in opened.layers.values()] != ["environment"]:
        from ..lighting.rig import Rig
        from .relight_layers import Shown, relight_layers

        shown = Shown(camera, (width, height), behind, metered, stops, curve, (scale, tint))
        light = Rig.open(rig, layout=layout)
        light = replace(light, environment=light.environment.rotated(rotate))
        relight_layers(
            opened, light, shown, output=output, trace_strong=strong_lights == "rays", force=force, json=json
        )
        return
    with printing.waiting("opening the bake and the light (the first time, compiling too)"):
        from ..lighting.rig import Rig
        from ..relighting.relighter import Relighter

        light = Relighter(opened, trace_strong=strong_lights == "rays")
        eye = arguments.camera_of(light, camera)
        environment = Rig.open(rig, layout=layout).surroundings
        environment = environment.rotated(rotate).scaled(scale).tinted(arguments.colour("--tint", tint))
        started = time.perf_counter()
        light.environment = environment
        resampled = (time.perf_counter() - started) * 1e3 - light.last.milliseconds
        light.refresh()
        started = time.perf_counter()
        radiance = light.radiance
        traced = (time.perf_counter() - started) * 1e3 if len(light.strong_lights) else 0.0
    figures = {
        "milliseconds": light.last.milliseconds,
        "bytes_read": light.last.bytes_read,
        "resample_milliseconds": resampled,
        "clusters": light.last.clusters,
        "strong_lights": len(light.strong_lights),
        "strong_milliseconds": traced,
        "receivers": len(radiance),
        "output": None if output is None else str(output),
    }
    if output is not None and output.suffix.lower() == ".npy":
        from ..images.formats import write_npy

        write_npy(output, radiance)
    elif output is not None:
        picture = light.picture(eye, width=width, height=height, background=behind)
        stops += picture.stops("auto") if metered else 0.0
        figures["exposure_stops"] = stops
        picture.save(output, force=force, exposure=stops, curve=curve)
    if json:
        printing.say_json(figures)
        return
    _say(figures)


def _say(figures: dict[str, Any]) -> None:
    """The figures in words."""
    lights = figures["strong_lights"]
    words = [
        f"relit {figures['receivers']:,} receivers in {figures['milliseconds']:.1f} ms "
        f"({printing.size(figures['bytes_read'])} read; the map was resampled in "
        f"{figures['resample_milliseconds']:.0f} ms)"
    ]
    if lights:
        which = "1 strong light" if lights == 1 else f"{lights} strong lights"
        words.append(f"{which} traced by rays in {figures['strong_milliseconds']:.0f} ms")
    if figures["output"] is not None:
        stops = figures.get("exposure_stops")
        shown = f", exposure {stops:+.2f} stops" if figures["output"].lower().endswith(".png") else ""
        words.append(figures["output"] + shown)
    printing.say("\n".join(words))


def _background(text: str) -> str | tuple[float, float, float] | None:
    if text == "environment":
        return text
    if text == "none":
        return None
    if text[:1].isalpha():
        raise InputError(
            "--background", f"{text!r}, expected environment, none or a linear colour such as 0.1,0.1,0.12"
        )
    return arguments.colour("--background", text)
