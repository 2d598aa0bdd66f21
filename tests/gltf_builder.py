"""glTF files made piece by piece, so that every answer is known."""

from __future__ import annotations

import base64
import io
import json
import re
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from prelight.errors import InputError
from prelight.scene.geometry import Scene
from prelight.scene.loading import load_scene

CODES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], "f4")
# Rows from the top; every texel a colour of its own.
RED, GREEN, BLUE, GREY = (255, 0, 0), (0, 255, 0), (0, 0, 255), (128, 64, 32)
QUARTERS = np.array([[RED, GREEN], [BLUE, GREY]], np.uint8)
MIDDLES = np.array([(0.25, 0.25), (0.75, 0.25), (0.25, 0.75)], "f4")  # of the red, green and blue texel


class Glb:
    """A document and its binary chunk, growing together."""

    def __init__(self) -> None:
        self.json: dict = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "materials": [], "buffers": [{"byteLength": 0}],
        }  # fmt: skip
        self.binary = b""

    def accessor(self, array: np.ndarray, **more: object) -> int:
        array = np.ascontiguousarray(array)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": array.nbytes}
        self.json["bufferViews"].append(view)
        self.binary += array.tobytes() + bytes(-array.nbytes % 4)
        self.json["buffers"][0]["byteLength"] = len(self.binary)
        width = WIDTHS[1 if array.ndim == 1 else array.shape[1]]
        view_index = len(self.json["bufferViews"]) - 1
        self.json["accessors"].append(
            {"bufferView": view_index, "componentType": CODES[array.dtype.str[1:]], "count": len(array),
             "type": width, **more}
        )  # fmt: skip
        return len(self.json["accessors"]) - 1

    def primitive(self, positions: np.ndarray = TRIANGLE, **more: object) -> dict:
        """Keys in capitals are attributes."""
        attributes = {"POSITION": self.accessor(positions)} | {k: v for k, v in more.items() if k.isupper()}
        return {"attributes": attributes} | {k: v for k, v in more.items() if not k.isupper()}

    def node(self, *primitives: dict, root: bool = True, **more: object) -> int:
        if primitives:
            self.json["meshes"].append({"primitives": list(primitives)})
            more["mesh"] = len(self.json["meshes"]) - 1
        self.json["nodes"].append(more)
        if root:
            self.json["scenes"][0]["nodes"].append(len(self.json["nodes"]) - 1)
        return len(self.json["nodes"]) - 1

    def material(self, **more: object) -> int:
        self.json["materials"].append(more)
        return len(self.json["materials"]) - 1

    def texture(self, picture: np.ndarray, sampler: dict | None = None) -> int:
        """A texture of (H, W, 3) bytes, its PNG in the binary chunk."""
        for kind in ("textures", "images", "samplers"):
            self.json.setdefault(kind, [])
        view = self.accessor(np.frombuffer(png(picture), "u1"))
        view = self.json["accessors"].pop(view)["bufferView"]
        self.json["images"].append({"bufferView": view, "mimeType": "image/png"})
        texture = {"source": len(self.json["images"]) - 1}
        if sampler is not None:
            self.json["samplers"].append(sampler)
            texture["sampler"] = len(self.json["samplers"]) - 1
        self.json["textures"].append(texture)
        return len(self.json["textures"]) - 1

    def document(self) -> dict:
        """A copy, without the lists that stayed empty."""
        return json.loads(json.dumps({k: v for k, v in self.json.items() if v != []}))

    def bytes(self) -> bytes:
        return container(json.dumps(self.document()).encode(), self.binary)

    def text(self, uri: str | None = None) -> bytes:
        """The same as a .gltf, its buffer in the file that ``uri`` names, or written into the JSON."""
        uri = data_uri(self.binary) if uri is None else uri
        return json.dumps(
            self.document() | {"buffers": [{"byteLength": len(self.binary), "uri": uri}]}
        ).encode()


def data_uri(data: bytes, kind: str = "application/octet-stream") -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def png(picture: np.ndarray) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.asarray(picture, np.uint8)).save(file, "PNG")
    return file.getvalue()


def container(text: bytes, binary: bytes = b"") -> bytes:
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def load_bytes(folder: Path, content: bytes) -> Scene:
    path = folder / ("mesh.glb" if content[:4] == b"glTF" else "mesh.gltf")
    path.write_bytes(content)
    return load_scene(path)


def refused(load: Callable[[bytes], Scene], content: bytes) -> str:
    with pytest.raises(InputError) as caught:
        load(content)
    message = str(caught.value)
    assert re.fullmatch(r"\S*mesh\.\w+: .+", message)
    assert len(message) <= 300
    return message


def valid() -> Glb:
    glb = Glb()
    part = glb.primitive(TRIANGLE)
    part["indices"] = glb.accessor(np.array([0, 1, 2], "u2"))
    glb.node(part)
    return glb


def textured(
    info: dict | None = None, *, uv: np.ndarray = MIDDLES, sampler: dict | None = None, **pbr
) -> Glb:
    """One triangle under `QUARTERS`, its corners at ``uv``."""
    glb = Glb()
    texture = glb.texture(QUARTERS, sampler)
    material = glb.material(
        pbrMetallicRoughness={"metallicFactor": 0, "baseColorTexture": {"index": texture} | (info or {})}
        | pbr
    )
    glb.node(glb.primitive(material=material, TEXCOORD_0=glb.accessor(np.asarray(uv, "f4"))))
    return glb
