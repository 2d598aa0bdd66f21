"""The part of a glTF 2.0 document that a bake reads, checked as it is parsed."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import FailFast, Field, ValidationError

from ..mesh import UnreadableMesh, short_name
from .appearance import Image, Sampler, Surface, Texture
from .fields import MOST_ITEMS, Count, Index, Limit, Matrix, Names, Part, Quad, Unread, Vector

AttributeIndices = Annotated[dict[str, Index], Field(max_length=1000)]


class Asset(Part):
    version: str


class Buffer(Part):
    byteLength: Count
    uri: str | None = None


class BufferView(Part):
    buffer: Index
    byteOffset: Index = 0
    byteLength: Count
    byteStride: Annotated[int, Field(ge=4, le=252, multiple_of=4)] | None = None


class SparseIndices(Part):
    bufferView: Index
    byteOffset: Index = 0
    componentType: Literal[5121, 5123, 5125]


class SparseValues(Part):
    bufferView: Index
    byteOffset: Index = 0


class Sparse(Part):
    """Entries of an accessor that differ from its bufferView, or from zero."""

    count: Count
    indices: SparseIndices
    values: SparseValues


class Accessor(Part):
    bufferView: Index | None = None
    byteOffset: Index = 0
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    normalized: bool = False
    count: Count
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Sparse | None = None


class PrimitiveExtensions(Part):
    KHR_draco_mesh_compression: Any = None


class Primitive(Part):
    attributes: AttributeIndices
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = 4
    targets: Any = None
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class Mesh(Part):
    primitives: Annotated[list[Primitive], FailFast(), Field(min_length=1, max_length=MOST_ITEMS)]


class Instancing(Part):
    """`EXT_mesh_gpu_instancing`: accessors of TRANSLATION, ROTATION and SCALE."""

    attributes: Annotated[AttributeIndices, Field(min_length=1)]


class Visibility(Part):
    visible: bool = True


class NodeExtensions(Part):
    EXT_mesh_gpu_instancing: Instancing | None = None
    KHR_lights_punctual: Any = None
    KHR_node_visibility: Visibility = Visibility()


class Node(Part):
    name: str = ""
    mesh: Index | None = None
    camera: Index | None = None
    children: Annotated[list[Index], FailFast(), Limit] = Field(default_factory=list)
    matrix: Matrix | None = None
    translation: Vector | None = None
    rotation: Quad | None = None
    scale: Vector | None = None
    skin: Index | None = None
    extensions: NodeExtensions = NodeExtensions()


class Perspective(Part):
    yfov: Annotated[float, Field(gt=0)]  # radians


class Camera(Part):
    name: str = ""
    type: Literal["perspective", "orthographic"]
    perspective: Perspective | None = None


class SceneRoots(Part):
    """An entry of `scenes`."""

    nodes: Annotated[list[Index], FailFast(), Limit] = Field(default_factory=list)


class Document(Part):
    """Indices are not yet compared with the lists that they point into."""

    asset: Asset
    extensionsUsed: Names = Field(default_factory=list)
    extensionsRequired: Names = Field(default_factory=list)
    buffers: Annotated[list[Buffer], FailFast(), Limit] = Field(default_factory=list)
    bufferViews: Annotated[list[BufferView], FailFast(), Limit] = Field(default_factory=list)
    accessors: Annotated[list[Accessor], FailFast(), Limit] = Field(default_factory=list)
    images: Annotated[list[Image], FailFast(), Limit] = Field(default_factory=list)
    samplers: Annotated[list[Sampler], FailFast(), Limit] = Field(default_factory=list)
    textures: Annotated[list[Texture], FailFast(), Limit] = Field(default_factory=list)
    materials: Annotated[list[Surface], FailFast(), Limit] = Field(default_factory=list)
    meshes: Annotated[list[Mesh], FailFast(), Limit] = Field(default_factory=list)
    cameras: Annotated[list[Camera], FailFast(), Limit] = Field(default_factory=list)
    nodes: Annotated[list[Node], FailFast(), Limit] = Field(default_factory=list)
    scenes: Annotated[list[SceneRoots], FailFast(), Limit] = Field(default_factory=list)
    scene: Index | None = None
    animations: Unread = Field(default_factory=list)


def parse_document(text: bytes) -> Document:
    """Parse JSON whose size was checked. Raises UnreadableMesh with the JSON pointer of the first fault."""
    try:
        return Document.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        if first["type"] == "json_invalid":
            raise UnreadableMesh(f"damaged glTF file: {first['msg']}") from None
        pointer = "".join(f"/{short_name(part)}" for part in first["loc"])
        raise UnreadableMesh(f"damaged glTF file: {first['msg']}", pointer) from None
