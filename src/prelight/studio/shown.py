"""What the page shows: the mesh of a bake as plain arrays, its textures as PNG, the cameras to look with."""

from __future__ import annotations

import hashlib
import io
import threading
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..camera import Camera
from ..errors import DamagedBakeError, InputError
from ..relighting.takers import found_layer
from ..storage.bake import Bake
from ..storage.manifest import LayerRecord
from .kinds import Taken, glossy, is_sky_alone, panes_of, steered_of, takes_of
from .protocol_values import CameraView, PortalView, SteeredView

if TYPE_CHECKING:
    from ..relighting.relighter import Relighter

_SHAPES = {"f4": "<f4", "u4": "<u4", "u1": "u1"}


class Shown:
    """The scene of a bake as its environment layer has it; safe to use from several threads.

    Nothing here waits for transport, but for bakes with a fixed eye.
    """

    def __init__(self, bake: Bake) -> None:
        self.bake = bake
        self._lock = threading.RLock()

    @cached_property
    def _found(self) -> tuple[str, LayerRecord] | None:
        """The environment layer that is shown; None where there are others: they light vertices, for any eye."""
        return found_layer(self.bake) if is_sky_alone(self.bake) else None

    @cached_property
    def takes(self) -> tuple[Taken, ...]:
        """What of a rig the bake can be lit by."""
        return takes_of(self.bake)

    @cached_property
    def steered(self) -> SteeredView | None:
        """What steerable layers light."""
        return steered_of(self.bake)

    @cached_property
    def glossy(self) -> bool:
        """Whether what is seen depends on the eye."""
        return glossy(self.bake)

    @cached_property
    def _panes(self) -> tuple[tuple[PortalView, ...], np.ndarray]:
        return panes_of(self.bake)

    @property
    def portals(self) -> tuple[PortalView, ...]:
        """The portals whose glass can be set."""
        return self._panes[0]

    @property
    def _eye(self) -> Any:
        """The record of the eye that the layer was made for, if any."""
        return self._found[1].camera if self._found else None

    # ---- Figures -----------------------------------------------------------------------------------------

    @cached_property
    def digest(self) -> str:
        """What tells a bake from others, also from what stood at its path before."""
        return hashlib.sha256(self.bake.manifest.to_bytes()).hexdigest()

    @property
    def vertices(self) -> int:
        return self.bake.manifest.arrays["scene/positions"].shape[0]

    @property
    def triangles(self) -> int:
        return self.bake.manifest.arrays["scene/triangles"].shape[0]

    @property
    def resolution(self) -> int:
        """R of the layer."""
        return int(self._found[1].parameters.get("resolution") or 0) if self._found else 0

    @property
    def pixels(self) -> tuple[int, int] | None:
        """(width, height), where the rows of the layer are those of a picture."""
        given = self._found[1].parameters if self._found else {}
        if given.get("receivers") != "pixels":
            return None
        width, height = given.get("width"), given.get("height")
        if not isinstance(width, int) or not isinstance(height, int):
            raise DamagedBakeError(self.bake.path, f"its picture is {width!r} by {height!r} pixels")
        return width, height

    @property
    def rows(self) -> int:
        """Of a radiance frame."""
        if self.pixels is not None:
            return self.pixels[0] * self.pixels[1]
        more = 0 if self.steered is None else self.steered.width * self.steered.height
        return self.vertices + more

    @property
    def eye(self) -> str | None:
        """The name of the camera that the layer was made for."""
        return self._eye.name if self._eye else None

    @cached_property
    def cameras(self) -> tuple[CameraView, ...]:
        """The layer's eye, then those of the scene; one that frames it if there are none."""
        cameras: dict[str, Camera] = {}
        try:
            if self._eye:
                cameras[self._eye.name] = Camera.from_dict(self._eye.view)
        except InputError as error:
            raise DamagedBakeError(self.bake.path, f"the eye of its layer is wrong: {error.reason}") from None
        if self.steered is not None:
            view = self.steered.camera
            cameras[view.name] = Camera(view.eye, view.target, view.up, view.vertical_fov_deg)
        for name, camera in self.bake.cameras.items():
            cameras.setdefault(name, camera)
        if not cameras:
            cameras["overview"] = Camera.framing(self.bake.receivers.positions)
        return tuple(
            CameraView(name, c.eye, c.target, c.up, c.vertical_fov_deg) for name, c in cameras.items()
        )

    # ---- Arrays ------------------------------------------------------------------------------------------

    def index(self) -> dict[str, Any]:
        """What ``/geometry.json`` says: the arrays there are, and the texture of each material."""
        arrays = {
            name: {"url": f"/geometry/{name}", "type": kind, "shape": list(array.shape)}
            for name, (kind, array) in self._arrays.items()
        }
        materials = [
            {"name": m.name, "texture": t} for m, t in zip(self.bake.materials, self._worn, strict=True)
        ]
        return {
            "bake": self.digest,
            "vertices": self.vertices,
            "triangles": self.triangles,
            "arrays": arrays,
            "materials": materials,
        }

    def array(self, name: str) -> bytes | None:
        """The bytes of one of them, little-endian; None if there is none of that name."""
        if name not in self._arrays:
            return None
        kind, array = self._arrays[name]
        return np.ascontiguousarray(array, _SHAPES[kind]).tobytes()

    @property
    def textures(self) -> int:
        return len(self.bake.textures)

    @lru_cache(maxsize=8)  # noqa: B019  (one of these is made, for the life of the studio)
    def texture_png(self, index: int) -> bytes:
        """A texture as PNG, sRGB as stored; index from 0 to ``textures``."""
        from PIL import Image

        out = io.BytesIO()
        Image.fromarray(np.ascontiguousarray(self.bake.textures[index])).save(out, "PNG", compress_level=1)
        return out.getvalue()

    @property
    def _worn(self) -> list[int | None]:
        """The texture that the page multiplies with: not of what a fixed eye sees with its texture already."""
        fixed = self._eye is not None
        return [
            None if self.bake.uv is None or (fixed and not m.is_lambertian) else m.colour_texture
            for m in self.bake.materials
        ]

    @property
    def _arrays(self) -> dict[str, tuple[str, np.ndarray]]:
        with self._lock:
            return self._arrays_once

    @cached_property
    def _arrays_once(self) -> dict[str, tuple[str, np.ndarray]]:
        bake = self.bake
        receivers = bake.receivers
        albedo, tint = receivers.albedo, bake.tint
        if self._eye is not None:
            final = np.ones(len(albedo), bool)  # rows that are radiance already
            if self.pixels is None:
                final[self._relighter.lambertian] = False
            albedo, tint = (np.where(final[:, None], np.float32(1), colour) for colour in (albedo, tint))
        arrays = {
            "positions": ("f4", receivers.positions),
            "normals": ("f4", receivers.normals),
            "triangles": ("u4", bake.triangles),
            "material_of": ("u4", bake.material_of),
            "albedo": ("f4", albedo),
            "tint": ("f4", tint),
        }
        if bake.uv is not None:
            arrays["uv"] = ("f4", bake.uv)
        if self.portals:
            arrays["pane"] = ("u4", self._panes[1])
        if self.pixels is not None:
            arrays["coverage"] = ("u1", np.rint(self._relighter.coverage * 255).astype(np.uint8))
        return arrays

    @cached_property
    def _relighter(self) -> Relighter:
        """For what only the layer itself knows."""
        from ..relighting.relighter import Relighter

        return Relighter(self.bake, layer=self._found[0] if self._found else None, trace_strong=False)
