"""Photon maps against path tracing and the gathering operator; each part kept as soon as it is there."""

from __future__ import annotations

from pathlib import Path

import caustic
import in_layers
import in_rooms

from prelight.checking.kept_parts import measure_parts, parts_parser

PARTS = {
    "caustic": caustic.glass_ball,
    "room": in_rooms.both_ways,
    "portal": in_rooms.portal,
    "sky": caustic.sky_layer,
    "portals": in_layers.portals,
    "cloud": in_layers.cloud,
}


def main() -> None:
    parser = parts_parser(__doc__, PARTS, work="where references are kept: some megabytes")
    parser.add_argument(
        "--small", action="store_true", help="in seconds, to see that it runs; nothing is kept"
    )
    options = parser.parse_intermixed_args()
    results = Path(__file__).parent / "results" / options.name
    options.work.mkdir(parents=True, exist_ok=True)
    measure_parts(
        PARTS,
        options.parts,
        results,
        call=lambda part: part(options.work, small=options.small),
        keep=not options.small,
    )


if __name__ == "__main__":
    main()
