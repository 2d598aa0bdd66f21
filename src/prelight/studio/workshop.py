"""Where scenes become bakes: what the start page asks for, done by commands beside the studio, told to every visitor.

Lives on the event loop. One scene is baked at a time and one is looked at or planned; both by processes of their own.
"""

from __future__ import annotations

import asyncio
import contextlib
import shlex
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..errors import InputError, PrelightError
from .children import Child
from .projects import Project, new_project, read_projects
from .rates import Rate
from .recipes import Recipe, mesh_arguments, recipes, refusal
from .start_protocol import MOST_PASSES, LayerView, ProjectView, StockView, Wish
from .uploads import Uploads

_FIRST_PASSES = 4  # before it is baked
_MOST_NOTES = 6


@dataclass
class Progress:
    """A project as it is now, beside what is kept of it."""

    project: Project
    stage: str = "looking"
    reason: str | None = None
    facts: dict[str, Any] = field(default_factory=dict)
    costs: dict[str, dict[str, Any]] = field(default_factory=dict)  # of each layer, by its recipe's key
    shares: dict[str, float] = field(default_factory=dict)
    rate: Rate = field(default_factory=Rate)
    passes: int = 0
    asked: int = 0  # passes
    looker: Child | None = None
    work: asyncio.Task[None] | None = None
    baker: Child | None = None


