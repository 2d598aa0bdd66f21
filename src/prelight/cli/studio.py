"""``prelight studio``: a bake in the browser, its light to be set."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import os
import sys
import threading
import webbrowser
from collections.abc import Callable, Generator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ..errors import InputError, escaped
from . import arguments, printing

if TYPE_CHECKING:
    from ..camera import Camera
    from ..lighting.rig import Rig
    from ..storage.bake import Bake
    from ..studio.environments import Environments
    from ..studio.server import Studio
    from ..studio.tracing import Growing, Pictures
    from ..studio.workshop import Workshop


_PATIENCE = 3.0  # seconds


def studio(
    bake: str | None = None,
    /,
    *skies: str,
    work: Path = Path("prelight-studio"),
    port: Annotated[int | None, Parameter(converter=arguments.whole_number)] = None,
    maps: Path | None = None,
    browser: Annotated[bool, Parameter(negative="--no-browser")] = True,
    trust: Annotated[bool, Parameter(negative="")] = False,
    json: Annotated[bool, Parameter(negative="")] = False,
) -> None:
    """Show a bake in the browser: look around, turn the sky, set lights. Ctrl-C ends it.

    Without a bake the start page opens: drop a scene, choose what to bake, see the cost, watch it, stop it, go on.

    Only this machine can reach it, by a link that opens it once; Enter in the terminal gives another one. The light
    that is set is kept beside the bake, in NAME.studio.json.

    Parameters
    ----------
    bake
        NAME.prelight, made by `prelight bake`; or a scene, which is baked first with the usual settings. If not given,
        one is made or chosen on the start page.
    skies
        Environment maps or rig files to choose from, as `prelight relight` takes them; our own skies are always there.
    work
        The folder for scenes that are dropped on the start page, and their bakes; made when there is something in it.
    port
        Of 127.0.0.1; 8737 if not given, or any free one where that is taken.
    maps
        A folder whose .hdr and .exr maps can be chosen too.
    browser
        Open the browser.
    trust
        Read scene descriptions that may run code or open other files: only if you know who made them.
    json
        Print one JSON object with the link on standard output, then serve; no browser is opened.
    """
    let_threads_sleep()
    if port is not None and not 0 <= port <= 65535:
        raise InputError("--port", f"{port}, expected 0 (any) to 65535")
    for sky in skies:
        _check_there(sky)
    opened = None if bake is None else opened_or_baked(bake, trust=trust, quiet=json)
    with contextlib.nullcontext() if opened is None else importing(_code_of(opened)):
        from ..studio.environments import Environments

        environments = Environments(skies, folder=maps)
        shop = workshop(work)
        serve(opened, environments, shop=shop, port=port, browser=browser and not json, json=json)


def let_threads_sleep() -> None:
    """Ask for threads that sleep when a kernel ends; to be called before the first kernel runs.

    GNU's OpenMP lets them spin for milliseconds: half of the processor time that a studio used, while its event loop
    and the browser waited for a processor.
    """
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")


def _code_of(bake: Bake) -> str:
    """The module that lights a bake."""
    from ..studio.kinds import is_sky_alone

    return "prelight.studio.lighting" if is_sky_alone(bake) else "prelight.studio.whole_light"


@contextlib.contextmanager
def importing(module: str) -> Generator[None]:
    """Import a module meanwhile: the compiled code behind the first light takes a second to load.

    What is wrong with it is said by whoever needs it.
    """

    def load() -> None:
        with contextlib.suppress(Exception):
            importlib.import_module(module)

    thread = threading.Thread(target=load, daemon=True)
    thread.start()
    try:
        yield
    finally:
        thread.join(_PATIENCE)  # rather than end the process in the middle of it


def workshop(work: Path) -> Workshop:
    """Where the start page's scenes are baked, by this program's own commands. Raises InputError, OutputError."""
    from ..errors import OutputError
    from ..scene.stock.catalogue import STOCK_SCENES
    from ..studio.start_protocol import StockView
    from ..studio.workshop import Workshop

    if work.exists() and not work.is_dir():
        raise OutputError(work, "is not a folder; choose another one with --work")
    stock = tuple(StockView(f"stock:{name}", scene.title) for name, scene in STOCK_SCENES.items())
    return Workshop(work.absolute(), command=(sys.executable, "-P", "-m", "prelight.cli.child"), stock=stock)


def opened_or_baked(source: str, *, trust: bool = False, quiet: bool = False) -> Bake:
    """A bake by its folder, or of a scene: made beside the working folder, or found there from another time."""
    from ..errors import PrelightError
    from ..storage.bake import Bake

    path = Path(source)
    from ..studio.kinds import vertex_kinds

    if path.is_dir() or path.suffix == ".prelight":
        bake = Bake.open(path)
        vertex_kinds(bake)  # says so where nothing in it can be shown
        return bake
    with printing.waiting("reading the scene"):
        from ..baking.environment import bake_planned
        from ..baking.environment_plan import plan_environment
        from ..baking.environment_settings import EnvironmentSettings
        from ..scene.loading import load_scene

        scene = load_scene(source, trust=trust)
    stock = source.startswith("stock:")
    target = Path((source.removeprefix("stock:") if stock else path.stem) + ".prelight")
    if target.exists():
        with contextlib.suppress(PrelightError):
            found = Bake.open(target)
            if found.manifest.scene.digest == scene.digest:
                return found
        raise InputError(
            target, "is there already, and is not a bake of this scene; rename it, or open it instead"
        )
    with printing.waiting("estimating the cost (the first time, compiling too)"):
        plan = plan_environment(scene, EnvironmentSettings())
    if not quiet:
        printing.say(
            f"{scene.name}: {plan.receivers:,} receivers; baking {printing.count(plan.rays)} rays takes about "
            f"{printing.duration(plan.seconds)}, {printing.size(plan.bytes)} on disk: {target}"
        )
    with printing.progress_bar("baking") as report:
        return bake_planned(scene, target, plan=plan, resume=True, report=report)


def serve(
    bake: Bake | None,
    environments: Environments,
    *,
    shop: Workshop,
    port: int | None = None,
    browser: bool,
    json: bool = False,
) -> None:
    """The studio of a bake, or without one its start page, until Ctrl-C."""
    from ..studio.kept import state_file
    from ..studio.server import Served, Studio

    def note(text: str) -> None:
        sys.stderr.write(f"prelight: {escaped(text)}\n")

    kept = None if bake is None else state_file(bake.path)
    running = Studio(Served(bake, environments, kept, note, path_tracer(), shop), port=port)
    link, asks = running.new_link(), not json and sys.stdin.isatty()
    if json:
        printing.say_json({"url": link})
    else:
        more = "Enter gives another link, " if asks else ""
        what = "start page of the studio" if bake is None else f"studio of {bake.path}"
        printing.say(f"{what}: {link}\n{more}Ctrl-C ends the studio")
    sys.stdout.flush()
    if browser and _has_screen():
        threading.Thread(target=webbrowser.open, args=(link,), daemon=True).start()
    if asks:
        threading.Thread(target=_give_links, args=(running,), daemon=True).start()
    try:
        running.serve()
    except KeyboardInterrupt as stop:
        if type(stop) is not KeyboardInterrupt:
            raise  # SIGTERM
        if not json:  # Ctrl-C is how one leaves, and nothing is lost
            printing.say(
                f"the studio has ended; its light is in {kept}"
                if kept is not None and kept.exists()
                else "the studio has ended"
            )


def path_tracer() -> Pictures | None:
    """The path tracer to compare with, where the renderer is installed."""
    if importlib.util.find_spec("mitsuba") is None:
        return None

    def traced(bake: Bake, rig: Rig, camera: Camera, size: tuple[int, int], samples: int) -> Growing:
        from ..checking.on_screen import pictures  # brings the renderer along

        yield from pictures(bake, rig, camera, size, samples)

    return traced


def _has_screen() -> bool:
    """Whether a browser would have a window: without, one for terminals would be opened in this one."""
    return not sys.platform.startswith("linux") or any(
        os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")
    )


def _give_links(running: Studio, read: Callable[[], str] | None = None) -> None:
    """Another link for each Enter."""
    with contextlib.suppress(OSError, ValueError):
        while (read or sys.stdin.readline)():
            printing.say(running.new_link())
            sys.stdout.flush()


def _check_there(sky: str) -> None:
    """Raises InputError for a map that is not there, before anything is opened."""
    from ..lighting.sky import STOCK_SKIES

    name = sky.removeprefix("stock:")
    if sky.startswith("stock:") and name in STOCK_SKIES:
        return
    if sky.startswith("stock:") or ("{face}" not in sky and not Path(sky).exists()):
        known = ", ".join(STOCK_SKIES)
        raise InputError(sky, f"no such environment map; expected a file, or stock: and one of {known}")
