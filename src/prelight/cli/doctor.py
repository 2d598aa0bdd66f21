"""``prelight doctor``: what this machine has, and how fast it is."""

from __future__ import annotations

import ctypes
import sys
from typing import Annotated, Any

from cyclopts import Parameter

from ..errors import PrelightError
from . import printing


def doctor(*, json: Annotated[bool, Parameter(negative="")] = False) -> None:
    """Say what this machine has for Prelight, how fast it traces and reads memory, and what is missing.

    Parameters
    ----------
    json
        Print one JSON object on standard output.
    """
    with printing.waiting("measuring"):
        from ..checking.machine import llvm, machine

        found = machine() | llvm() | _speeds()
    if json:
        printing.say_json(found)
        return
    mega = (
        f"{found['vertex_directions_per_second'] / 1e6:.0f} M vertex-directions/s"
        if found["can_bake"]
        else "no"
    )
    printing.table(
        [
            ("system", found["system"]),
            ("python", found["python"]),
            ("processors", f"{found['processors']}, {printing.size(found['memory'])} of memory"),
            (
                "packages",
                ", ".join(f"{name} {number or 'missing'}" for name, number in found["packages"].items()),
            ),
            (
                "libLLVM",
                f"{found['llvm_version']} at {found['llvm_path']}"
                if found["llvm_path"]
                else "none that works",
            ),
            ("threads", f"{found['threads']}, by {found['threading_layer']}"),
            ("memory is read at", f"{found['read_bytes_per_second'] / 1e9:.1f} GB/s"),
            ("relights", "yes"),
            ("bakes", f"{mega}{', ' + found['variant'] if found['variant'] else ''}"),
            *(("to do", advice) for advice in found["advice"]),
        ]
    )


def _speeds() -> dict[str, Any]:
    import numba

    from ..checking.machine import read_bandwidth, tracing_speed

    advice = (
        []
        if sys.platform != "linux" or _loads("libatomic.so.1")
        else [_install("libatomic1", "to trace rays")]
    )
    figures: dict[str, Any] = {"read_bytes_per_second": read_bandwidth()}
    figures |= {"threads": numba.get_num_threads(), "threading_layer": numba.threading_layer()}
    if sys.platform == "linux" and not _loads("libgomp.so.1") and figures["threading_layer"] == "workqueue":
        advice.append(
            "install libgomp, so that several threads may relight: sudo apt-get install -y libgomp1"
        )
    try:
        speed, variant = tracing_speed()
        figures |= {"can_bake": True, "variant": variant, "vertex_directions_per_second": speed}
    except PrelightError as error:
        figures |= {"can_bake": False, "variant": None, "vertex_directions_per_second": None}
        advice.append(str(error))
    return figures | {"advice": advice}


def _install(package: str, purpose: str) -> str:
    return f"install {package} {purpose}: sudo apt-get install -y {package}"


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True
