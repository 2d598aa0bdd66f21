"""A plug-in of a Mitsuba scene, told before it is made, and Mitsuba's reasons why it cannot be."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

import numpy as np

from ..mesh import UnreadableMesh

_OF_SOURCE = re.compile(r"\[\w+\.(?:cpp|h):\d+\]\s*")
_NEEDLESS = (  # what Mitsuba says around a reason, and what stays of it
    (re.compile(r'(?:At|While loading|Error while loading) dictionary node "[^"]*": '), ""),
    (re.compile(r"^(?:At|While loading|Error while loading) .*? \((line \d+, col \d+)\): "), r"\1: "),
    (re.compile(r'^(?:Error while loading|Parsing of) XML file "[^"]*"(?: failed)?: '), ""),
    (re.compile(r'failed to instantiate \w+ plugin of type "([^"]*)": \[\w+\] '), r"\1: "),
)


@dataclass(frozen=True, eq=False)
class Node:
    """One plug-in: what it is, its values, and the plug-ins in it by the names they were given.

    ``values`` are numbers, words, arrays, and Mitsuba's own transforms, spectra and bitmaps.
    """

    kind: str  # Shape, BSDF, Texture, Emitter, Sensor, Film, Scene, ...
    plugin: str
    name: str
    values: Mapping[str, Any] = field(default_factory=dict)
    children: Mapping[str, Node] = field(default_factory=dict)
    where: str | None = None
    made: Any = None  # Mitsuba's object, where the caller gave one

    def of_kind(self, kind: str) -> list[Node]:
        """The children that are such plug-ins."""
        return [child for child in self.children.values() if child.kind == kind]

    def as_dict(self, mi: ModuleType, *, without: tuple[str, ...] = ()) -> dict[str, Any]:
        """For ``mi.load_dict``, leaving out children of some kinds."""
        table: dict[str, Any] = {"type": self.plugin}
        for name, value in self.values.items():
            # Mitsuba empties the tensors it is given: each time a new one.
            table[name] = mi.TensorXf(value) if isinstance(value, np.ndarray) else value
        for name, child in self.children.items():
            if child.kind not in without:
                table[name] = child.as_dict(mi) if child.made is None else child.made
        return table


def is_transform(value: object) -> bool:
    """Whether it is one of Mitsuba's transforms, of any precision; its arrays have a ``matrix`` too."""
    return "Transform" in type(value).__name__


def essence(error: BaseException) -> str:
    """What is wrong, out of Mitsuba's long messages: the innermost reason in one line."""
    lines = [line.strip() for line in _OF_SOURCE.sub("", str(error)).splitlines() if line.strip()]
    while len(lines) > 1 and (lines[0].endswith("while processing <include>:") or not lines[0]):
        lines = lines[1:]
    said = " ".join(lines) or type(error).__name__
    for pattern, instead in _NEEDLESS:
        said = pattern.sub(instead, said)
    return said


def load_object(mi: ModuleType, node: Node, *, without: tuple[str, ...] = ()) -> Any:
    """The plug-in itself. Raises UnreadableMesh with Mitsuba's reason."""
    if node.made is not None:
        return node.made
    try:
        return mi.load_dict(node.as_dict(mi, without=without), optimize=False, parallel=False)
    except (RuntimeError, TypeError, ValueError) as error:
        raise UnreadableMesh(essence(error), node.where) from None
