"""Gloss for a free eye against the path tracer; each part kept as soon as it is there."""

from __future__ import annotations

from pathlib import Path

import accuracy

from prelight.checking.kept_parts import measure_parts, parts_parser

PARTS = accuracy.PARTS
KEPT = ("detail", "side", "samples", "pixels", "order", "resolution", "tolerance", "foot")


def main() -> None:
    parser = parts_parser(
        __doc__,
        PARTS,
        work="for bakes and pictures: some 100 megabytes",
        data="folder with bunny/; without it a ball is looked at",
    )
    parser.add_argument("--detail", type=float, default=0.5, help="1 for the bunny and the full room")
    parser.add_argument("--side", type=int, default=72, help="pixels of a picture's side")
    parser.add_argument(
        "--samples", type=int, default=18432, help="of the path tracer, a pixel; kept in pieces of 18,432"
    )
    parser.add_argument("--pixels", type=int, default=160, help="of the object that are compared, by chance")
    parser.add_argument("--order", type=int, default=8, help="of the harmonics")
    parser.add_argument("--tolerance", type=float, default=0.005, help="of the clusters")
    parser.add_argument("--resolution", type=int, default=64, help="R of the environment")
    parser.add_argument(
        "--foot", type=float, default=0.0, help="longest edges beneath the vase, metres; 0: its own"
    )
    options = parser.parse_intermixed_args()
    results = Path(__file__).parent / "results" / options.name
    options.work.mkdir(parents=True, exist_ok=True)
    for name in KEPT:
        setattr(accuracy.Settings, name, getattr(options, name))
    measure_parts(
        PARTS,
        options.parts,
        results,
        call=lambda part: part(options.data, options.work),
        more={"settings": {name: getattr(options, name) for name in KEPT}},
    )


if __name__ == "__main__":
    main()
