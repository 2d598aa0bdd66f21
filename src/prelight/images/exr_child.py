"""Decodes one part of an OpenEXR file: a program of its own, run in a process of its own.

Native decoders have been brought down by damaged files again and again; here that ends this process
and nothing else. It is started as a script, so that nothing of Prelight (nor Numba, nor Mitsuba) is
imported. The one argument is a JSON object, see ``openexr.py``; pixels go to an open file, nothing is
printed, and the exit status tells the rest.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys

DAMAGED, OUT_OF_MEMORY, NO_DECODER, CANNOT_WRITE = 3, 4, 5, 6
_PIXELS_PER_BLOCK = 1 << 20


def _limit(memory: int, seconds: int, size: int) -> None:
    """Take away what a decoder does not need: memory, time, files, core dumps."""
    try:
        import resource
    except ImportError:  # no such limits on this system; the deadline remains
        return
    limits = {"RLIMIT_AS": memory, "RLIMIT_CPU": seconds, "RLIMIT_FSIZE": size, "RLIMIT_CORE": 0}
    for name, wanted in limits.items():
        with contextlib.suppress(AttributeError, ValueError, OSError):  # some systems refuse or lack one
            which = getattr(resource, name)
            hard = resource.getrlimit(which)[1]
            value = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
            resource.setrlimit(which, (value, value))


def _decode(job: dict) -> None:
    import numpy as np
    import OpenEXR

    OpenEXR.setMaxImageSize(job["max_side"], job["max_side"])
    OpenEXR.setMaxTileSize(job["max_side"], job["max_side"])
    file = OpenEXR.File(f"/dev/fd/{job['source']}", separate_channels=True, num_threads=job["threads"])
    if len(file.parts) != job["parts"]:  # the library drops parts that it cannot decode
        raise ValueError("a part is damaged")
    channels = [file.parts[job["part"]].channels[name].pixels for name in job["channels"]]
    if any(channel.shape != tuple(job["shape"]) for channel in channels):
        raise ValueError("another size than the header says")
    top, left, height, width = job["crop"]
    rows = max(1, _PIXELS_PER_BLOCK // width)
    for first in range(top, top + height, rows):
        block = np.empty((min(rows, top + height - first), width, 3), np.float32)
        for k in range(3):  # one channel, Y, serves all three
            block[..., k] = channels[k % len(channels)][first : first + len(block), left : left + width]
        view = block.data.cast("B")
        while view:
            view = view[os.write(job["target"], view) :]


def main() -> int:
    job = json.loads(sys.argv[1])
    _limit(job["memory"], job["seconds"], job["crop"][2] * job["crop"][3] * 12)
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"  # threads would reserve memory
    try:
        _decode(job)
    except ImportError:
        return NO_DECODER
    except MemoryError:
        return OUT_OF_MEMORY
    except OSError as error:
        return CANNOT_WRITE if error.errno else DAMAGED
    except BaseException:
        return DAMAGED
    return 0


if __name__ == "__main__":
    os._exit(main())  # no clean-up: it could only crash
