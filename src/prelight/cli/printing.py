"""What the commands print: JSON for programs, tables and progress for people."""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from ..errors import escaped

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping


def say(text: str) -> None:
    """Lines for a person, on standard output; whatever names are in them, a terminal stays as it is."""
    sys.stdout.write("".join(escaped(line) + "\n" for line in text.split("\n")))


def say_json(values: dict[str, Any]) -> None:
    """One object on standard output."""
    say(json.dumps(values, indent=2, allow_nan=False))


def size(count: float) -> str:
    """Bytes in words."""
    for unit, scale in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if count >= scale:
            return f"{count / scale:.3g} {unit}"
    return f"{int(count)} bytes"


def count(number: float) -> str:
    """Large numbers in words: 3.51 million."""
    for word, scale in (("billion", 1e9), ("million", 1e6)):
        if number >= scale:
            return f"{number / scale:.3g} {word}"
    return f"{number:,.0f}"


def duration(seconds: float) -> str:
    """Seconds in words."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"


def table(rows: list[tuple[str, str]]) -> None:
    """Two columns, aligned."""
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        say(f"{name:<{width}}  {escaped(value)}")


# Where there is no terminal to draw a bar on: a line now and then, once it takes long.
_LINE_EVERY = 0.1  # of the work
_SILENCE = 10.0  # seconds
_TOLD_EVERY = 0.2  # seconds, where a program reads along


@contextmanager
def waiting(label: str) -> Generator[None]:
    """A moving line on standard error while something takes a while that cannot be measured."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(f"{label} …"):
        yield


@contextmanager
def share_bar(label: str) -> Generator[Callable[[float], None]]:
    """A bar on standard error; the yielded function takes the share done, 0 to 1."""
    began = time.monotonic()
    with _bar(label) as show:

        def report(share: float) -> None:
            left = (time.monotonic() - began) * (1 - share) / share if share > 0 else 0.0
            show(share, f"{duration(left)} left" if 0 < share < 1 else "")

        yield report


@contextmanager
def progress_bar(label: str) -> Generator[Callable[[float, float, int], None]]:
    """A bar on standard error; the yielded function takes fraction, seconds left and clusters."""
    with _bar(label) as show:

        def report(fraction: float, seconds_left: float, clusters: int) -> None:
            left = f", {duration(seconds_left)} left" if fraction < 1 else ""
            show(fraction, f"{clusters:,} clusters{left}")

        yield report


@contextmanager
def _bar(label: str) -> Generator[Callable[[float, str], None]]:
    """A bar; where there is no terminal a line now and then, once it takes long; for a program lines of JSON."""
    if os.environ.get("PRELIGHT_PROGRESS") == "json":
        yield _told()
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

    columns = [
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[note]}"),
    ]
    console = Console(stderr=True)
    shown, began = 0.0, time.monotonic()
    with Progress(*columns, console=console, disable=not console.is_terminal) as progress:
        task = progress.add_task(label, total=1.0, note="")

        def show(fraction: float, note: str) -> None:
            progress.update(task, completed=fraction, note=note)
            nonlocal shown
            late = time.monotonic() - began > _SILENCE
            if late and not console.is_terminal and fraction - shown >= _LINE_EVERY:
                shown = fraction
                sys.stderr.write(f"{label}: {fraction:.0%}, {note}\n")

        yield show


def _told() -> Callable[[float, str], None]:
    """Lines ``{"progress": SHARE, "note": WORDS}`` on standard error, a few a second."""
    last = 0.0

    def show(fraction: float, note: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _TOLD_EVERY or fraction >= 1:
            last = now
            sys.stderr.write(json.dumps({"progress": round(float(fraction), 5), "note": note}) + "\n")
            sys.stderr.flush()

    return show


def mesh_note(found: Mapping[str, Any]) -> str:
    """What is to be said of a mesh that does not hold its light, from a layer's statistics; else nothing."""
    if "bounced_edge" not in found:
        return ""
    return (
        f"too coarse for an even sky's light on {1 - found['bounced_held']:.0%} of the area; "
        f"--subdivide {found['bounced_edge']:.2g} would hold it nearly everywhere"
    )
