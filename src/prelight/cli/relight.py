"""``prelight relight``: a bake under a light, as a picture or as radiance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import InputError
from . import arguments


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
    narrow: Annotated[int, Parameter(converter=arguments.whole_number)] = 0,
    day: str | None = None,
    place: str | None = None,
    zone: str | None = None,
    hours: str | None = None,
    steps: Annotated[int, Parameter(converter=arguments.whole_number)] = 48,
    fps: float = 12.0,
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
        in receiver order; toward --camera where a bake has gloss; where it has layers of pixels, of these, row by
        row from the top, before black). Without it only the figures are printed.
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
    narrow
        Of bakes of steerable lamps: what of a light is too narrow for its layer is traced live, with its first bounce,
        in so many samples a pixel, 1 to 256. Takes Mitsuba, and a moment.
    day
        A date such as 2026-06-21: the sun and the clear sky of that day from hour to hour, in place of the rig's map.
        The output is then a film (.mp4, .webp, .gif) or numbered pictures (day_{frame}.png).
    place
        Where on earth, for --day: latitude and longitude such as 43.7,15.9, north and east positive. The [sun] of the
        rig says this, if not given; turbidity, ground and north come from there too.
    zone
        Time zone of --hours and of what is printed, such as Europe/Zagreb; the place's mean solar time if not given.
    hours
        From when to when, such as 5-21; from the first twilight to the last if not given.
    steps
        How many moments of the day.
    fps
        Of a film, moments a second. With --exposure auto a day's pictures are each exposed half of the way from the
        day's mean to their own, as an eye adapts; a number of stops is for all.
    exposure
        Stops for .png, or auto; auto+0.5 is half a stop brighter. An .exr stays linear, as radiance.
    curve
        Tone curve of .png: filmic or linear.
    force
        Replace the output.
    json
        Print one JSON object on standard output.
    """
    if output is not None and day is None:
        _check_output(output, force=force)
    width, height = (None, None) if size is None else arguments.picture_size(size)
    if strong_lights not in ("rays", "clusters"):
        raise InputError("--strong-lights", f"{strong_lights!r}, expected rays or clusters")
    metered, stops = arguments.exposure(exposure)
    behind = _background(background)

    from ..lighting.rig import Rig
    from ..relighting.stored_steerable import steerable_names
    from ..storage.bake import Bake
    from .relight_day import DayOptions, relight_day
    from .relight_layers import Shown, relight_layers

    days = DayOptions(day, place, zone, hours, steps, fps, rotate)
    shown = Shown(camera, (width, height), behind, metered, stops, curve, (scale, tint))
    opened = Bake.open(bake)
    if days.are_given:
        relight_day(opened, Rig.open(rig, layout=layout), days, shown, output=output, force=force, json=json)
        return
    if opened.layers and len(steerable_names(opened)) == len(opened.layers):
        from .relight_steerable import relight_steerable

        _refuse_of_views(camera is not None or size is not None)
        _refuse_of_skies(
            layout is not None or rotate != 0 or strong_lights != "rays" or behind != "environment"
        )
        relight_steerable(
            opened, rig, output=output, brightness=(scale, tint), exposure=(metered, stops), curve=curve,
            narrow=narrow, force=force, json=json,
        )  # fmt: skip
        return
    if narrow:
        raise InputError("--narrow", "of steerable lamps; this bake has other layers, leave it out")
    light = Rig.open(rig, layout=layout)
    light = replace(light, environment=light.environment.rotated(rotate))
    relight_layers(
        opened, light, shown, output=output, trace_strong=strong_lights == "rays", force=force, json=json
    )


def _check_output(output: Path, *, force: bool) -> None:
    from ..files import refuse_existing

    if output.suffix.lower() not in (".png", ".exr", ".npy"):
        raise InputError(output, "expected a name ending in .png, .exr or .npy")
    refuse_existing(output, force=force)


def _refuse_of_views(given: bool) -> None:
    if given:
        raise InputError("--camera, --size", "steerable lamps are baked for one eye and size; leave them out")


def _refuse_of_skies(given: bool) -> None:
    if given:
        what = "of environments; this bake has steerable lamps alone, leave them out"
        raise InputError("--layout, --rotate, --strong-lights, --background", what)


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
