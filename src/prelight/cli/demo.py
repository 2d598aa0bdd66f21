"""``prelight demo``: the built-in scene, baked, relit under several skies in pictures, then in the studio."""

from __future__ import annotations

import shlex
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from . import printing

if TYPE_CHECKING:
    from ..storage.bake import Bake

SCENE = "sculpture"
RESOLUTION = 128


def demo(
    *,
    output: Annotated[Path, Parameter(["--output", "-o"])] = Path("prelight-demo"),
    browser: Annotated[bool, Parameter(negative="--no-browser")] = True,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Bake the built-in sculpture, light it with several skies, write the pictures; then open a chapel in the studio.

    The sculpture takes a minute or two on two cores, the chapel another: its windows and the sun behind them, their
    glass, and lamps anywhere can all be set. A second run finds the bakes and only lights them. Without a terminal, or
    with --no-browser or --json, it ends after the pictures.

    Parameters
    ----------
    output
        The folder for the bakes and the pictures.
    browser
        Open the studio in the browser at the end.
    json
        Print one JSON object on standard output, and end.
    """
    from ..errors import OutputError
    from ..files import explain
    from ..lighting.environment import Environment
    from ..lighting.sky import STOCK_SKIES
    from .studio import let_threads_sleep

    let_threads_sleep()
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(output, f"cannot make the folder: {explain(error)}") from None
    light, bake_seconds = _baked(output, quiet=json)
    lit = []
    for name in STOCK_SKIES:
        environment = Environment.stock(name)
        started = time.perf_counter()
        light.environment = environment
        light.refresh()
        relit = light.last.milliseconds
        picture = light.picture(width=1280, height=720)
        path = output / f"{name}.png"
        picture.save(path, force=True, exposure=0.0)  # the stock skies are painted for it
        lit.append(
            {
                "sky": name,
                "picture": str(path),
                "milliseconds": relit,
                "seconds": time.perf_counter() - started,
            }
        )
        if not json:
            printing.say(f"{path}  relit in {relit:.1f} ms")
    if json:
        printing.say_json({"folder": str(output.resolve()), "bake_seconds": bake_seconds, "pictures": lit})
    else:
        printing.say(f"The pictures are in {output.resolve()}")
        _open_studio(light.bake, browser=browser and sys.stdin.isatty() and sys.stdout.isatty())


def _open_studio(bake: Bake, *, browser: bool) -> None:
    """The studio, or how to open it: a script that runs the demo must not wait for a person."""
    if not browser:
        printing.say(f"To turn the sky yourself: prelight studio {shlex.quote(str(bake.path))}")
        return
    from ..studio.environments import Environments
    from .demo_chapel import chapel, light_it
    from .studio import serve, workshop

    folder = bake.path.parent
    shown = chapel(folder)
    light_it(shown, note=printing.say)
    serve(shown, Environments(), shop=workshop(folder / "scenes"), browser=True)


def _baked(folder: Path, *, quiet: bool):
    """A relighter over the demo's bake, which is made, resumed or found."""
    from ..baking.environment import bake_planned
    from ..baking.environment_plan import EnvironmentSettings, plan_environment
    from ..errors import PrelightError
    from ..relighting.relighter import Relighter
    from ..scene.stock.catalogue import stock_scene
    from ..storage.bake import Bake

    scene = stock_scene(SCENE)
    path = folder / f"{SCENE}.prelight"
    try:
        bake = Bake.open(path)
        if bake.manifest.scene.digest == scene.digest:
            return Relighter(bake), 0.0
    except PrelightError:
        pass  # none yet, or one of an older version: it is ours, so it is made anew
    started = time.perf_counter()
    with printing.waiting("estimating the cost (the first time, compiling too)"):
        plan = plan_environment(scene, EnvironmentSettings(resolution=RESOLUTION))
    if not quiet:
        printing.say(
            f"{SCENE}: {plan.receivers:,} receivers; baking {printing.count(plan.rays)} rays "
            f"takes about {printing.duration(plan.seconds)}"
        )
    with printing.progress_bar("baking") as report:
        bake = bake_planned(scene, path, plan=plan, resume=True, force=True, report=report)
    seconds = time.perf_counter() - started
    if not quiet:
        printing.say(
            f"baked {plan.receivers:,} receivers × {6 * RESOLUTION**2:,} lights in {printing.duration(seconds)}"
        )
    return Relighter(bake), seconds
