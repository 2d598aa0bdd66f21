"""What ``prelight demo`` opens in the studio: a small chapel whose windows, lamps and sun can all be set."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from . import printing

if TYPE_CHECKING:
    from ..scene.geometry import Scene
    from ..storage.bake import Bake

SCENE = "portals-small"
_NAME = "chapel.prelight"
# A winter's noon through stained glass, dimmed until its colours are seen beside a warm lamp at the altar and a spot on
# the way to it; blinds before the clear windows.
_RIG = """[sun]
place = [43.7, 15.9]
time = "2026-12-21T11:10"
scale = 0.02

[[portal]]
name = "clear glass"
blind = 0.6

[[lamp]]
name = "by the altar"
position = [0.0, 1.6, -6.4]
radius = 0.06
lumens = 1400
kelvin = 2300

[[spot]]
name = "on the aisle"
position = [0.0, 4.6, 2.6]
target = [0.0, 0.0, -1.0]
width_deg = 34
intensity = [4.0, 3.4, 2.6]
"""


def chapel(folder: Path) -> Bake:
    """The chapel's bake in a folder, made, resumed or found: the light through its glass, and lamps anywhere."""
    from ..errors import PrelightError
    from ..scene.stock.catalogue import stock_scene
    from ..storage.bake import Bake

    scene, path = replace(stock_scene(SCENE), name="Chapel"), folder / _NAME
    try:
        bake = Bake.open(path)
        if bake.manifest.scene.digest == scene.digest and len(bake.layers) == 2:
            return bake
    except PrelightError:
        pass  # none yet, or one of an older version
    printing.say(
        "For the studio a chapel is baked, in two layers: its windows, whose glass can be set, and lamps."
    )
    return _made(scene, path)


def _made(scene: Scene, path: Path) -> Bake:
    from ..baking import portals, transfer
    from ..baking.portals_plan import plan_portals
    from ..baking.portals_settings import PortalsSettings
    from ..baking.transfer_plan import plan_transfer
    from ..baking.transfer_settings import TransferSettings
    from ..storage.joining import add_layers

    with printing.waiting("estimating the cost"):
        windows = plan_portals(scene, PortalsSettings(cube=16, rays=1024, gather_rays=256))
        lamps = plan_transfer(
            scene, TransferSettings(gather_rays=256, entries=128, operator_bounces=1, modes=64)
        )
    printing.say(
        f"{scene.name}: {windows.receivers:,} receivers, {windows.portals} portals; "
        f"{printing.count(windows.rays)} rays for its windows, about {printing.duration(windows.seconds)}, "
        f"and {printing.count(lamps.rays)} for lamps, {printing.duration(lamps.seconds)}"
    )
    other = path.with_name("chapel-lamps.prelight")
    with printing.share_bar("its windows") as report:
        portals.bake_planned(path, plan=windows, resume=True, force=True, report=report)
    with printing.share_bar("lamps") as report:
        transfer.bake_planned(other, plan=lamps, resume=True, force=True, report=report)
    bake = add_layers(path, other, force=True)
    shutil.rmtree(other, ignore_errors=True)
    return bake


def light_it(bake: Bake, *, note: Callable[[str], None]) -> None:
    """Keep a light to begin with beside the bake, unless there is one of an earlier visit."""
    from ..errors import PrelightError
    from ..studio.environments import Environments
    from ..studio.kept import save, state_file
    from ..studio.rig_state import initial
    from ..studio.rig_toml import opened_rig

    kept = state_file(bake.path)
    if kept.exists():
        return
    known = Environments()
    try:
        save(opened_rig(_RIG, initial(known.first), known), kept)
    except PrelightError as error:
        note(str(error))
