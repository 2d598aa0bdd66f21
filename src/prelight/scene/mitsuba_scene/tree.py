"""A Mitsuba scene as a tree of its plug-ins, before any of them is made."""

from __future__ import annotations

import os
import xml.parsers.expat
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from ...files import read_regular
from ..mesh import UnreadableMesh
from .node import Node, essence
from .objects import node_of

_DEEPEST_XML = 64  # Mitsuba's parser overflows the stack far beyond
_DEEPEST_TREE = 32
_LARGEST_XML = 64_000_000


def tree_of_file(mi: ModuleType, path: Path) -> Node:
    """What an XML file says; other files it includes are read too. Raises InputError, UnreadableMesh."""
    _check_depth(read_regular(path, limit=_LARGEST_XML))
    config = _config(mi)
    try:
        state = mi.parser.parse_file(config, str(path))
        mi.parser.transform_all(config, state)
    except (RuntimeError, ValueError) as error:
        raise UnreadableMesh(essence(error)) from None
    return _Builder(mi, state, path.parent).root()


def tree_of_dict(mi: ModuleType, table: dict[str, Any]) -> Node:
    """What a dictionary as for ``mi.load_dict`` says. Raises UnreadableMesh."""
    config = _config(mi)
    try:
        state = mi.parser.parse_dict(config, table)
        mi.parser.transform_all(config, state)
    except (RuntimeError, TypeError, ValueError) as error:
        raise UnreadableMesh(essence(error)) from None
    return _Builder(mi, state, None).root()


def _config(mi: ModuleType) -> Any:
    config = mi.parser.ParserConfig(mi.variant())
    config.merge_meshes = config.merge_equivalent = config.parallel = False
    return config


def _check_depth(text: bytes) -> None:
    """Raises UnreadableMesh for elements nested deeper than any scene, or for what is no XML at all."""
    depth = 0

    def enter(_name: str, _attributes: object) -> None:
        nonlocal depth
        depth += 1
        if depth > _DEEPEST_XML:
            raise UnreadableMesh(f"elements nested more than {_DEEPEST_XML} deep")

    def leave(_name: str) -> None:
        nonlocal depth
        depth -= 1

    def refuse(*_declaration: object) -> None:
        raise UnreadableMesh("declares XML entities, which no Mitsuba scene needs; take them out")

    parser = xml.parsers.expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = enter, leave
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except xml.parsers.expat.ExpatError as error:
        raise UnreadableMesh(f"damaged XML: {error}") from None


class _Builder:
    """Nodes from a parser's state, each made once however many refer to it."""

    def __init__(self, mi: ModuleType, state: Any, folder: Path | None) -> None:
        self._mi, self._state, self._folder = mi, state, folder
        self._made: dict[int, Node] = {}
        self._open: set[int] = set()

    def root(self) -> Node:
        return self._node(0)

    def _node(self, index: int) -> Node:
        if index in self._made:
            return self._made[index]
        if index in self._open or len(self._open) > _DEEPEST_TREE:
            raise UnreadableMesh(f"objects refer to themselves, or more than {_DEEPEST_TREE} deep")
        self._open.add(index)
        given = self._state.nodes[index]
        properties, values, children = given.props, {}, {}
        for name in properties.keys():  # noqa: SIM118
            value, kind = properties[name], properties.type(name).name
            if kind == "ResolvedReference":
                children[name] = self._node(value.index())
            elif kind == "Object":
                self._take_object(name, value, values, children)
            elif kind == "Color":
                values[name] = {"type": "rgb", "value": [float(v) for v in value]}
            elif kind == "String" and name == "filename":
                values[name] = self._found(value, given)
            elif len(getattr(value, "shape", ())) == 3:
                values[name] = np.array(value, np.float32)
            else:
                values[name] = value
        self._open.discard(index)
        node = Node(
            given.type.name, properties.plugin_name(), properties.id(), values, children, self._where(given)
        )
        self._made[index] = node
        return node

    def _take_object(self, name: str, value: Any, values: dict, children: dict) -> None:
        node = node_of(self._mi, value)
        if node is None:
            values[name] = value  # a bitmap, say
        else:
            children[name] = node

    def _where(self, given: Any) -> str | None:
        if self._folder is None:
            return None
        where = self._mi.parser.file_location(self._state, given).rpartition("/")[2]
        return where[where.rfind("(line") :].strip("()") if given.file_index == 0 else where

    def _found(self, name: str, given: Any) -> str:
        """A file's name relative to the scene that names it, as Mitsuba looks for it."""
        if self._folder is None or os.path.isabs(name):
            return name
        beside = Path(str(self._state.files[given.file_index])).parent
        for candidate in (self._folder / name, beside / name):
            if candidate.exists():
                return str(candidate.absolute())
        return str(self._mi.file_resolver().resolve(name))
