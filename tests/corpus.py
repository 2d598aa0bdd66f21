"""Hostile files one after another, each in a child of its own: what came of it, and what it cost and touched."""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from prelight.errors import InputError

_MOST_SECONDS = 20  # of waiting, on a busy machine; what counts is the processor's time
_FORBIDDEN = ("socket.", "subprocess.", "os.system", "os.exec", "os.posix_spawn", "pickle.", "ctypes.dlopen")


@dataclass(frozen=True)
class Outcome:
    """What a child did with a file."""

    kind: str  # "scene", "refused", "crashed"
    message: str
    seconds: float  # of processor time
    growth: int  # bytes of memory beyond what a child has that does nothing
    touched: tuple[str, ...]  # files opened outside the root, sockets, processes, imports


def _watch(root: Path, touched: list[str]) -> None:
    """Note every open outside ``root`` and whatever else a reader has no business with; for good."""
    inside = os.path.realpath(root) + "/"

    def hook(event: str, arguments: tuple) -> None:
        if event == "open" and isinstance(arguments[0], str | bytes):
            name = os.path.realpath(os.fsdecode(arguments[0]))
            if not name.startswith(inside):
                touched.append(f"open {name}")
        elif event == "import" or event.startswith(_FORBIDDEN):
            touched.append(f"{event} {arguments[0] if arguments else ''}")

    sys.addaudithook(hook)


def in_child(work: Callable[[], object], root: Path) -> Outcome:
    """Run ``work`` in a fork. A refusal is an InputError; any other exception, signal or delay is a crash."""
    back, forth = os.pipe()
    with warnings.catch_warnings():  # threads do not come along, and nothing here needs them
        warnings.simplefilter("ignore", DeprecationWarning)
        child = os.fork()
    if child == 0:
        _be_child(work, root, forth)
    os.close(forth)
    start = time.monotonic()
    while (ended := os.wait4(child, os.WNOHANG))[0] == 0:
        if time.monotonic() - start > _MOST_SECONDS:
            os.kill(child, signal.SIGKILL)
        time.sleep(0.001)
    with os.fdopen(back, "rb") as pipe:
        said = pipe.read()
    _, status, usage = ended
    if status != 0 or not said:
        return Outcome("crashed", f"status {status:#x}", usage.ru_utime + usage.ru_stime, 0, ())
    kind, message, seconds, touched = json.loads(said)
    return Outcome(kind, message, seconds, usage.ru_maxrss * 1024, tuple(touched))


def _be_child(work: Callable[[], object], root: Path, answer: int) -> None:
    code, touched = 1, []
    try:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        _watch(root, touched)
        start = time.process_time()
        try:
            work()
            kind, message = "scene", ""
        except InputError as error:
            kind, message = "refused", str(error)
        except BaseException as error:
            kind, message = "crashed", f"{type(error).__name__}: {error}"
        seconds = time.process_time() - start
        os.write(answer, json.dumps([kind, message, seconds, touched[:20]])[:60_000].encode())
        code = 0
    finally:
        os._exit(code)


def faults(outcome: Outcome, path: Path, idle: int) -> list[str]:
    """What breaks the promises about bad input; ``idle`` is the memory of a child that does nothing."""
    found = []
    if outcome.kind == "crashed":
        found.append(outcome.message)
    if outcome.seconds > 2:
        found.append(f"took {outcome.seconds:.1f} s")
    if outcome.growth - idle > 256 << 20:
        found.append(f"took {(outcome.growth - idle) >> 20} MB")
    if outcome.touched:
        found.append(f"touched {outcome.touched[0]}")
    if outcome.kind == "refused" and not _is_one_good_line(outcome.message, path):
        found.append(f"said {outcome.message!r}")
    return found


def _is_one_good_line(message: str, path: Path) -> bool:
    name = str(path) if len(str(path)) <= 140 else str(path)[-70:]
    return name in message and message.isprintable() and len(message) <= 300
