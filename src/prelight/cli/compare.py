"""``prelight compare``: a relit bake held against exact integration or the path tracer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import InputError
from . import arguments, printing

_WORDS = (
    ("relative_rms", "relative RMS error"),
    ("mean_difference", "mean |difference| / mean"),
    ("signed_mean", "mean difference / mean"),
    ("worst", "largest difference / mean"),
)


def compare(
    bake: Path,
    rig: str,
    /,
    *,
    exact: Annotated[bool, Parameter(negative="")] = False,
    samples: Annotated[int, Parameter(converter=arguments.whole_number)] = 1024,
    receivers: Annotated[int, Parameter(converter=arguments.whole_number)] = 1000,
    seed: Annotated[int, Parameter(converter=arguments.whole_number)] = 0,
    layout: str | None = None,
    camera: str | None = None,
    size: str = "640x360",
    emphasis: float | None = None,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Say how far a relit bake is from the truth: Mitsuba's path tracer, or every light's own shadow ray.

    Both see exactly the environment that the bake sees, its cube map. The path tracer is noisy: what it cannot
    tell apart is said too. Exact integration is the sum over all 6·R·R lights, without noise, and slower.

    Parameters
    ----------
    bake
        NAME.prelight, made by `prelight bake`.
    rig
        An environment map, stock:NAME, or a rig file, as for `prelight relight`.
    exact
        Integrate over all lights in place of the path tracer.
    samples
        Of the path tracer, for each receiver; 16 to 65536.
    receivers
        How many to look at, chosen at random; 0 for all.
    seed
        Of that choice and of the path tracer's samples.
    layout
        How the map is folded, if it is not recognised.
    camera
        For the picture: the name of a camera in the bake, or a JSON file.
    size
        Width and height of each of the picture's three panels; pixel layers have their own.
    emphasis
        How much the differences in the picture are amplified, above 0 to 1000; chosen by their size if not given.
    output
        A .png of the bake, the reference and their difference side by side. Then all receivers are compared
        that the camera sees, which takes longer.
    force
        Replace the output.
    json
        Print one JSON object on standard output.
    """
    from ..files import refuse_existing

    if output is not None:
        if output.suffix.lower() != ".png":
            raise InputError(output, "expected a name ending in .png")
        refuse_existing(output, force=force)
    if not 16 <= samples <= 65536:
        raise InputError("--samples", f"{samples}, expected 16 to 65536")
    if receivers < 0:
        raise InputError("--receivers", f"{receivers}, expected 0 (all) or more")
    if emphasis is not None and not 0 < emphasis <= 1000:
        raise InputError("--emphasis", f"{emphasis:g}, expected above 0 and at most 1000")
    width, height = arguments.picture_size(size)

    with printing.waiting("opening the bake and the light (the first time, compiling too)"):
        from ..checking.against import Comparison
        from ..drawing.figures import save_figure
        from ..lighting.rig import Rig
        from ..relighting.relighter import Relighter

        light = Relighter(bake)
        eye = arguments.camera_of(light, camera)
        light.environment = Rig.open(rig, layout=layout).environment
        work = Comparison(light, count=receivers, seed=seed)
        if output is not None:
            work.choose_seen(eye, width=width, height=height)
    with printing.share_bar("integrating" if exact else "tracing paths") as report:
        figures = work.run(samples=None if exact else samples, seed=seed, report=report)
    if output is not None:
        figure = work.picture(eye, width=width, height=height, emphasis=emphasis)
        save_figure(figure, output, force=force)
    if json:
        printing.say_json(figures | {"output": None if output is None else str(output)})
        return
    against = "exact integration" if exact else f"the path tracer, {samples:,} samples"
    printing.say(
        f"{figures['receivers']:,} receivers against {against} ({figures['reference_seconds']:.1f} s)"
    )
    for name, words in _WORDS:
        printing.say(f"  {words:28} {100 * figures[name]:8.3f} %")
    if not exact:
        printing.say(f"  {'detectable bias':28} {100 * figures['detectable_bias']:8.3f} %")
    if output is not None:
        printing.say(str(output))
