"""Axis names and array aliases; no code.

Axes: ``receivers`` rows of T · ``vertices`` · ``triangles`` · ``clusters`` columns of T ·
``face row column`` texels of a cube map · ``channels`` linear Rec.709 red, green, blue.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64, UInt8, UInt16, UInt32

Positions = Float32[np.ndarray, "vertices 3"]
Normals = Float32[np.ndarray, "vertices 3"]
Triangles = Int32[np.ndarray, "triangles 3"]
Directions = Float32[np.ndarray, "directions 3"]
Albedo = Float32[np.ndarray, "receivers 3"]
Radiance = Float32[np.ndarray, "receivers 3"]
CubeMap = Float32[np.ndarray, "6 row column 3"]
Picture = Float32[np.ndarray, "height width 3"]
MaterialOf = Int32[np.ndarray, "..."]
Texture = UInt8[np.ndarray, "height width 3"]
TextureCoordinates = Float32[np.ndarray, "vertices 2"]
Bytes = UInt8[np.ndarray, "..."]

__all__ = [
    "Albedo", "Bytes", "CubeMap", "Directions", "Float32", "Float64", "Int32", "Int64",
    "MaterialOf", "Normals", "Picture", "Positions", "Radiance", "Texture", "TextureCoordinates", "Triangles",
    "UInt8", "UInt16", "UInt32",
]  # fmt: skip
