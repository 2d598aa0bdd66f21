"""The part of a glTF 2.0 document that a diffuse bake reads, checked as it is parsed."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, FailFast, Field, ValidationError

from ..mesh import UnreadableMesh, short_name

MOST_ITEMS = 100_000  # nodes, meshes, accessors, ...: each
Count = Annotated[int, Field(ge=1, lt=2**31)]
Index = Annotated[int, Field(ge=0, lt=2**31)]
Vector = tuple[float, float, float]
Quad = tuple[float, float, float, float]
Matrix = Annotated[list[float], Field(min_length=16, max_length=16)]  # by columns


class _Part(BaseModel):
    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)


class Asset(_Part):
    version: str


class Buffer(_Part):
    byteLength: Count
    uri: str | None = None


class BufferView(_Part):
    buffer: Index
    byteOffset: Index = 0
    byteLength: Count
    byteStride: Annotated[int, Field(ge=4, le=252, multiple_of=4)] | None = None


class Accessor(_Part):
    bufferView: Index | None = None
    byteOffset: Index = 0
    componentType: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    normalized: bool = False
    count: Count
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    sparse: Any = None


class Texture(_Part):
    index: Index


class Roughness(_Part):
    """`pbrMetallicRoughness`."""

    baseColorFactor: Quad = (1.0, 1.0, 1.0, 1.0)
    baseColorTexture: Texture | None = None
    metallicFactor: float = 0.0  # glTF's default of 1 means "metal" where nobody said so: never reported
    metallicRoughnessTexture: Texture | None = None


class SpecularGlossiness(_Part):
    """`KHR_materials_pbrSpecularGlossiness`, which older exporters write."""

    diffuseFactor: Quad = (1.0, 1.0, 1.0, 1.0)
    diffuseTexture: Texture | None = None


class MaterialExtensions(_Part):
    KHR_materials_pbrSpecularGlossiness: SpecularGlossiness | None = None


class Material(_Part):
    name: str = ""
    pbrMetallicRoughness: Roughness | None = None
    emissiveFactor: Vector = (0.0, 0.0, 0.0)
    emissiveTexture: Texture | None = None
    alphaMode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    extensions: MaterialExtensions = MaterialExtensions()


class Attributes(_Part):
    POSITION: Index | None = None
    NORMAL: Index | None = None
    COLOR_0: Index | None = None


class PrimitiveExtensions(_Part):
    KHR_draco_mesh_compression: Any = None


class Primitive(_Part):
    attributes: Attributes
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Field(ge=0, le=6)] = 4
    targets: Any = None
    extensions: PrimitiveExtensions = PrimitiveExtensions()


class Mesh(_Part):
    primitives: Annotated[list[Primitive], FailFast(), Field(min_length=1, max_length=MOST_ITEMS)]


class Node(_Part):
    mesh: Index | None = None
    children: Annotated[list[Index], FailFast(), Field(max_length=MOST_ITEMS)] = []
    matrix: Matrix | None = None
    translation: Vector | None = None
    rotation: Quad | None = None
    scale: Vector | None = None
    skin: Index | None = None


class SceneRoots(_Part):
    """An entry of `scenes`."""

    nodes: Annotated[list[Index], FailFast(), Field(max_length=MOST_ITEMS)] = []


_Limit = Field(max_length=MOST_ITEMS)


class Document(_Part):
    """Indices are not yet compared with the lists that they point into."""

    asset: Asset
    extensionsUsed: Annotated[list[str], FailFast(), _Limit] = []
    extensionsRequired: Annotated[list[str], FailFast(), _Limit] = []
    buffers: Annotated[list[Buffer], FailFast(), _Limit] = []
    bufferViews: Annotated[list[BufferView], FailFast(), _Limit] = []
    accessors: Annotated[list[Accessor], FailFast(), _Limit] = []
    materials: Annotated[list[Material], FailFast(), _Limit] = []
    meshes: Annotated[list[Mesh], FailFast(), _Limit] = []
    nodes: Annotated[list[Node], FailFast(), _Limit] = []
    scenes: Annotated[list[SceneRoots], FailFast(), _Limit] = []
    scene: Index | None = None


def parse_document(text: bytes) -> Document:
    """Parse JSON whose size was checked. Raises UnreadableMesh with the JSON pointer of the first fault."""
    try:
        return Document.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        if first["type"] == "json_invalid":
            raise UnreadableMesh(f"damaged GLB file: {first['msg']}") from None
        pointer = "".join(f"/{short_name(part)}" for part in first["loc"])
        raise UnreadableMesh(f"damaged GLB file: {first['msg']}", pointer) from None
