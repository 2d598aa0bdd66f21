"""PLY, the Stanford polygon format: text and both byte orders, polygons cut into triangles."""

from __future__ import annotations

import numpy as np

from ..mesh import MeshAsRead, UnreadableMesh, check_counts, linear_from_srgb
from .header import Element, Header, Property, read_header
from .records import Lists, read_elements

_LARGEST_TEXT = 1_000_000_000
_VERTEX_COLUMNS = {"x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"} | {
    "diffuse_red", "diffuse_green", "diffuse_blue"
}  # fmt: skip


def read_ply(data: bytes) -> MeshAsRead:
    """The mesh in a PLY file. Raises UnreadableMesh, or ValueError and its kin for damage."""
    header = read_header(data)
    vertex, face = _mesh_elements(header)
    check_counts(vertex.count, face.count)
    declared = {p.name: p for p in vertex.properties}
    if any(axis not in declared or declared[axis].count_type for axis in "xyz"):
        raise UnreadableMesh("the vertices need the properties x, y and z")
    corners = next((p for p in face.properties if p.name in ("vertex_indices", "vertex_index")), None)
    if corners is None or corners.count_type is None or corners.type[0] == "f":
        raise UnreadableMesh("the faces need 'property list uchar int vertex_indices'")

    body, encoding = _body(data, header)
    # A list may declare no corners at all; a mesh of such faces would take far more memory than its file.
    smallest = (
        32
        if encoding == "text"
        else np.dtype(corners.count_type).itemsize + 3 * np.dtype(corners.type).itemsize
    )
    if face.count * smallest > len(body):
        raise UnreadableMesh(
            f"damaged PLY file: the header declares {face.count:,} faces, the file holds fewer"
        )
    wanted = {"vertex": _VERTEX_COLUMNS, "face": {corners.name}}
    tables, rest = read_elements(body, header.elements, encoding, wanted=wanted)
    notes = []
    if rest and header.encoding == "text":
        raise UnreadableMesh(f"the body holds {rest:,} values more than the header declares")
    if rest:
        notes.append(f"bytes after the last element ignored: {rest:,}")
    if "red" in {p.name for p in face.properties}:
        notes.append("face colours not read: colour the vertices instead")
    plain = tables["vertex"].plain
    positions, normals = (_columns(plain, names) for names in (("x", "y", "z"), ("nx", "ny", "nz")))
    if positions is None:
        raise UnreadableMesh("no vertices: a mesh is needed")
    albedo = _albedo(plain, declared, notes)
    triangles = _fans(tables["face"].lists[corners.name], notes)
    return MeshAsRead(positions, triangles, normals, albedo, tuple(notes))


def _mesh_elements(header: Header) -> tuple[Element, Element]:
    elements = {element.name: element for element in header.elements}
    if "vertex" not in elements:
        raise UnreadableMesh("no vertex element: expected a PLY mesh")
    if "face" in elements and elements["face"].count:
        return elements["vertex"], elements["face"]
    if "tristrips" in elements and elements["tristrips"].count:
        raise UnreadableMesh("triangle strips are not read: convert the file to faces")
    raise UnreadableMesh("no triangles, only points: a mesh is needed")


def _columns(plain: dict[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray | None:
    if not all(name in plain for name in names):
        return None
    return np.stack([plain[name] for name in names], axis=1)


def _body(data: bytes, header: Header) -> tuple[np.ndarray, str]:
    """The body as bytes, and their order. Text becomes float64, so that one reader serves all three."""
    if header.encoding != "text":
        return np.frombuffer(data, np.uint8, offset=header.body), header.encoding
    if len(data) > _LARGEST_TEXT:
        raise UnreadableMesh(f"text of {len(data) / 1e6:.0f} MB: convert it to binary PLY")
    try:
        # Whitespace alone would be read as one made-up value.
        text = data[header.body :].strip()
        values = np.fromstring(text, np.float64, sep=" ") if text else np.empty(0)
    except ValueError:
        raise UnreadableMesh("damaged PLY file: the body holds something that is not a number") from None
    return values.view(np.uint8), "text"


def _albedo(
    plain: dict[str, np.ndarray], declared: dict[str, Property], notes: list[str]
) -> np.ndarray | None:
    """Linear colours (V, 3): integers are sRGB as displayed, floating-point numbers are taken as linear."""
    for prefix in ("", "diffuse_"):
        names = (prefix + "red", prefix + "green", prefix + "blue")
        colours = _columns(plain, names)
        if colours is not None:
            break
    else:
        return None
    kind = declared[names[0]].type
    if kind[0] == "f":
        notes.append("vertex colours given as floating-point numbers taken as linear")
        return colours
    return linear_from_srgb(colours / np.iinfo(kind).max)


def _fans(faces: Lists, notes: list[str]) -> np.ndarray:
    """Triangles (F, 3) of polygons: corner 0 with every following pair."""
    counts, corners = faces.counts, faces.values
    if corners.dtype.kind == "f" and not (np.isfinite(corners) & (corners == np.floor(corners))).all():
        raise UnreadableMesh("damaged PLY file: a vertex index is not a whole number")
    # Whatever does not fit into int32 is far out of range, and stays so.
    corners = np.clip(corners, -1, 2**31 - 1).astype(np.int32)
    if few := int((counts < 3).sum()):
        notes.append(f"faces with fewer than three corners dropped: {few:,}")
    if many := int((counts > 3).sum()):
        notes.append(
            f"faces with more than three corners cut into triangles from their first corner: {many:,}"
        )
    if not few and not many:
        return corners.reshape(-1, 3)
    each = np.maximum(counts - 2, 0)
    check_counts(0, int(each.sum()))
    first = np.repeat(np.cumsum(counts) - counts, each)
    second = np.arange(len(first)) - np.repeat(np.cumsum(each) - each, each) + first + 1
    return np.stack([corners[first], corners[second], corners[second + 1]], axis=1)
