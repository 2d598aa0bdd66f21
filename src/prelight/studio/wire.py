"""The studio's messages as JSON text, and back: what is no message is refused in one line."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, get_args

from pydantic import TypeAdapter, ValidationError

from ..errors import InputError
from .protocol import LARGEST_MESSAGE, ClientMessage, Message


def encode(message: Message) -> str:
    """The JSON text of a message."""
    return json.dumps(_plain(message), allow_nan=False)


def _plain(value: Any) -> Any:
    """Messages, also those inside others, as objects with a type."""
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if not is_dataclass(value):
        return value
    named = {field.name: _plain(getattr(value, field.name)) for field in fields(value)}
    return {"type": type(value).__name__, **named} if isinstance(value, Message) else named


def decode(text: str, kinds: Any = ClientMessage) -> Any:
    """A message of a page, one of ``kinds``. Raises InputError, naming it and the field, for whatever it is not."""
    if len(text) > LARGEST_MESSAGE:
        raise InputError("message", f"{len(text):,} characters, at most {LARGEST_MESSAGE:,} are read")
    try:
        given = json.loads(text, parse_constant=_no_constant)
    except (ValueError, RecursionError):
        raise InputError("message", "not JSON (numbers are finite)") from None
    if not isinstance(given, dict):
        raise InputError("message", f"a {type(given).__name__}, expected an object with a type")
    name = given.pop("type", None)
    readers = _readers(kinds)
    if not isinstance(name, str) or name not in readers:
        raise InputError("message", f"type {str(name)[:40]!r}, expected one of {', '.join(readers)}")
    try:
        return readers[name].validate_python(given)
    except ValidationError as error:
        raise _refusal(name, error) from None


def _no_constant(name: str) -> None:
    raise ValueError(name)


@cache
def _readers(kinds: Any) -> dict[str, TypeAdapter[Any]]:
    return {kind.__name__: TypeAdapter(kind) for kind in get_args(kinds)}


def _refusal(name: str, error: ValidationError) -> InputError:
    """The first thing that is wrong, in one line."""
    first = error.errors(include_url=False, include_context=False)[0]
    field = ".".join(str(part) for part in first["loc"]) or "message"
    try:
        given = repr(first["input"])[:60]
    except ValueError:  # a whole number of thousands of digits
        given = "a number too large"
    return InputError(f"{name}.{field[:60]}", f"{given}: {first['msg'][:120]}")
