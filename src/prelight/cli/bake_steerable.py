"""``prelight bake steerable``: lamps that are aimed, moved and reshaped after tracing."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ..errors import InputError
from . import arguments, printing
from .bake_running import AS_IT_IS, AT_ONCE, Reading, Running
from .baked_lamps import lamps_of
from .meant_lights import said_of_lights

if TYPE_CHECKING:
    from ..baking.steerable_plan import SteerablePlan
    from ..baking.steerable_settings import SteerableSettings
    from ..encoding.principal_components import Keep
    from ..storage.bake import Bake

_NUMBER = Parameter(converter=arguments.whole_number)


def steerable(
    scene: str,
    /,
    *,
    output: Annotated[Path | None, Parameter(["--output", "-o"])] = None,
    spot: Annotated[list[str] | None, Parameter(negative="")] = None,
    panel: Annotated[list[str] | None, Parameter(negative="")] = None,
    box: Annotated[list[str] | None, Parameter(negative="")] = None,
    sky: str | None = None,
    degree: Annotated[int, _NUMBER] = 5,
    periods: Annotated[int, _NUMBER] = 4,
    box_periods: Annotated[int, _NUMBER] = 2,
    panel_degree: Annotated[int | None, _NUMBER] = None,
    panel_terms: str | None = None,
    parity: str = "all",
    lamp_radius: float = 0.02,
    camera: str | None = None,
    size: str = "256x256",
    samples: Annotated[int, _NUMBER] = 256,
    light_paths: Annotated[int, _NUMBER] = 16,
    depth: Annotated[int, _NUMBER] = 12,
    indirect_only: Annotated[bool, Parameter(negative="")] = False,
    left_to_chance: str = "drop",
    deep: Annotated[int, _NUMBER] = 0,
    components: Annotated[int | None, _NUMBER] = None,
    share: float | None = None,
    error: float | None = None,
    all_components: Annotated[bool, Parameter(negative="")] = False,
    seed: Annotated[int, _NUMBER] = 0,
    lights_list: Path | None = None,
    from_images: Path | None = None,
    meant_for: Path | None = None,
    reading: Reading = AS_IT_IS,
    running: Running = AT_ONCE,
) -> None:
    """Bake lamps that one eye sees with every bounce, to be aimed, slid and reshaped in milliseconds.

    A lamp stays where it is baked: a spot at a place, or a panel, a rectangle that soft lights slide over. Where it
    points, how wide and bright it is and its colour are free afterwards, in a rig (docs/rig.md):

    `prelight bake steerable stock:steerable -o chess.prelight --degree 9`, then
    `prelight relight chess.prelight RIG.toml -o picture.png`, RIG.toml being
    `spot = [{ intensity = [6, 5, 4], target = [0.5, 0.1, 0.5], width_deg = 40 }]`.

    All basis images of a lamp come out of one pass of tracing; their principal components are kept. Shows what it
    will cost before it begins. Ctrl-C keeps what is done; the same command with --resume goes on.

    Parameters
    ----------
    scene
        A mesh or scene file, or stock:NAME, one of the built-in scenes (stock:steerable).
    output
        The bake, a new folder; SCENE.prelight in the current folder if not given.
    spot
        Where a spot is: X,Y,Z or NAME=X,Y,Z, metres; again for more. A rig calls it by that name (layer = "NAME");
        spot if not named. stock:steerable has one if neither this nor --panel is given.
    panel
        Where a panel is: corner, first and second side, as X,Y,Z/X,Y,Z/X,Y,Z or NAME=…; again for more. It shines to
        the side from which its first side turns counter-clockwise into its second.
    box
        Where a box of light is, a glow that soft lights move through: corner and three sides, as
        X,Y,Z/X,Y,Z/X,Y,Z/X,Y,Z or NAME=…; again for more.
    sky
        The name of a sky, light from all around; in a rig spots light it, whose direction is that from which light
        comes.
    degree
        N of the spots and the sky, 0 to 24: (N+1)² basis images. More makes narrower spots: 83° from half to half at
        5, 62° at 9.
    periods
        Whole periods along each side of the panels, 0 to 16: (2·periods+1)² basis images.
    box_periods
        Whole periods along each side of the boxes: (2·box_periods+1)³ basis images.
    panel_degree
        Turn the panels' light too, up to this degree; times (n+1)² basis images. Without it, it leaves alike in all
        directions.
    panel_terms
        Exponentials times polynomials in place of sinusoids: RATE:POWER,…, such as 0:6 (polynomials up to x⁶) or
        0:3,-4+3i:1 (and e^(−4x)·cos 3x, …). No light comes back at the opposite edge.
    parity
        all, or even or odd (as the degree is): for spots with f(−ω) = ±f(ω), half the images.
    lamp_radius
        Of the spots, metres. A larger one softens shadows, and lets less be left to chance; 0 is a point.
    camera
        The one eye: the name of a camera in the scene, or a JSON file with eye, target, up and vertical_fov_deg.
    size
        Width and height of the picture, up to 2048 each.
    samples
        Paths through each pixel: 64 for a look, 1024 for a clean picture. A square number of them is spread evenly, and
        half as noisy.
    light_paths
        Paths from the lamp for each pixel, where it meets glass or mirrors, for light that falls through them; a
        sixteenth of --samples makes that as clean as the rest.
    depth
        The most edges of a path; 2 is direct light.
    indirect_only
        Leave direct light out, to be added exactly by another way.
    left_to_chance
        drop, or keep: light through glass or off a mirror that is itself seen through glass or in a mirror. Dropped
        from chance it is joined from both ends instead, smoothed over about a pixel; met by chance it is exact, and
        makes bright specks.
    deep
        Keep the lamps' first bounce apart, in so many samples a pixel, 1 to 256: then lights of any narrowness are
        exact, while the basis holds the later bounces; 16 is plenty for spots, narrow lights on a panel want 64 and
        more. Boxes have none.
    components
        Keep so many principal components of each lamp. Or use one of the three rules that follow.
    share
        Keep those that make up this share of the sum of singular values; the paper's is 0.9.
    error
        Keep as many as bring the basis pictures within this RMS error; 0.01 if no rule is given.
    all_components
        Keep as many as there are basis images.
    seed
        Of all randomness.
    lights_list
        Write the basis lights and the eye to this JSON file, for another renderer; nothing is traced.
    from_images
        Take the basis images from this folder instead of tracing: LAMP_00000.exr, …, as the lights list names them.
    meant_for
        A rig (.toml) that the bake is to be lit by: how well the lamps will hold its lights, such as those of an IES
        file or of a picture, is told before anything is traced.
    """
    _refuse_together(
        ("--lights-list", lights_list is not None),
        ("--from-images", from_images is not None),
        ("--dry-run", running.dry_run),
    )
    if left_to_chance not in ("keep", "drop"):
        raise InputError("--left-to-chance", f"{left_to_chance!r}, expected keep or drop")
    target = running.target(scene, output, writes=lights_list is None)
    budget = running.budget
    with printing.waiting("reading the scene"):
        from ..baking.steerable_settings import SteerableSettings
        from ..transport.basis_images import ImageSettings

        width, height = arguments.picture_size(size)
        asked = {"spot": spot or [], "panel": panel or [], "box": box or [], "sky": [sky] if sky else []}
        lamps = lamps_of(
            scene, asked, degree=degree, periods=(periods, box_periods), panel_degree=panel_degree,
            terms=panel_terms, parity=parity, radius=lamp_radius,
        )  # fmt: skip
        images = ImageSettings(
            width, height, samples, light_paths, depth, indirect_only, left_to_chance == "keep", seed
        )
        keep = _keep(components, share, error, every=all_components)
        kept = {} if keep is None else {"keep": keep}
        settings = SteerableSettings(
            tuple(lamps), arguments.eye(camera), images, deep=deep, memory=budget, **kept
        )
        meant = [] if meant_for is None else said_of_lights(meant_for, settings.lamps)
        loaded = reading.load(scene)
    for line in [] if running.json else meant:
        printing.say(line)
    if lights_list is not None:
        _write_list(loaded, settings, lights_list, force=running.force, json=running.json)
        return
    if from_images is not None:
        from ..baking.steerable_foreign import bake_from_images

        with printing.waiting("reading basis images"):
            bake = bake_from_images(
                loaded, target, from_images, settings=settings, resume=running.resume, force=running.force
            )
        if running.json:
            printing.say_json(bake.summary())
        else:
            _say_done(bake, target)
        return
    from ..baking.steerable import bake_planned
    from ..baking.steerable_plan import plan_steerable

    with printing.waiting("estimating the cost (compiling too)"):
        plan = plan_steerable(loaded, settings)
    if not running.json:
        _say_plan(loaded, plan)
    found = running.bake(target, plan, partial(bake_planned, loaded), more={"meant_for": meant})
    if found is not None:
        _say_done(found, target)


def _refuse_together(*options: tuple[str, bool]) -> None:
    """Raises InputError where more than one of these is given."""
    given = [name for name, there in options if there]
    if len(given) > 1:
        raise InputError(given[1], f"given beside {given[0]}; choose one of them")


def _keep(
    components: int | None, share: float | None, error: float | None, *, every: bool
) -> Keep | str | None:
    from ..encoding.principal_components import Keep

    rules = (("--components", components), ("--share", share), ("--error", error))
    _refuse_together(*((name, x is not None) for name, x in rules), ("--all-components", every))
    if every:
        return "all"
    if all(x is None for _, x in rules):
        return None
    return Keep(count=components, error=error) if share is None else Keep(share=share)


def _say_plan(loaded: Any, plan: SteerablePlan) -> None:
    for note in (*loaded.notes, *plan.notes):
        printing.say(f"note: {note}")
    images = plan.settings.images
    for lamp in plan.settings.lamps:
        basis = lamp.basis
        printing.say(
            f"{lamp.name}: {basis.lights:,} basis lights, {basis.functions:,} functions; "
            f"a steered light's weights are at most {basis.largest_norm:.2f} long"
        )
    printing.say(
        f"{loaded.name}: {images.width}×{images.height} pixels, {plan.triangles:,} triangles\n"
        f"about {printing.count(plan.paths)} paths, {printing.duration(plan.seconds)}, "
        f"{printing.size(plan.bytes)} on disk ({printing.size(plan.scratch)} more while baking), "
        f"at most {printing.size(plan.memory)} of memory"
    )


def _say_done(bake: Bake, target: Path) -> None:
    summary = bake.summary()
    for layer in summary["layers"]:
        printing.say(
            f"{layer['name']}: {layer['coefficients']} components of {layer['basis_lights']} basis images "
            f"({layer['statistics']['kept_share']:.0%} of the sum of singular values, pictures within "
            f"{layer['statistics']['components_error']:.1%} RMS), {printing.size(layer['bytes'])}"
        )
    taken = f", {printing.duration(bake.seconds)}" if bake.seconds is not None else ""
    printing.say(
        f"{target}: {printing.size(summary['bytes'])}{taken}\nnow: prelight relight {target} RIG.toml -o picture.png"
    )


def _write_list(loaded: Any, settings: SteerableSettings, path: Path, *, force: bool, json: bool) -> None:
    from ..baking.steerable_foreign import lights_list
    from ..files import publish, refuse_existing

    refuse_existing(path, force=force)
    text = lights_list(loaded, settings)
    publish(path, text)
    count = sum(lamp.basis.lights for lamp in settings.lamps)
    if json:
        printing.say_json({"basis_lights": count, "output": str(path)})
        return
    printing.say(
        f"{path}: {count:,} basis lights; render each, then: prelight bake steerable … --from-images FOLDER"
    )
