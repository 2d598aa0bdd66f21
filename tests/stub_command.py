"""Stands in for ``prelight`` beside a studio in tests: quick, and as slow or hostile as asked.

``python stub_command.py FOLDER PARENT DEVICE arguments…``; a bake of kind K waits until FOLDER/go is there.
"""

import json
import signal
import sys
import time
from pathlib import Path

folder, _, device, *arguments = sys.argv[1:]
go = Path(folder) / "go"
signal.signal(
    signal.SIGINT, lambda *_: (sys.stderr.write("prelight: stopped with half kept\n"), sys.exit(130))
)
if arguments[0] == "look":
    if "hostile" in arguments[1]:
        sys.stderr.write("prelight: \x1b[31m" + arguments[1] + ": <img src=x onerror=alert(1)>\n")
        sys.exit(2)
    print(
        json.dumps({"vertices": 10, "triangles": 9, "windows": 0, "devices": ["cpu"], "notes": []}),
        flush=True,
    )
    for line in sys.stdin:
        print(json.dumps({"passes": int(line)}), flush=True)
elif "--dry-run" in arguments:
    print(json.dumps({"rays": 1000, "seconds": 4.0, "bytes": 5000, "memory": 6000}))
else:
    target = Path(arguments[arguments.index("-o") + 1])
    partial = target.with_name(target.name + ".partial")
    partial.mkdir(exist_ok=True)
    done = 5 if (partial / "half").exists() else 0
    while done < 10:
        done = min(done + 1, 5 if not go.exists() else 10)
        (partial / "new").write_text(device)
        (partial / "new").rename(partial / "half")
        sys.stderr.write(json.dumps({"progress": done / 10, "note": ""}) + "\n")
        sys.stderr.flush()
        time.sleep(0.02)
    (partial / "half").unlink()
    partial.rename(target)
    print("{}")
