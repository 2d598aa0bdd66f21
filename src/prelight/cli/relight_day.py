"""A day over a bake: sun and sky from hour to hour, for ``prelight relight --day``."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from . import arguments, printing
from .relight_layers import Shown

if TYPE_CHECKING:
    from collections.abc import Iterator
    from datetime import datetime

    from ..drawing.picture import Picture
    from ..lighting.daylight import Daylight
    from ..lighting.rig import Rig
    from ..relighting.lit_bake import LitBake
    from ..storage.bake import Bake

_MOST_STEPS = 2_000
_METERED = 7  # moments that the exposure is for
_ADAPTATION, _MOST_ADAPTED = 0.5, 10.0  # share of the way, and stops at most


@dataclass(frozen=True)
class DayOptions:
    """The options of ``prelight relight`` that are about a day, as given."""

    day: str | None
    place: str | None
    zone: str | None
    hours: str | None
    steps: int
    fps: float
    rotate: float = 0.0

    @property
    def are_given(self) -> bool:
        """Whether a day is asked for. Raises InputError for options that do not go together."""
        if self.day is None and not (self.place is None and self.zone is None and self.hours is None):
            what = "of --day, which is not given; the [sun] of a rig is one moment"
            raise InputError("--place, --zone, --hours", what)
        if self.day is not None and self.rotate:
            raise InputError("--rotate", "not with --day: north_deg of the rig's [sun] turns its sky")
        return self.day is not None


def relight_day(
    bake: Bake, rig: Rig, options: DayOptions, shown: Shown, *, output: Path | None, force: bool, json: bool
) -> None:
    """Light a bake by every hour of a day, and write a film or numbered pictures. Raises InputError."""
    from ..files import refuse_existing
    from ..images.film import FILMS, check_film, write_film

    if output is None:
        raise InputError("--day", "needs --output: day.webp, day.mp4, or day_{frame}.png for single pictures")
    sequence = "{frame}" in output.name
    if output.suffix.lower() not in ((".png", ".exr") if sequence else FILMS):
        expected = "expected a name ending in .mp4, .webp or .gif, or with {frame} and .png or .exr"
        raise InputError(output, expected)
    if not sequence:
        check_film(output)
    if not 0.1 <= options.fps <= 240:
        raise InputError("--fps", f"{options.fps:g}, expected 0.1 to 240")
    days = days_of(rig, options)
    names = [output.with_name(output.name.replace("{frame}", f"{n:04}")) for n in range(len(days))]
    for name in names if sequence else [output]:
        refuse_existing(name, force=force)
    with printing.waiting("opening the bake (the first time, compiling too)"):
        from ..relighting.lit_bake import LitBake

        light = LitBake(bake)
        eye = arguments.camera_of(light, shown.camera)
    started = time.perf_counter()
    stops = shown.stops
    if shown.metered:
        stops += _metered(light, rig, days, shown, eye)
    pictures = _pictures(light, rig, days, shown, eye)
    exposed = ((picture, _adapted(picture, stops) if shown.metered else stops) for picture in pictures)
    if sequence:
        for name, (picture, own) in zip(names, exposed, strict=True):
            picture.save(name, force=force, exposure=own, curve=shown.curve)
    else:
        frames = (picture.display(exposure=own, curve=shown.curve) for picture, own in exposed)
        write_film(output, frames, fps=options.fps, force=force)
    _say(days, stops, time.perf_counter() - started, output, json=json)


def days_of(rig: Rig, options: DayOptions) -> list[Daylight]:
    """The moments of a day; the rig's [sun] says what is not among the options. Raises InputError."""
    from ..lighting.daylight import Daylight
    from ..lighting.moment import Site, date_of, hours_of_day, zone_named

    known = rig.daylight
    if options.place is None and known is None:
        raise InputError("--place", "missing; expected latitude and longitude such as 43.7,15.9")
    if not 1 <= options.steps <= _MOST_STEPS:
        raise InputError("--steps", f"{options.steps}, expected 1 to {_MOST_STEPS}")
    place = known.place if options.place is None and known else Site.read("--place", options.place or "")
    day = date_of("--day", options.day or "")
    if options.zone is not None:
        zone_named(options.zone)
    moments = hours_of_day(day, place, steps=options.steps, zone=options.zone, between=_hours(options.hours))
    start = Daylight(place, moments[0]) if known is None else replace(known, place=place)
    return [start.at(moment) for moment in moments]


def _hours(text: str | None) -> tuple[float, float] | None:
    """``5-21``: two hours of the clock."""
    if text is None:
        return None
    parts = text.split("-")
    try:
        first, last = (float(part) for part in parts)
    except ValueError:
        first, last = 1.0, 0.0
    if not 0 <= first < last <= 24:
        raise InputError("--hours", f"{text[:40]!r}, expected two hours such as 5-21, from 0 to 24")
    return first, last


def _metered(light: LitBake, rig: Rig, days: list[Daylight], shown: Shown, eye) -> float:
    """The exposure that suits the mean of a few moments."""
    import numpy as np

    from ..drawing.picture import Picture

    some = [days[round(n)] for n in np.linspace(0, len(days) - 1, min(_METERED, len(days)))]
    mean = np.mean([picture.linear for picture in _pictures(light, rig, some, shown, eye)], axis=0)
    return Picture(mean.astype(np.float32)).stops("auto")


def _adapted(picture: Picture, stops: float) -> float:
    """An eye adapts: half of the way, in stops, from the day's exposure to the picture's own."""
    return stops + _ADAPTATION * min(max(picture.stops("auto") - stops, -_MOST_ADAPTED), _MOST_ADAPTED)


def _pictures(light: LitBake, rig: Rig, days: list[Daylight], shown: Shown, eye) -> Iterator[Picture]:
    factors = shown.factors
    for day in days:
        light.light(rig.under(day))
        picture = light.picture(eye, width=shown.size[0], height=shown.size[1], background=shown.background)
        behind = None if picture.background is None else picture.background * factors
        yield replace(picture, linear=picture.linear * factors, background=behind)


def _say(days: list[Daylight], stops: float, taken: float, output: Path, *, json: bool) -> None:
    if json:
        moments = [
            {
                "time": day.when.isoformat(timespec="seconds"),
                "sun_azimuth_deg": day.position.azimuth_deg,
                "sun_elevation_deg": day.position.elevation_deg,
                "sun_lux": day.illuminance[0],
                "sky_lux": day.illuminance[1],
            }
            for day in days
        ]
        figures = {"frames": len(days), "seconds": taken, "exposure_stops": stops, "output": str(output)}
        printing.say_json(figures | {"moments": moments})
        return
    first, last, high = days[0], days[-1], max(days, key=lambda day: day.position.elevation_deg)
    printing.say(
        f"{len(days)} moments from {_clock(first.when)} to {_clock(last.when)} ({first.when.tzname()}), "
        f"the sun at most {high.position.elevation_deg:.1f}° high; {printing.duration(taken)}, "
        f"exposure {stops:+.2f} stops\n{output}"
    )


def _clock(when: datetime) -> str:
    return f"{when:%H:%M}"
