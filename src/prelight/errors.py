"""Every error a user can meet: what was given, what was expected, what to do.

Each class also derives from a builtin, so callers may catch either, and carries
the exit code the command line documents.
"""

from __future__ import annotations

_LONGEST_MESSAGE = 290  # with the program's name before it, 300
_LONGEST_NAME = 140


def escaped(text: str) -> str:
    """Control characters as escapes, so that a hostile name cannot steer a terminal."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def printable(text: object) -> str:
    """One line without control characters, cut where it becomes too long to read."""
    line = escaped(str(text)[: _LONGEST_MESSAGE + 1])  # a name or value from a file may be megabytes
    return line if len(line) <= _LONGEST_MESSAGE else line[: _LONGEST_MESSAGE - 1] + "…"


def _short(path: object) -> str:
    """A name with its middle left out if it is long: the reason behind it must stay readable."""
    name = str(path)
    half = _LONGEST_NAME // 2
    return name if len(name) <= _LONGEST_NAME else f"{name[: half - 1]}…{name[-half:]}"


def _with_place(message: str, where: str | None) -> str:
    """The place stays readable however long what is said before it: it is what somebody looks for."""
    place = printable(f" ({_short(where)})") if where else ""
    line = printable(message)
    room = _LONGEST_MESSAGE - len(place)
    return (line if len(line) <= room else line[: room - 1] + "…") + place


class PrelightError(Exception):
    """Base of all errors that Prelight raises on purpose."""

    exit_code = 1


class InputError(PrelightError, ValueError):
    """A file or value from the user cannot be used.

    Parameters
    ----------
    path
        The file, or the name of the option or argument.
    reason
        What was given, what was expected, what to do.
    where
        Line, byte offset or JSON pointer inside the file, if known.
    """

    exit_code = 2

    def __init__(self, path: object, reason: str, where: str | None = None) -> None:
        self.path, self.reason, self.where = path, reason, where
        super().__init__(_with_place(f"{_short(path)}: {reason}", where))


class MissingExtraError(PrelightError, ImportError):
    """An optional dependency is needed; the message names the one command that brings it."""

    exit_code = 2

    def __init__(self, message: str) -> None:
        super().__init__(printable(message))


class OutputError(PrelightError, OSError):
    """Reading or writing failed: disk full, no permission, an existing output."""

    exit_code = 3

    def __init__(self, path: object, reason: str) -> None:
        self.path, self.reason = path, reason
        super().__init__(printable(f"{_short(path)}: {reason}"))


class DamagedBakeError(PrelightError, ValueError):
    """A bake is incomplete, altered or made by an unknown format version."""

    exit_code = 4

    def __init__(self, path: object, reason: str) -> None:
        self.path, self.reason = path, reason
        super().__init__(printable(f"{_short(path)}: {reason}"))


class InterruptedBakeError(PrelightError, RuntimeError):
    """A bake was stopped by a signal; what is done is kept and can be resumed."""

    exit_code = 130

    def __init__(self, path: object, reason: str, exit_code: int = 130) -> None:
        self.path, self.reason, self.exit_code = path, reason, exit_code
        super().__init__(printable(f"{_short(path)}: {reason}"))
