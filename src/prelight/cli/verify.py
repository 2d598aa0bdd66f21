"""``prelight verify``: every chunk against its hash."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from . import printing


def verify(bake: Path, /, *, json: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Check every chunk of a bake against its sha256; exit code 4 and the chunk's name if one differs.

    Parameters
    ----------
    bake
        NAME.prelight.
    json
        Print one JSON object on standard output.
    """
    from ..storage.bake import Bake

    started = time.perf_counter()
    sizes = [size for _, size in Bake.open(bake).verify()]
    seconds = time.perf_counter() - started
    if json:
        printing.say_json(
            {"path": str(bake), "chunks": len(sizes), "bytes": sum(sizes), "seconds": seconds, "whole": True}
        )
        return
    printing.say(
        f"{bake}: whole; {len(sizes)} chunks, {printing.size(sum(sizes))}, {printing.duration(seconds)}"
    )
