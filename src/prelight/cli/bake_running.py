"""What every kind of bake asks for in the same words: how the scene is read, and how the bake is run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol

from cyclopts import Parameter

from . import arguments, printing

if TYPE_CHECKING:
    from ..scene.geometry import Scene
    from ..storage.bake import Bake

_FLAG = Parameter(negative="")


class Plan(Protocol):
    """What is known of a bake before it is made."""

    def summary(self) -> dict[str, Any]: ...


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Reading:
    """How a scene is read.

    Parameters
    ----------
    floor
        Put a floor of 193×193 vertices under the lowest point, SCALE times the largest extent wide.
    albedo
        Reflectance of vertices that the file gives none, one number or three, 0 to 1; default 0.8.
    trust
        Read scene descriptions that may run code or open other files (Mitsuba XML): only if you know who made them.
    """

    floor: float | None = None
    albedo: str | None = None
    trust: Annotated[bool, _FLAG] = False

    def load(self, scene: str, *, subdivide: float | None = None) -> Scene:
        """Raises InputError for what cannot be read."""
        from ..scene.loading import load_scene

        colour = None if self.albedo is None else arguments.colour("--albedo", self.albedo)
        return load_scene(scene, floor=self.floor, albedo=colour, subdivide=subdivide, trust=self.trust)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Running:
    """How a bake is run.

    Parameters
    ----------
    memory
        What the bake may use, such as 4GB, at least 500MB; default half of this machine's.
    dry_run
        Only say what it would cost.
    resume
        Go on with an interrupted bake.
    force
        Replace the output, or begin an interrupted bake anew.
    json
        Print one JSON object on standard output.
    """

    memory: str | None = None
    dry_run: Annotated[bool, _FLAG] = False
    resume: Annotated[bool, _FLAG] = False
    force: Annotated[bool, _FLAG] = False
    json: Annotated[bool, _FLAG] = False

    @property
    def budget(self) -> int | None:
        """Bytes. Raises InputError if what was given is no size."""
        return arguments.memory(self.memory)

    def target(self, scene: str, output: Path | None, *, writes: bool = True) -> Path:
        """Where the bake goes; unless nothing will be written, raises InputError if it may not go there."""
        from ..storage.journal import refuse_target

        target = arguments.bake_target(scene, output)
        if writes and not self.dry_run:
            refuse_target(target, force=self.force)
        return target

    def bake(
        self,
        target: Path,
        plan: Plan,
        start: Callable[..., Bake],
        *,
        bar: Callable[[str], AbstractContextManager[Callable[..., None]]] = printing.share_bar,
        more: Mapping[str, Any] | None = None,
    ) -> Bake | None:
        """Do what was planned. None if nothing is left to say: nothing was to be baked, or it is said as JSON.

        ``more`` is said besides the plan's summary, where only that is asked for.
        """
        if self.dry_run:
            if self.json:
                printing.say_json(plan.summary() | dict(more or {}))
            return None
        with bar("baking") as report:
            bake = start(target, plan=plan, resume=self.resume, force=self.force, report=report)
        if not self.json:
            return bake
        printing.say_json(bake.summary())
        return None


AS_IT_IS, AT_ONCE = Reading(), Running()
