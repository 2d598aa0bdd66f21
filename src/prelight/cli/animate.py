"""``prelight animate``: a rig that changes in time, as a sequence of pictures or a moving one."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import InputError
from . import arguments, printing
from .frames import Frames, frames_of

_MOST_FRAMES, _MOST_BYTES = 20_000, 2_000_000_000
_METERED = 8  # frames that the exposure is for


def animate(
    bake: Path,
    rig: Path,
    /,
    *,
    output: Annotated[Path, Parameter(["--output", "-o"])],
    fps: float = 24.0,
    seconds: float | None = None,
    camera: str | None = None,
    size: str | None = None,
    exposure: str = "auto",
    curve: str = "filmic",
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Light a bake with a rig whose lights have keys in time, frame after frame.

    A light of the rig is as its table says at 0 s, and then as its keys say:
    `keys = [{ at = 2, target = [0, 0, 0] }, { at = 3, scale = 0 }]`.

    `prelight animate chess.prelight rig.toml -o shot.mp4`, or `-o shot_{frame}.png` for single pictures.

    Parameters
    ----------
    bake
        NAME.prelight, with layers of any kind; lamps that move want a transfer, cloud or steerable layer.
    rig
        A rig (.toml) whose [[lamp]]s, [[spot]]s, [[panel]]s or world outside have keys (docs/rig.md).
    output
        A moving picture (.webp, .gif, or .mp4 where imageio-ffmpeg is installed), or pictures with {frame} in their
        name, such as shot_{frame}.png or shot_{frame}.exr (linear): {frame} becomes 0000, 0001, …
    fps
        Frames a second.
    seconds
        How long; until the last light rests if not given.
    camera
        The name of a camera in the bake, or a JSON file; steerable lamps have their own, and no --size.
    size
        Width and height; 1280x720 if not given.
    exposure
        Stops, one for all frames, or auto; auto+0.5 is half a stop brighter. An .exr stays linear, as radiance.
    curve
        Tone curve: filmic or linear.
    force
        Replace what is there.
    json
        Print one JSON object on standard output.
    """
    from ..files import refuse_existing
    from ..images.film import FILMS, check_film, write_film

    kind = output.suffix.lower()
    sequence = "{frame}" in output.name
    if kind not in ((".png", ".exr") if sequence else FILMS):
        raise InputError(
            output, "expected a name ending in .mp4, .webp or .gif, or with {frame} and .png or .exr"
        )
    if not sequence:
        check_film(output)
    if not 0.1 <= fps <= 240:
        raise InputError("--fps", f"{fps:g}, expected 0.1 to 240")
    if seconds is not None and not 0 < seconds <= 86_400:
        raise InputError("--seconds", f"{seconds:g}, expected more than 0, at most a day")
    metered, stops = arguments.exposure(exposure)
    with printing.waiting("opening the bake and the lights (the first time, compiling too)"):
        from ..lighting.rig import Rig

        opened = Rig.open(str(rig))
        light = frames_of(bake, opened, rig, camera=camera, size=size)
    length = opened.duration if seconds is None else seconds
    if not length > 0:
        raise InputError(rig, "none of its lights has keys; give some, or --seconds for a still sequence")
    times = _times(length, fps, light, held=not sequence and kind != ".mp4")
    names = [output.with_name(output.name.replace("{frame}", f"{n:04}")) for n in range(len(times))]
    for name in names if sequence else [output]:
        refuse_existing(name, force=force)
    if metered:
        stops += _metered(light, times)
    started = time.perf_counter()
    pictures = (light.picture(moment) for moment in times)
    if sequence:
        for name, picture in zip(names, pictures, strict=True):
            picture.save(name, force=force, exposure=stops, curve=curve)
    else:
        shown = (picture.display(exposure=stops, curve=curve) for picture in pictures)
        write_film(output, shown, fps=fps, force=force)
    taken = time.perf_counter() - started
    if json:
        printing.say_json(
            {"frames": len(times), "seconds": taken, "exposure_stops": stops, "output": str(output)}
        )
        return
    printing.say(f"{len(times)} frames in {printing.duration(taken)}, exposure {stops:+.2f} stops\n{output}")


def _times(length: float, fps: float, light: Frames, *, held: bool) -> list[float]:
    frames = max(round(length * fps), 1) + 1
    if frames > _MOST_FRAMES:
        raise InputError(
            "--seconds", f"{length:g} s are {frames:,} frames, at most {_MOST_FRAMES:,} are made"
        )
    size = frames * 3 * light.size[0] * light.size[1]
    if held and size > _MOST_BYTES:
        raise InputError(
            "--seconds",
            f"{frames:,} frames are {printing.size(size)} at once; write an .mp4, or {{frame}}.png",
        )
    return [n / fps for n in range(frames)]


def _metered(light: Frames, times: list[float]) -> float:
    """The exposure that suits the mean of a few frames."""
    import numpy as np

    from ..drawing.picture import Picture

    some = [times[round(n)] for n in np.linspace(0, len(times) - 1, min(_METERED, len(times)))]
    mean = np.mean([picture.linear for picture in map(light.picture, some)], axis=0)
    return Picture(mean.astype(np.float32)).stops("auto")
