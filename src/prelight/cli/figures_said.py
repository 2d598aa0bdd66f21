"""What ``prelight compare`` says of its figures."""

from __future__ import annotations

from typing import Any

from . import printing

_WORDS = (
    ("relative_rms", "relative RMS error"),
    ("mean_difference", "mean |difference| / mean"),
    ("signed_mean", "mean difference / mean"),
    ("worst", "largest difference / mean"),
    ("noise", "RMS from the reference's noise"),
    ("detectable_bias", "detectable mean difference"),
)


def say_figures(figures: dict[str, Any]) -> None:
    """The figures in words."""
    samples, bias = figures["samples"], figures["detectable_bias"]
    against = "exact integration" if samples is None else f"the path tracer, {samples:,} samples"
    printing.say(
        f"{figures['receivers']:,} receivers against {against} ({figures['reference_seconds']:.1f} s)"
    )
    for name, words in _WORDS:
        if samples is not None or name not in ("noise", "detectable_bias"):
            printing.say(f"  {words:32} {100 * figures[name]:8.3f} %")
    if samples is not None:
        found = abs(figures["signed_mean"]) > bias
        printing.say(
            "the means differ by more than noise explains"
            if found
            else "no difference of the means that so many samples can tell from noise"
        )
