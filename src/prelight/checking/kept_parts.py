"""A benchmark in parts, each kept as JSON as soon as it is there, with the machine it was measured on."""

from __future__ import annotations

import argparse
import json
import platform
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from .machine import llvm, machine

Part = Callable[..., dict[str, Any]]


def parts_parser(
    description: str | None, parts: Mapping[str, Part], *, work: str, data: str | None = None
) -> argparse.ArgumentParser:
    """The options that every benchmark in parts has.

    ``work`` says what is kept in its folder, ``data`` what the folder of given files holds, if there is one.
    """
    parser = argparse.ArgumentParser(description=description)
    if data is not None:
        parser.add_argument("data", type=Path, help=data)
    parser.add_argument("parts", nargs="*", choices=[*parts, []], help="all that have no result yet, if none")
    parser.add_argument("--work", type=Path, required=True, help=work)
    parser.add_argument("--name", default="2-core", help="of this machine, in the results")
    return parser


def measure_parts(
    parts: Mapping[str, Part],
    wanted: Sequence[str],
    results: Path,
    *,
    call: Callable[[Part], dict[str, Any]],
    keep: bool = True,
    more: Mapping[str, Any] | None = None,
) -> None:
    """Measure parts one after the other, and print and keep what each says in ``results``/NAME.json.

    Parameters
    ----------
    wanted
        Names; if there are none, all parts that have no result yet.
    call
        Calls a part. Figures with "skipped" among them are printed and not kept.
    keep
        False for a trial.
    more
        What else a report says, such as settings.
    """
    for name in wanted or parts:
        path = results / f"{name}.json"
        if path.exists() and not wanted:
            continue
        what = _said_of(parts[name])
        sys.stdout.write(f"== {name}: {what.splitlines()[0] if what else ''}\n")
        sys.stdout.flush()
        started = time.perf_counter()
        figures = call(parts[name])
        report = {
            "what": what,
            "machine": machine() | {"python": platform.python_version(), "llvm": llvm()},
            **(more or {}),
            "seconds_in_all": round(time.perf_counter() - started, 1),
            "figures": figures,
        }
        text = json.dumps(report, indent=1, ensure_ascii=False, default=float)
        sys.stdout.write(text + "\n")
        sys.stdout.flush()
        if keep and "skipped" not in figures:
            results.mkdir(parents=True, exist_ok=True)
            path.write_text(text + "\n")


def _said_of(part: Part) -> str:
    own = part.func if isinstance(part, partial) else part
    return own.__doc__ or ""
