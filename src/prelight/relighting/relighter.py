"""The live session: a bake, the light that falls on it now, the radiance and the pictures of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from ..arrays import Float32, Int32, Radiance, Triangles
from ..camera import Camera
from ..drawing.picture import Picture
from ..drawing.pixels import pixel_picture
from ..drawing.surface import Surface
from ..drawing.view import View
from ..errors import InputError
from ..lighting.disc import Disc
from ..lighting.environment import Environment
from ..lighting.quantities import Triple
from ..storage.bake import Bake
from .bounced_layer import read_bounced
from .environment import MOST_DISCS, EnvironmentRelighter, Update
from .exitant import read_exitant
from .fine_suns import MOST_FINE, FineSuns
from .layer import EnvironmentLayer
from .live_gloss import Falling, LiveGloss
from .named_camera import named_camera
from .pixel_light import lit_at_pixels
from .strong_lights import NO_LIGHTS, StrongLights, together
from .traced import Strong, TracedLights

_PICTURE = (1280, 720)


class Relighter:
    """Change the light of a bake and read the radiance.

    What follows from a state of the light depends on that state alone, not on how it was reached
    (within float32: a local change and a full relight agree to about 1e-6 of the largest radiance).

    Parameters
    ----------
    bake
        A ``Bake`` or the path of one. Needs no renderer.
    layer
        Which of its environment layers; the one of that name if not said, or the first.
    trace_strong
        Take the few lights that carry much of the energy (a sun) out of the clusters, and find their shadows by
        rays: 0.1 s or so where they move, and their error is gone. Switch it off while something is dragged.
        What a fixed eye sees of materials other than Lambertian needs the renderer for it; without, clusters do.
    bounced
        Add the light that has bounced, where the layer keeps it; direct light alone if not.

    Raises
    ------
    InputError, DamagedBakeError
        There is no bake, it has no such layer, or it is damaged.
    """

    def __init__(
        self,
        bake: Bake | str | Path,
        *,
        layer: str | None = None,
        trace_strong: bool = True,
        bounced: bool = True,
    ) -> None:
        self.bake = bake if isinstance(bake, Bake) else Bake.open(bake)
        self._layer = EnvironmentLayer(self.bake, layer)
        albedo = None if self._layer.picture_size else self.bake.receivers.albedo
        part = read_bounced(self.bake, self._layer) if bounced else None
        self._live = EnvironmentRelighter(self._layer, albedo, part)
        self._environment = Environment.constant((0.0, 0.0, 0.0))
        self._strong = Strong(TracedLights(self.bake, self._layer), wanted=trace_strong)
        self._behind: Sequence[Disc] = ()  # discs that are not traced
        gloss = read_exitant(self.bake, f"layers/{self._layer.name}/glossy")
        self._gloss = None if gloss is None else LiveGloss(gloss, self.bake.receivers)
        self._view = lru_cache(maxsize=4)(self._new_view)

    @property
    def environment(self) -> Environment:
        """The environment last assigned.

        Edits of texels come on top of its map. One that differs only in its discs costs a local change: the map
        is not sampled again, and edits stay; any other replaces them.
        """
        return self._environment

    @environment.setter
    def environment(self, environment: Environment) -> None:
        if not isinstance(environment, Environment):
            raise InputError("environment", f"{type(environment).__name__}, expected an Environment")
        known, live, strong = self._environment, self._live, self._strong
        R = self.resolution
        discs: Sequence[Disc] = environment.discs
        traced, behind = strong.of_discs(environment, R)
        if len(behind) > MOST_DISCS:
            discs, traced, behind = (), NO_LIGHTS, ()
        many = max(len(environment.discs), len(known.discs)) > MOST_DISCS
        if many or environment.discs == known.discs or not environment.same_behind_discs(known):
            cube = (environment.with_discs(()) if discs else environment).cube(R)
            texels = live.set_cube(strong.taken_out(cube, environment.total))
            live.last = live.set_discs(behind).after(texels)
        else:
            live.set_discs(behind)
        live.settle()
        strong.lights = together([strong.of_map, traced])
        self._environment, self._behind = environment, behind
        self.dull()

    @property
    def trace_strong(self) -> bool:
        """Whether strong lights are traced; set it, and the light that is there is lit so."""
        return self._strong.wanted

    @trace_strong.setter
    def trace_strong(self, wanted: bool) -> None:
        self.light(self._environment, trace_strong=wanted)

    def light(self, environment: Environment, *, trace_strong: bool) -> None:
        """Assign ``environment`` and ``trace_strong`` in one go; raises InputError as ``environment`` does."""
        if trace_strong != self._strong.wanted:
            self._strong.wanted = trace_strong
            self._environment = Environment.constant((0.0, 0.0, 0.0))  # so that nothing counts as known
        self.environment = environment

    @property
    def can_trace(self) -> bool:
        """Whether this installation can trace lights for this layer: not, without the renderer, under a fixed eye."""
        return self._strong.tracer.is_possible

    @property
    def strong_lights(self) -> StrongLights:
        """Those that are traced now."""
        return self._strong.lights

    @property
    def resolution(self) -> int:
        """R of the bake's cube map."""
        return self._layer.resolution

    @property
    def radiance(self) -> Radiance:
        """Linear radiance (rows, 3) of the layer's receivers; a copy.

        Of vertices, in their order: albedo times T·l, or T·l itself where they are seen by a fixed eye. Of
        pixels, row by row from the top.
        """
        return self._with_strong(self._live.radiance)

    @property
    def irradiance(self) -> Radiance:
        """``radiance`` before albedo, (rows, 3): irradiance / π of Lambertian rows, radiance of all others; a copy."""
        return self._with_strong(self._live.irradiance, irradiance=True)

    @property
    def clustered_irradiance(self) -> Radiance:
        """``irradiance`` without what the strong lights that are traced bring; a copy."""
        return self._live.irradiance

    @property
    def lambertian(self) -> Int32[np.ndarray, "some"]:
        """The rows whose radiance is albedo times irradiance / π; radiance toward a fixed eye is kept of the others."""
        return self._strong.tracer.lambertian

    def traced_radiance(self, lights: StrongLights, *, irradiance: bool = False) -> Radiance:
        """What these lights alone bring, (rows, 3), by a shadow ray for each light and receiver, bounces included.

        ``irradiance``: before albedo. Raises MissingExtraError where that needs the renderer.
        """
        return self._with_strong(np.zeros((self._layer.rows, 3), np.float32), lights, irradiance=irradiance)

    def _with_strong(
        self, radiance: Radiance, lights: StrongLights | None = None, *, irradiance: bool = False
    ) -> Radiance:
        lights = self._strong.lights if lights is None else lights
        if len(lights):
            more = self._strong.tracer.radiance(lights)
            lambertian = self._strong.tracer.lambertian
            if self._live.bounced is not None:
                more += self._live.bounced.of_strong(lights, more, self._caustics)
            if not irradiance and len(lambertian):
                more[lambertian] *= self.bake.receivers.albedo[lambertian]
            radiance += more.astype(np.float32)
        return radiance

    @cached_property
    def _caustics(self) -> Callable[[StrongLights], Radiance | None]:
        """What glass and mirrors send of traced lights, by photons."""
        from .caustic_rays import TracedCaustics

        return TracedCaustics(self.bake, self.resolution)

    @property
    def last(self) -> Update:
        """How the last change was made, and what it took: kind, milliseconds, bytes read."""
        return self._live.last

    def edit(self, face: int, rows: slice, columns: slice, radiance: np.ndarray) -> Update:
        """Replace a rectangle of the texels behind the discs; see ``EnvironmentRelighter.edit``.

        Strong lights there return to their clusters before.
        """
        for rectangle, texels in self._strong.give_back(face, rows, columns, self.resolution):
            self._live.edit(*rectangle, texels)
        self._live.edit(face, rows, columns, radiance)
        self._live.settle()
        self.dull()
        return self.last

    def light_texel(self, face: int, row: int, column: int, radiance: float) -> None:
        """A dark environment but for one texel, grey, through its cluster: T_C of that light."""
        self.environment = Environment.constant((0.0, 0.0, 0.0))
        self._live.edit(
            face, slice(row, row + 1), slice(column, column + 1), np.full(3, radiance, np.float32)
        )
        self.dull()

    @property
    def has_bounces(self) -> bool:
        """Whether light that has bounced is part of the radiance."""
        return self._live.bounced is not None

    @property
    def has_gloss(self) -> bool:
        """Whether glossy vertices are baked for any eye: then ``glossy`` adds to ``radiance``, their diffuse part."""
        return self._gloss is not None

    @property
    def glossy_milliseconds(self) -> float:
        """What the gloss of the last change of light took, once it was looked at; 0 where there is none."""
        return 0.0 if self._gloss is None else self._gloss.milliseconds

    def glossy(
        self, eye: Triple, irradiance: Radiance | None = None, *, strong: StrongLights | None = None
    ) -> Radiance | None:
        """(rows, 3) radiance toward a point that glossy vertices add to ``radiance``; None where the layer has none.

        ``irradiance`` (rows, 3), if more light falls than this layer's: what is seen mirrored; ``strong``: traced
        lights in place of its own. What is mirrored is found once for a light: ``dull`` forgets it.
        """
        return None if self._gloss is None else self._gloss.toward(eye, self._falling(irradiance, strong))

    def dull(self) -> None:
        """The light that gloss mirrors has changed."""
        if self._gloss is not None:
            self._gloss.forget()

    def _falling(self, irradiance: Radiance | None = None, strong: StrongLights | None = None) -> Falling:
        """The light that gloss mirrors."""
        suns = FineSuns(self._strong.tracer, self._strong.lights if strong is None else strong)
        falls = self.irradiance if irradiance is None else irradiance
        return suns.falling(falls, lambda: self._live.cube, discs=self._behind)

    @property
    def layer_name(self) -> str:
        """Of the layer that is relit."""
        return self._layer.name

    @property
    def zones(self) -> int:
        """How many zones the layer has."""
        return len(self._layer.starts) - 1

    def clusters(self, zone: int = 0) -> Int32[np.ndarray, "clusters 5"]:
        """Rectangles (face, row, column, height, width) of a zone's clusters, in Z-order."""
        return self._layer.rectangles[self._layer.starts[zone] : self._layer.starts[zone + 1]]

    def refresh(self) -> Update:
        """Relight in full."""
        return self._live.refresh()

    @property
    def picture_size(self) -> tuple[int, int] | None:
        """(width, height) of the pixels that are the layer's receivers; None where vertices are."""
        return self._layer.picture_size

    def camera(self, camera: Camera | str | None = None) -> Camera:
        """A camera by itself or by its name in the bake; else the layer's eye, or one that frames the scene.

        Raises InputError naming the cameras there are, and for any but its own eye in a layer of pixels.
        """
        cameras, eye = self.bake.cameras, self._layer.eye
        camera = named_camera(cameras, camera)
        if self.picture_size and camera not in (None, eye):
            raise InputError("camera", "another one than the pixels of this bake were made for; leave it out")
        chosen = camera or eye or next(iter(cameras.values()), None)
        return chosen or Camera.framing(self.bake.receivers.positions)

    def picture(
        self,
        camera: Camera | str | None = None,
        *,
        width: int | None = None,
        height: int | None = None,
        background: str | tuple[float, float, float] | None = "environment",
        fine: bool = False,
    ) -> Picture:
        """The scene as a camera sees it, anti-aliased; 1280×720 unless said otherwise.

        Of a layer of pixels, these as its own camera has them: no other camera and no other size. Where vertices
        are seen by a fixed eye any camera may look at them, but highlights stay where that eye sees them.

        ``background``: ``"environment"`` shows the map behind the scene, a colour or None replaces it.
        ``fine``: shadows of traced lights are found for each pixel, finer than the mesh, where any eye may look.
        """
        if isinstance(background, str) and background != "environment":
            raise InputError("background", f"{background!r}, expected 'environment', three numbers or None")
        behind = self._environment.radiance_along if background == "environment" else background
        irradiance = self.irradiance if self.picture_size is None and self._surface else None
        eye, size = self.camera(camera), self.picture_size or _PICTURE
        width, height = width or size[0], height or size[1]
        radiance, suns = self.radiance, self.fine_suns if fine else None
        if suns is not None:
            direct = suns.lamp_light
            radiance = np.maximum(radiance - self.bake.receivers.albedo * direct, 0)
            irradiance = None if irradiance is None else np.maximum(irradiance - direct, 0)
        picture = self._drawn(radiance, irradiance, eye, width=width, height=height, behind=behind)
        if suns is None and self._gloss is None:
            return picture
        view = self.view(eye, width=width, height=height, textured=irradiance is not None)
        if suns is not None:
            picture = lit_at_pixels(view, picture, suns, self.bake.receivers, self.bake.triangles)
        shine = self.drawn_gloss(view, self.bake.triangles, eye=eye.eye, fine=suns is not None)
        return picture if shine is None else replace(picture, linear=np.maximum(picture.linear + shine, 0))

    def drawn_gloss(
        self,
        view: View,
        triangles: Triangles,
        *,
        eye: Triple,
        irradiance: Radiance | None = None,
        fine: bool = False,
    ) -> Float32[np.ndarray, "height width 3"] | None:
        """``glossy`` as ``view`` sees it of ``triangles``, pixel by pixel; None where the layer has none."""
        if self._gloss is None:
            return None
        return self._gloss.drawn(view, triangles, eye=eye, falling=self._falling(irradiance), fine=fine)

    @property
    def fine_suns(self) -> FineSuns | None:
        """The traced lights whose shadows a picture can find pixel by pixel; None where there are none, or too many."""
        is_free = self.picture_size is None and self._layer.eye is None
        has_few = is_free and 0 < len(self.strong_lights) <= MOST_FINE
        return FineSuns(self._strong.tracer, self.strong_lights) if has_few else None

    def picture_of(self, radiance: Radiance, camera: Camera, *, width: int, height: int) -> Picture:
        """Any radiance of the layer's rows (rows, 3) as a picture before black; textures as at the vertices."""
        return self._drawn(radiance, None, camera, width=width, height=height, behind=None)

    def _drawn(
        self, radiance: Radiance, irradiance: Radiance | None, eye: Camera, *, width: int, height: int, behind
    ) -> Picture:
        own = self.picture_size
        if own is None:
            view = self.view(eye, width=width, height=height, textured=irradiance is not None)
            return view.draw(radiance, irradiance=irradiance, background=behind)
        if (width, height) != own:
            raise InputError("size", f"{width}×{height}, but the pixels of this bake are {own[0]}×{own[1]}")
        return pixel_picture(radiance, self.coverage, camera=eye, background=behind)

    def view(self, camera: Camera, *, width: int, height: int, textured: bool = False) -> View:
        """What a camera sees of the vertices; the last few are kept."""
        return self._view(camera, width, height, textured)

    @cached_property
    def coverage(self) -> Float32[np.ndarray, "height width"]:
        """The part of each pixel's samples, as a layer of pixels was made with, that see the scene."""
        samples = self.bake.layers[self._layer.name].parameters.get("samples")
        per_side = math.isqrt(samples) if isinstance(samples, int) and 0 < samples <= 64 else 1
        width, height = self._layer.picture_size or _PICTURE
        receivers = self.bake.receivers
        view = View(
            receivers.positions, self.bake.triangles, camera=self.camera(), width=width, height=height,
            samples_per_side=per_side,
        )  # fmt: skip
        return view.coverage

    @cached_property
    def _surface(self) -> Surface | None:
        """Textures, where what is kept of the vertices is irradiance."""
        bake = self.bake
        if bake.uv is None or not bake.textures:
            return None
        glossy = self._layer.eye is not None
        materials = [
            replace(m, colour_texture=None) if glossy and not m.is_lambertian else m for m in bake.materials
        ]
        return Surface(bake.material_of, materials, uv=bake.uv, tint=bake.tint, textures=bake.textures)

    def _new_view(self, camera: Camera, width: int, height: int, textured: bool) -> View:
        receivers, triangles = self.bake.receivers, self.bake.triangles
        surface = self._surface if textured else None
        return View(
            receivers.positions, triangles, camera=camera, width=width, height=height, surface=surface
        )
