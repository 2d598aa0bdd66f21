"""Scenes on their way to a bake, each in a folder of its own inside one work folder.

``WORK/ID/project.json`` says where the scene is from and what is wanted; ``scene/`` holds files that were sent,
``layers/`` the bake of each layer as it is made, ``ID.prelight`` all of them in one. Everything that a restarted studio
shows is read from there.
"""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from ..errors import InputError, OutputError
from ..files import explain, publish, read_regular
from ..storage.bake import Bake
from ..storage.joining import add_layers
from .recipes import Recipe, recipes
from .start_protocol import MOST_PROJECTS, Wish

_KEPT = "project.json"
_LARGEST = 100_000
_STOCK = "stock:"
_WISH = TypeAdapter(Wish)


@dataclass
class Project:
    """A scene and what is wanted of it. ``source``: stock:NAME, or the name of a file in its folder."""

    id: str
    name: str
    source: str
    wish: Wish
    folder: Path

    @property
    def scene(self) -> str:
        """What the commands are given."""
        return self.source if self.source.startswith(_STOCK) else str(self.folder / "scene" / self.source)

    @property
    def bake(self) -> Path:
        """Where the finished bake is, or will be."""
        return self.folder / f"{self.id}.prelight"

    @property
    def picture(self) -> Path:
        """Where the picture that sharpens is."""
        return self.folder / "picture.png"

    def layer(self, recipe: Recipe) -> Path:
        """Where one layer is baked."""
        return self.folder / "layers" / f"{recipe.key}.prelight"

    def layer_folder(self) -> None:
        """Make room for layers. Raises OutputError."""
        try:
            (self.folder / "layers").mkdir(exist_ok=True)
        except OSError as error:
            raise OutputError(self.folder, f"cannot make a folder there: {explain(error)}") from None

    def keep(self) -> None:
        """Write what it is. Raises OutputError."""
        said = {"name": self.name, "source": self.source, "wish": asdict(self.wish)}
        publish(self.folder / _KEPT, json.dumps(said, indent=1).encode())

    def forget_files(self) -> None:
        """Remove the folder of a scene whose files were sent; one of ours stays."""
        if not self.source.startswith(_STOCK):
            shutil.rmtree(self.folder, ignore_errors=True)

    @property
    def is_baked(self) -> bool:
        """Whether the finished bake is what is wanted now."""
        return self._joined() == [recipe.key for recipe in recipes(self.wish)] and self.bake.is_dir()

    @property
    def is_begun(self) -> bool:
        """Whether something of it is kept to go on from."""
        return any(
            self.layer(recipe).is_dir()
            or self.layer(recipe).with_name(f"{recipe.key}.prelight.partial").is_dir()
            for recipe in recipes(self.wish)
        )

    def _joined(self) -> list[str]:
        try:
            return list(json.loads(read_regular(self.folder / "joined.json", limit=_LARGEST)))
        except (InputError, ValueError, TypeError):
            return []

    def join(self) -> None:
        """One bake of all its layers, in the place of an earlier one. Raises OutputError, DamagedBakeError."""
        first, *others = [self.layer(recipe) for recipe in recipes(self.wish)]
        fresh = self.folder / "joining.prelight"
        try:
            shutil.rmtree(fresh, ignore_errors=True)
            shutil.copytree(first, fresh, copy_function=_linked)
            for other in others:
                add_layers(fresh, other)
            Bake.open(fresh)
            shutil.rmtree(self.bake, ignore_errors=True)
            os.rename(fresh, self.bake)
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            raise OutputError(self.bake, f"cannot put the layers together: {explain(error)}") from None
        publish(self.folder / "joined.json", json.dumps([r.key for r in recipes(self.wish)]).encode())


def _linked(source: str, target: str) -> str:
    """The same bytes under another name: files of a bake are never changed in place."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)
    return target


def read_projects(work: Path) -> list[Project]:
    """Those of a work folder, the newest first; folders that are none of ours are left alone."""
    if not work.is_dir():
        return []
    found = []
    for kept in work.glob(f"*/{_KEPT}"):
        folder = kept.parent
        if folder.is_symlink() or not re.fullmatch(r"[a-z0-9][a-z0-9-]{0,50}", folder.name):
            continue
        try:
            said = json.loads(read_regular(kept, limit=_LARGEST))
            project = _project(folder, said)
        except (InputError, ValueError, KeyError, TypeError, RecursionError, ValidationError):
            continue
        found.append((kept.stat().st_mtime, project))
    return [project for _, project in sorted(found, key=lambda pair: -pair[0])][:MOST_PROJECTS]


def _project(folder: Path, said: Any) -> Project:
    name, source = str(said["name"])[:100], str(said["source"])
    if not source.startswith(_STOCK) and Path(source).name != source:
        raise ValueError(source)
    return Project(folder.name, name, source, _WISH.validate_python(said["wish"]), folder)


def new_project(work: Path, *, source: str, wish: Wish, files: Path | None = None) -> Project:
    """A folder for a scene; ``files``: the folder that its files were sent to. Raises OutputError, InputError."""
    name = source.removeprefix(_STOCK) if source.startswith(_STOCK) else Path(source).stem
    stem = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:40] or "scene"
    try:
        work.mkdir(parents=True, exist_ok=True)
        for number in range(1, MOST_PROJECTS + 1):
            folder = work / (stem if number == 1 else f"{stem}-{number}")
            try:
                folder.mkdir()
                break
            except FileExistsError:
                continue
        else:
            raise InputError(work, f"has {MOST_PROJECTS} scenes called {stem} already; remove some")
        if files is not None:
            os.rename(files, folder / "scene")
    except OSError as error:
        raise OutputError(work, f"cannot make a folder there: {explain(error)}") from None
    project = Project(folder.name, name, source, wish, folder)
    project.keep()
    return project
