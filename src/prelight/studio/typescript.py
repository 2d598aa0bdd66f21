"""The page's half of the protocol, ``web/source/messages.ts`` and ``start_messages.ts``, written from ``protocol`` and
``start_protocol``.

``python -m prelight.studio.typescript`` writes it anew; a test fails where it is not current.
"""

from __future__ import annotations

import json
import types
from dataclasses import MISSING, Field, fields
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from ..files import publish
from . import fields as limits
from . import frames, protocol, start_protocol
from . import protocol_values as values

TARGET = Path(__file__).parent / "web" / "source" / "messages.ts"
START_TARGET = TARGET.with_name("start_messages.ts")
_PLAIN = {str: "string", int: "number", float: "number", bool: "boolean", type(None): "null"}
_HEADER_FIELDS = ("magic", "frame", "sequence", "count", "milliseconds", "flags")


def messages_module() -> str:
    """The text of ``messages.ts``."""
    client, server = get_args(protocol.ClientMessage), get_args(protocol.ServerMessage)
    parts = [
        values.CameraView, values.EnvironmentChoice, values.DiscLight, values.PaintStroke, values.LampLight, values.Sun,
        values.PortalGlass, values.PortalView, values.SteeredPlace, values.SteeredView, values.LookKey,
        values.WorldView, values.LayerPace,
    ]  # fmt: skip
    blocks = [
        "// Written by prelight.studio.typescript from protocol.py: change that and write this anew.\n",
        *(f"export const {name} = {value};" for name, value in _constants().items()),
        "",
        "/** Byte offsets in the header of a radiance frame, little-endian. */",
        "export const HEADER = {"
        + ", ".join(f"{f}: {4 * i}" for i, f in enumerate(_HEADER_FIELDS))
        + "} as const;",
        "",
        *(_interface(kind, tagged=False, optional=False) for kind in parts),
        *(_interface(kind, tagged=True, optional=True) for kind in client),
        _union("Change", get_args(protocol.Change)),
        _union("ClientMessage", client),
        *(_interface(kind, tagged=True, optional=False) for kind in server),
        _union("ServerMessage", server),
    ]
    return "\n".join(blocks)


def start_messages_module() -> str:
    """The text of ``start_messages.ts``."""
    client, server = get_args(start_protocol.StartMessage), get_args(start_protocol.StartAnswer)
    parts = [
        start_protocol.Wish, start_protocol.StockView, start_protocol.LayerView, start_protocol.ProjectView,
    ]  # fmt: skip
    names = ("START_VERSION", "LARGEST_UPLOAD", "MOST_FILES", "MOST_PASSES")
    blocks = [
        "// Written by prelight.studio.typescript from start_protocol.py: change that and write this anew.\n",
        *(f"export const {name} = {getattr(start_protocol, name)};" for name in names),
        "",
        *(_interface(kind, tagged=False, optional=False) for kind in parts),
        *(_interface(kind, tagged=True, optional=True) for kind in client),
        _union("StartMessage", client),
        *(_interface(kind, tagged=True, optional=False) for kind in server),
        _union("StartAnswer", server),
    ]
    return "\n".join(blocks)


def _constants() -> dict[str, int | float]:
    names = (
        "PROTOCOL_VERSION", "MOST_DISCS", "MOST_LAMPS", "MOST_LOOKS", "MOST_DABS",
        "FRAMES_IN_FLIGHT", "LARGEST_SCALE", "LARGEST_TINT", "LARGEST_RADIANCE",
        "SMALLEST_RADIUS_DEG", "LARGEST_RADIUS_DEG", "FRAME_MAGIC", "FRAME_EXACT",
        "FRAME_ASIDE", "FRAME_VIEW", "FRAME_SHINE", "FRAME_WORLD", "FRAME_TRACED", "WORLD_WIDTH", "WORLD_HEIGHT",
        "MOST_KEYS", "MOST_TRACED", "HEADER_BYTES",
    )  # fmt: skip
    return {
        name: getattr(protocol, name, None) or getattr(limits, name, None) or getattr(frames, name)
        for name in names
    }


def _union(name: str, kinds: tuple[type, ...]) -> str:
    return f"export type {name} = " + " | ".join(kind.__name__ for kind in kinds) + ";\n"


def _interface(kind: Any, *, tagged: bool, optional: bool) -> str:
    hints = get_type_hints(kind)
    lines = [f'  type: "{kind.__name__}";'] if tagged else []
    lines += [_field(field, hints[field.name], optional=optional) for field in fields(kind)]
    comment = " ".join((kind.__doc__ or "").split())
    if len(lines) <= 2:
        return (
            f"/** {comment} */\nexport interface {kind.__name__} {{ "
            + " ".join(map(str.strip, lines))
            + " }\n"
        )
    return f"/** {comment} */\nexport interface {kind.__name__} {{\n" + "\n".join(lines) + "\n}\n"


def _field(field: Field, hint: Any, *, optional: bool) -> str:
    may_be_left_out = optional and field.default is not MISSING
    return f"  {field.name}{'?' if may_be_left_out else ''}: {_typed(hint)};"


def _typed(hint: Any) -> str:
    """A Python annotation as TypeScript has it."""
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return _typed(arguments[0])
    if origin is Literal:
        return " | ".join(json.dumps(value) for value in arguments)
    if origin in (Union, types.UnionType):
        return " | ".join(_typed(a) for a in arguments)
    if origin is tuple and arguments[-1] is Ellipsis:
        inner = _typed(arguments[0])
        return f"({inner})[]" if "|" in inner else f"{inner}[]"
    if origin is tuple:
        return "[" + ", ".join(_typed(a) for a in arguments) + "]"
    return _PLAIN.get(hint) or hint.__name__


def main() -> None:
    """Write ``messages.ts`` and ``start_messages.ts``."""
    publish(TARGET, messages_module().encode())
    publish(START_TARGET, start_messages_module().encode())


if __name__ == "__main__":
    main()
