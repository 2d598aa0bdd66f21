"""What every kind of bake does around its work: room on the disk, the journal, the rename at the end."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import InterruptedBakeError, OutputError
from ..storage.bake import Bake
from ..storage.journal import BakeWriter, partial_folder
from ..storage.manifest import Manifest

_MARGIN = 1.1  # the plan is an estimate


def check_disk(path: Path, needed: float) -> None:
    """Raises OutputError if so many bytes will not fit: better before hours of rays than after."""
    try:
        free = shutil.disk_usage(path.absolute().parent).free
        kept = sum(file.stat().st_size for file in partial_folder(path).rglob("*") if file.is_file())
    except (OSError, ValueError):
        return  # what is wrong with the folder is said where it is written to
    if free + kept < _MARGIN * needed:
        reason = f"about {needed / 1e6:,.0f} MB will be written and {free / 1e6:,.0f} MB are free"
        raise OutputError(path, reason + "; free some space or choose another disk")


def carry_out(
    path: Path,
    make: Callable[[BakeWriter], Manifest],
    *,
    identity: dict[str, Any],
    kept: Callable[[list[dict[str, Any]]], str],
    resume: bool,
    force: bool,
) -> Bake:
    """Publish what ``make`` writes, or what a stopped bake had already written.

    ``identity`` is all that its bytes depend on; ``kept`` says in a few words what the journal's entries hold. Raises
    as ``BakeWriter``, and InterruptedBakeError at Ctrl-C.
    """
    writer = BakeWriter(path, settings=identity, resume=resume, force=force)
    started, earlier = time.perf_counter(), sum(entry.get("seconds", 0.0) for entry in writer.entries)
    try:
        writer.publish(writer.complete or make(writer))
    except KeyboardInterrupt as stop:
        reason = f"stopped with {kept(writer.entries)} kept; run the same command with --resume to go on"
        raise InterruptedBakeError(path, reason) from stop
    finally:
        writer.close()
    bake = Bake.open(path)
    bake.note_seconds(earlier + time.perf_counter() - started)
    return bake