class Workshop:
    """The projects of a work folder.

    Parameters
    ----------
    work
        The folder, which need not be there yet: nothing is written outside it.
    command
        What runs ``prelight``: see ``children.Child``.
    stock
        The built-in scenes to choose from.
    """

    def __init__(self, work: Path, *, command: tuple[str, ...], stock: tuple[StockView, ...]) -> None:
        self.work, self.stock, self._command = work, stock, command
        self.uploads = Uploads(work)
        self.changed: Callable[[], None] = lambda: None
        self._baking, self._planning = asyncio.Lock(), asyncio.Lock()
        self._watching: set[asyncio.Task[None]] = set()
        self._projects = {project.id: self._known(project) for project in reversed(read_projects(work))}

    @staticmethod
    def _known(project: Project) -> Progress:
        if project.is_baked:
            return Progress(project, "baked")
        if project.is_begun:
            return Progress(project, "stopped", "the bake was stopped; what is done is kept")
        return Progress(project, "ready")

    def project(self, name: str) -> Project:
        """Raises InputError if there is none."""
        return self._one(name).project

    def _one(self, name: str) -> Progress:
        if name not in self._projects:
            raise InputError("project", f"{name[:60]!r} is not there")
        return self._projects[name]

    def picture(self, name: str) -> Path | None:
        """Of a project, if it has one."""
        one = self._projects.get(name)
        return None if one is None or not one.project.picture.is_file() else one.project.picture

    # ---- What a page asks for ----------------------------------------------------------------------------

    def choose(self, scene: str) -> str:
        """Begin with a built-in scene, or go on with it. Raises InputError, OutputError."""
        if scene not in [known.scene for known in self.stock]:
            raise InputError("scene", f"{scene[:60]!r} is no built-in scene")
        for one in self._projects.values():
            if one.project.source == scene:
                if not one.facts:
                    self._look(one)
                return one.project.id
        return self._begin(new_project(self.work, source=scene, wish=Wish()))

    def take(self, upload: str, main: str) -> str:
        """Begin with files that were sent. Raises InputError, OutputError."""
        files = self.uploads.taken(upload, main)
        return self._begin(new_project(self.work, source=main, wish=Wish(), files=files))

    def _begin(self, project: Project) -> str:
        one = Progress(project)
        self._projects[project.id] = one
        self._look(one)
        return project.id

    def wish(self, name: str, wish: Wish) -> None:
        """Choose what to bake; the cost is estimated. Raises InputError, OutputError while it is baked."""
        one = self._one(name)
        if one.stage == "baking":
            raise InputError("wish", "it is being baked; stop it first")
        if not one.project.folder.is_dir():
            raise InputError("wish", "this scene could not be read; drop another")
        other_mesh = mesh_arguments(wish) != mesh_arguments(one.project.wish)
        one.project.wish = wish
        one.project.keep()
        if one.project.is_baked:
            one.stage, one.reason = "baked", None
            self.changed()
        elif other_mesh or not one.facts:
            self._look(one)
        else:
            self._start(one, "planning", self._plan(one))

    def bake(self, name: str) -> None:
        """Begin or go on. Raises InputError."""
        one = self._one(name)
        if one.stage not in ("ready", "stopped"):
            raise InputError("bake", f"it is {one.stage}")
        self._start(one, "baking", self._bake(one))

    def stop(self, name: str) -> None:
        """Stop baking; nothing happens where nothing is baked. Raises InputError."""
        one = self._one(name)
        if one.stage == "baking" and one.work is not None:
            one.work.cancel()

    async def close(self) -> None:
        """End every process; bakes stay resumable."""
        for one in self._projects.values():
            if one.work is not None:
                one.work.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await one.work
            await self._dismiss(one)

    # ---- What is done ------------------------------------------------------------------------------------

    def _start(self, one: Progress, stage: str, work: Coroutine[Any, Any, None]) -> None:
        before = one.work

        async def run() -> None:
            if before is not None:
                before.cancel()
                with contextlib.suppress(asyncio.CancelledError):
                    await before
            try:
                await work
            except (PrelightError, OSError) as error:
                begun = stage == "baking"
                one.stage = "stopped" if begun else "refused"
                one.reason = getattr(error, "reason", None) or str(error)
            except asyncio.CancelledError:
                if stage == "baking":
                    one.stage, one.reason = "stopped", "stopped; what is done is kept"
                raise
            finally:
                work.close()
                self.changed()

        one.stage, one.reason = stage, None
        one.work = asyncio.get_running_loop().create_task(run())
        self.changed()

    def _look(self, one: Progress) -> None:
        async def look() -> None:
            async with self._planning:
                await self._dismiss(one)
                one.passes = one.asked = 0
                await self._hear_of(one)
            await self._plan(one)

        self._start(one, "looking", look())

    async def _hear_of(self, one: Progress) -> None:
        """Have the scene read, and ask for a first picture. Raises InputError for one that cannot be."""
        project = one.project
        arguments = ("look", project.scene, str(project.picture), *mesh_arguments(project.wish))
        looker = Child(self._command, project.wish.device, arguments)
        await looker.start()
        one.looker = looker
        hearing = asyncio.create_task(looker.listen())
        facts = await looker.answer()
        if facts is None:
            await hearing
            project.forget_files()  # nothing that cannot be read is kept
            raise InputError(project.name, _without_path(looker.said, project) or "could not be read")
        one.facts = facts
        watching = asyncio.create_task(self._watch(one, looker))
        self._watching.add(watching)
        watching.add_done_callback(lambda _: (hearing.cancel(), self._watching.discard(watching)))
        looker.ask(str(_FIRST_PASSES))
        self.changed()

    async def _watch(self, one: Progress, looker: Child) -> None:
        while one.looker is looker and (said := await looker.answer()) is not None:
            one.passes = int(said.get("passes", 0))
            self.changed()

    async def _dismiss(self, one: Progress) -> None:
        looker, one.looker = one.looker, None
        if looker is not None:
            await looker.stop()

    async def _plan(self, one: Progress) -> None:
        """Find what each layer costs, as ``--dry-run --json`` says it."""
        project = one.project
        if why := refusal(project.wish, windows=one.facts.get("windows", 1)):
            raise InputError("wish", why)
        async with self._planning:
            one.stage = "planning"
            self.changed()
            for recipe in recipes(project.wish):
                if recipe.key not in one.costs:
                    said = Child(
                        self._command, project.wish.device, self._arguments(one, recipe, "--dry-run")
                    )
                    try:
                        one.costs[recipe.key] = await said.result()
                    except InputError as error:
                        raise InputError(recipe.kind, _without_path(error.reason, project)) from None
        one.stage = "stopped" if project.is_begun else "ready"
        if one.stage == "stopped":
            one.reason = "the bake was stopped; what is done is kept"

    def _arguments(self, one: Progress, recipe: Recipe, *more: str) -> tuple[str, ...]:
        project = one.project
        target = ("-o", str(project.layer(recipe)))
        return ("bake", recipe.kind, project.scene, *recipe.arguments, *target, "--json", *more)

    async def _bake(self, one: Progress) -> None:
        project = one.project
        async with self._baking:
            if not one.facts:  # it is of another day
                await self._hear_of(one)
            if any(recipe.key not in one.costs for recipe in recipes(project.wish)):
                await self._plan(one)
            one.stage = "baking"
            self.changed()
            project.layer_folder()
            for recipe in recipes(project.wish):
                await self._bake_layer(one, recipe)
            await asyncio.to_thread(project.join)
        one.stage, one.reason = "baked", None
        await self._dismiss(one)

    async def _bake_layer(self, one: Progress, recipe: Recipe) -> None:
        cost = one.costs[recipe.key]
        one.rate = Rate(cost.get("rays", 0), cost.get("seconds", 0.0))
        if not one.project.layer(recipe).is_dir():

            def heard(share: float) -> None:
                one.shares[recipe.key] = share
                one.rate.note(share)
                self._sharpen(one)
                self.changed()

            one.baker = Child(
                self._command, one.project.wish.device, self._arguments(one, recipe, "--resume")
            )
            try:
                await one.baker.result(heard)
            except InputError as error:
                raise InputError(recipe.kind, _without_path(error.reason, one.project)) from None
            finally:
                one.baker = None
        one.shares[recipe.key] = 1.0

    def _sharpen(self, one: Progress) -> None:
        """As many paths a pixel as the bake has got on: the picture and the bake are ready together."""
        wanted = max(_FIRST_PASSES, round(MOST_PASSES * _share(one)))
        if one.looker is not None and wanted > one.asked:
            one.asked = wanted
            one.looker.ask(str(wanted))

    # ---- What is shown -----------------------------------------------------------------------------------

    def views(self) -> tuple[ProjectView, ...]:
        """All projects, the newest first."""
        return tuple(self._view(one) for one in reversed(self._projects.values()))

    def _view(self, one: Progress) -> ProjectView:
        project, facts = one.project, one.facts
        is_baked = one.stage == "baked"
        layers = tuple(self._layer_view(one, recipe, is_baked=is_baked) for recipe in recipes(project.wish))
        left = sum((1 - layer.share) * layer.seconds for layer in layers)
        return ProjectView(
            id=project.id, name=project.name, source=project.source, stage=one.stage, reason=one.reason,  # ty: ignore
            wish=project.wish, vertices=facts.get("vertices", 0), triangles=facts.get("triangles", 0),
            windows=facts.get("windows", 0), devices=tuple(facts.get("devices", ("cpu",))),
            notes=tuple(str(note) for note in facts.get("notes", ())[:_MOST_NOTES]), layers=layers,
            share=1.0 if is_baked else _share(one),
            seconds_left=one.rate.left(left) if one.stage == "baking" else None,
            rays_per_second=one.rate.rays_per_second if one.stage == "baking" else None,
            passes=one.passes or int(project.picture.is_file()), path=str(project.bake) if is_baked else None,
        )  # fmt: skip

    def _layer_view(self, one: Progress, recipe: Recipe, *, is_baked: bool) -> LayerView:
        cost = one.costs.get(recipe.key, {})
        done = is_baked or one.project.layer(recipe).is_dir()
        words = ("prelight", "bake", recipe.kind, one.project.scene, *recipe.arguments)
        return LayerView(
            kind=recipe.kind, title=recipe.title, command=shlex.join(words), rays=int(cost.get("rays", 0)),
            seconds=float(cost.get("seconds", 0.0)), bytes=int(cost.get("bytes", 0)),
            memory=int(cost.get("memory", 0)), share=1.0 if done else one.shares.get(recipe.key, 0.0),
        )  # fmt: skip


def _share(one: Progress) -> float:
    """How much of a project's seconds is done."""
    keys = [recipe.key for recipe in recipes(one.project.wish)]
    seconds = [one.costs.get(key, {}).get("seconds", 1.0) for key in keys]
    done = sum(one.shares.get(key, 0.0) * s for key, s in zip(keys, seconds, strict=True))
    return done / max(sum(seconds), 1e-9)


def _without_path(reason: str, project: Project) -> str:
    """A line of a command, with the scene as the visitor knows it."""
    return reason.replace(f"{project.folder}/scene/", "").replace(f"{project.folder}/", "")
