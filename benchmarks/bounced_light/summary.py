"""What the results of this benchmark say, as tables in Markdown."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

SCENES = ("cornell-lamp", "cornell-sky", "cornell-spheres", "room", "sponza", "sibenik")


def table(results: Path) -> str:
    """Of all parts whose results are there."""
    found = {path.stem: json.loads(path.read_text())["figures"] for path in sorted(results.glob("*.json"))}
    lines = [
        "| scene | vertices | area judged | mean of differences | of which noise | signed mean | detectable bias |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [_scene(name, found[name]) for name in SCENES if name in found]
    if "time" in found:
        lines += ["", _time(found["time"])]
    if "radiance" in found:
        lines += ["", _radiance(found["radiance"])]
    return "\n".join(lines)


def _scene(name: str, figures: dict[str, Any]) -> str:
    total = figures["judged"]["total"]
    share = [total[k] for k in ("mean_difference", "of_which_noise", "signed_mean", "detectable_bias")]
    cells = [f"{100 * x:+.2f} %" if k == 2 else f"{100 * x:.2f} %" for k, x in enumerate(share)]
    vertices = f"{figures['bake']['vertices']:,}"
    return " | ".join([f"| {name}", vertices, f"{100 * figures['area_judged']:.1f} %", *cells]) + " |"


def _time(figures: dict[str, Any]) -> str:
    wide, narrow = figures["seventy_five"], figures["three"]
    steps = ", ".join(f"{step} {seconds:.1f}" for step, seconds in wide["steps"].items())
    return (
        f"{figures['vertices']:,} vertices, 75 columns converged: {wide['seconds']:.0f} s ({steps}); "
        f"3 columns: {narrow['seconds']:.0f} s; ratio {figures['ratio']:.2f}."
    )


def _radiance(figures: dict[str, Any]) -> str:
    ours, theirs = (figures["against_path_tracer"][name] for name in ("ours", "radiance"))
    return (
        f"146 patches: {figures['radiance_over_ours']:.0f} times faster a point than `rfluxmtx`; "
        f"mean of differences {100 * ours['mean_difference']:.2f} % (signed {100 * ours['signed_mean']:+.2f} %) "
        f"beside {100 * theirs['mean_difference']:.2f} % ({100 * theirs['signed_mean']:+.2f} %)."
    )
