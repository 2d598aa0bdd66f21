"""Write the small bad inputs of this folder anew, and INDEX.jsonl: the reason that each must be refused with.

Run it as ``python -m tests.bad.make``. A reason of null: the file is read, and its notes say what is amiss.
Every bug in a reader adds the file that showed it.
"""

from __future__ import annotations

import json
import struct
import zlib
from pathlib import Path

HERE = Path(__file__).resolve().parent
SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
_PLY = b"ply\nformat %s 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
_FACE = b"element face 1\nproperty list uint int vertex_indices\nend_header\n"


def _chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png(width: int, height: int, rows: bytes) -> bytes:
    """A PNG of 8-bit RGB whatever its rows hold."""
    header = _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + _chunk(b"IDAT", zlib.compress(rows, 9)) + _chunk(b"IEND", b"")


def _glb(text: bytes, length: int | None = None) -> bytes:
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, length or 20 + len(text), len(text), 0x4E4F534A) + text


def _textured(library: bytes) -> dict[str, bytes]:
    scene = b"mtllib scene.mtl\n" + SQUARE + b"usemtl m\nf 1/1 2/2 3/3\n"
    return {"scene.obj": scene, "scene.mtl": b"newmtl m\n" + library}


# Folder: its files, of which scene.* is read, and the reason of the refusal (or of a note, after "note:").
CASES: dict[str, tuple[dict[str, bytes], str]] = {
    "obj-index-beyond": ({"scene.obj": SQUARE + b"f 1 2 2147483647\n"}, "index 2,147,483,647 of a vertex"),
    "obj-index-overflow": ({"scene.obj": SQUARE + b"f 1 2 18446744073709551617\n"}, "of a vertex"),
    "obj-index-negative": ({"scene.obj": SQUARE + b"f -1 -2 -9223372036854775808\n"}, "of a vertex"),
    "obj-index-zero": ({"scene.obj": SQUARE + b"f 0 1 2\n"}, "index 0 of a vertex"),
    "obj-not-finite": ({"scene.obj": SQUARE + b"v inf 0 0\nf 1 2 5\n"}, "a coordinate is not finite"),
    "obj-not-a-number": ({"scene.obj": b"v 0 0 -1.#IND\nf 1 1 1\n"}, "'-1.#IND' is no number"),
    "obj-too-few-numbers": ({"scene.obj": b"v 0\nf 1 1 1\n"}, "1 numbers, expected at least 3"),
    "obj-byte-zero": ({"scene.obj": SQUARE + b"f 1 2\0 3\n"}, "holds a byte 0"),
    "obj-utf-16": ({"scene.obj": "v 0 0 0\nf 1 1 1\n".encode("utf-16")}, "UTF-16"),
    "obj-no-face": ({"scene.obj": SQUARE + b"l 1 2\np 1\nf 1 2\n"}, "no faces"),
    "obj-one-place": ({"scene.obj": b"v 1 1 1\nf 1 1 1 1 1\n"}, "every triangle has zero area"),
    "obj-terminal-escape": ({"scene.obj": b"v \x1b]0;gone\x07 0 0\nf 1 1 1\n"}, "is no number"),
    "obj-crosses-itself": ({"scene.obj": SQUARE + b"f 1 3 2 4\nf 1 2 3 4 1 2 3 4\n"}, "note:triangles of zero area"),
    "mtl-outside": ({"scene.obj": b"mtllib ../make.py\n" + SQUARE + b"f 1 2 3\n"}, "note:leads out of the folder"),
    "mtl-address": ({"scene.obj": b"mtllib http://[::1]/a.mtl\n" + SQUARE + b"f 1 2 3\n"}, "note:no address"),
    "mtl-itself": ({"scene.obj": b"mtllib scene.obj\n" + SQUARE + b"usemtl m\nf 1 2 3\n"}, "note:holds no material"),
    "mtl-numbers": (_textured(b"Kd nan 1e999 x\nNs\nd -inf\nillum 1e300\nKe -1\n"), "note:Kd without numbers"),
    "texture-outside": (_textured(b"map_Kd ..\\..\\conftest.py\n"), "note:leads out of the folder"),
    "texture-options": (_textured(b"map_Kd -s -o -mm 1\n"), "note:-mm of a map"),
    "texture-bomb": (_textured(b"map_Kd t.png\n") | {"t.png": png(60_000, 60_000, bytes(9))}, "note:60,000×60,000"),
    "texture-lie": (_textured(b"map_Kd t.png\n") | {"t.png": png(8_000, 8_000, bytes(9))}, "note:claims 8,000"),
    "texture-short": (_textured(b"map_Kd t.png\n") | {"t.png": png(9, 9, bytes(9))}, "note:truncated"),
    "texture-no-picture": (_textured(b"map_Kd t.png\n") | {"t.png": b"GIF89a"}, "note:neither PNG nor JPEG"),
    "ply-count-of-list": (
        {"scene.ply": _PLY % b"binary_little_endian" + _FACE + bytes(36) + struct.pack("<I", 0xFFFFFFF0)},
        "does not fit into the file",
    ),
    "ply-index": ({"scene.ply": _PLY % b"ascii" + _FACE + b"0 0 0 1 0 0 0 1 0\n3 0 1 7\n"}, "uses vertex 7"),
    "ply-negative-count": ({"scene.ply": b"ply\nformat ascii 1.0\nelement vertex -5\nend_header\n"}, "count '-5'"),
    "glb-length": ({"scene.glb": _glb(b"{}", 0x7FFFFFFF)}, "declares 2,147,483,647 bytes"),
    "glb-header": ({"scene.glb": b"glTF\2\0\0"}, "7 bytes"),
    "gltf-cycle": (
        {"scene.gltf": b'{"asset":{"version":"2.0"},"nodes":[{"children":[0]}],"scenes":[{"nodes":[0]}],"scene":0}'},
        "its own ancestor",
    ),
    "gltf-deep": ({"scene.gltf": b'{"asset":' + b"[" * 500 + b"]" * 500 + b"}"}, "nested deeper than 64"),
    "xml-not-trusted": ({"scene.xml": b'<scene version="3.0.0"><bsdf type="../../evil"/></scene>'}, "--trust"),
    "off": ({"scene.off": b"OFF\n3 1 0\n"}, "OFF is not read: convert it"),
}  # fmt: skip


def write(folder: Path) -> None:
    """All files of the folder and its index."""
    lines = []
    for name, (files, reason) in CASES.items():
        for file, content in files.items():
            (folder / name).mkdir(parents=True, exist_ok=True)
            (folder / name / file).write_bytes(content)
        scene = next(file for file in files if file.startswith("scene.") and not file.endswith(".mtl"))
        said = {"note": reason[5:]} if reason.startswith("note:") else {"refused": reason}
        lines.append(json.dumps({"path": f"{name}/{scene}", **said}, ensure_ascii=False))
    (folder / "INDEX.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write(HERE)
