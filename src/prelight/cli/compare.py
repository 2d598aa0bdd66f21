"""``prelight compare``: a relit bake held against exact integration or the path tracer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ..errors import InputError
from . import arguments, printing
from .figures_said import say_figures

_PANEL = 640, 360


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
    size: str | None = None,
    emphasis: float | None = None,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    force: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Say how far a relit bake is from the truth: Mitsuba's path tracer, or every light's own shadow ray.

    Both see the environment as the bake does, as a cube map of 6·R·R texels. Exact integration sums over all of
    them: it has no noise, and shows what clustering and one byte an element lose. The path tracer knows nothing
    of how a bake works and spreads light over whole texels, so it also shows whether R is large enough; but it
    is noisy: an error of the mean below its detectable bias cannot be told from none. It follows light through as
    many bounces as the bake holds; exact integration is of direct light, and held against that part of the bake.

    Of a bake of steerable lamps all pixels are held against the path tracer under the rig's real lights, so what a
    basis or components lose is in it.

    `prelight compare bunny.prelight stock:sunset --exact -o errors.png`

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
        How many to look at, chosen at random; 0 for all. With --output all that the camera sees.
    seed
        Of that choice and of the path tracer's samples.
    layout
        How the map is folded, if it is not recognised.
    camera
        For the picture, and where gloss is looked at from: the name of a camera in the bake, or a JSON file.
    size
        Width and height of each of the picture's three panels, 640x360 if not given; pixel layers have their own.
    emphasis
        How much the differences in the picture are amplified, above 0 to 1000; chosen by their size if not given.
    output
        A .png of the bake, the reference and their difference side by side, which takes longer: then every
        receiver that the camera sees is compared.
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
    shape = None if size is None else arguments.picture_size(size)

    from ..relighting.stored_steerable import steerable_names
    from ..storage.bake import Bake

    opened = Bake.open(bake)
    if opened.layers and len(steerable_names(opened)) == len(opened.layers):
        from .compare_lamps import compare_lamps

        if exact or layout is not None or camera is not None or size is not None:
            options = "--exact, --layout, --camera, --size"
            raise InputError(
                options, "not for steerable lamps: their pixels are held against the path tracer"
            )
        compare_lamps(
            opened, rig, samples=samples, seed=seed, emphasis=emphasis, output=output, force=force, json=json
        )
        return
    with printing.waiting("opening the bake and the light (the first time, compiling too)"):
        from ..checking.against import Comparison
        from ..drawing.figures import save_figure
        from ..lighting.rig import Rig
        from ..relighting.relighter import Relighter

        light = Relighter(bake)
        eye = arguments.camera_of(light, camera)
        light.environment = Rig.open(rig, layout=layout).surroundings
        width, height = shape or light.picture_size or _PANEL
        if output is not None and light.picture_size not in (None, (width, height)):
            own = "{}x{}".format(*light.picture_size)
            raise InputError("--size", f"{size}, but this bake has its own pixels, {own}; leave it out")
        work = Comparison(light, count=receivers, seed=seed, eye=eye)
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
    say_figures(figures)
    if output is not None:
        printing.say(str(output))
