"""All layers of a bake under one rig: each takes its share, and what they bring is added."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ..arrays import Directions, Radiance, Triangles
from ..arrays import Picture as Pixels
from ..camera import Camera
from ..drawing.background import Background
from ..drawing.picture import Picture
from ..drawing.pixels import pixel_picture
from ..drawing.surface import Surface
from ..drawing.view import View
from ..errors import InputError
from ..lighting.environment import Environment
from ..lighting.panel import Panel
from ..lighting.quantities import Triple
from ..lighting.rig import Rig
from ..lighting.spot import Spot
from ..storage.bake import Bake
from .live_environment import LiveEnvironment
from .live_layer import LiveLayer
from .named_camera import named_camera
from .pixel_environment import PixelEnvironment
from .pixel_light import lit_at_pixels
from .relighter import Relighter
from .stand_ins import StandIns
from .steerable_bake import SteerableBake
from .stored_steerable import steerable_names
from .takers import LAMPS, SKIES

_PICTURE = (1280, 720)


class LitBake:
    """A bake with layers of several kinds under one rig. What follows depends on the rig alone.

    Layers of vertices add up to irradiance at the vertices; layers of pixels (steerable lamps, an environment baked
    at the pixels of one eye) add to the picture that this eye sees. An environment layer of vertices that is baked for
    one eye shines as that eye sees it, whoever looks.

    Parameters
    ----------
    trace_strong
        As of ``Relighter``.
    without
        Layers that are not opened, by name: somebody else lights them.
    fade
        Seconds in which lights of a cloud fade as lamps lose sight of them, for a live session that calls ``light``
        again while it ``is_settling``; 0 for no history.

    Raises
    ------
    InputError, MissingExtraError
        No bake, or a layer that does not go with others; a layer that needs the renderer, which is not installed.
    OutputError, DamagedBakeError
        It cannot be read, or is not what was written.
    """

    def __init__(
        self,
        bake: Bake | str | Path,
        *,
        trace_strong: bool = True,
        without: Collection[str] = (),
        fade: float = 0.0,
    ) -> None:
        self.bake = bake if isinstance(bake, Bake) else Bake.open(bake)
        self.layers: list[LiveLayer] = []
        self.pixels: list[PixelEnvironment] = []
        self._sky: str | None = None
        self._lamps: str | None = None
        steered = [name for name in steerable_names(self.bake) if name not in without]
        self.steered = SteerableBake(self.bake) if steered else None
        for kind in SKIES:
            for name, record in self.bake.layers.items():
                if record.kind == kind and name not in without:
                    layer = _opened(self.bake, name, kind, trace_strong=trace_strong, fade=fade)
                    if isinstance(layer, PixelEnvironment):
                        self.pixels.append(layer)
                    else:
                        self.layers.append(layer)
                    self._sky = self._sky or (None if kind == "cloud" else name)
                    self._lamps = self._lamps or (name if kind in LAMPS else None)
        if not self.layers and not self.pixels and self.steered is None:
            raise InputError(self.bake.path, "has no layer that this version can light; bake one")
        self._screen = self._one_screen()
        self._rig = Rig(Environment.dark())

    def light(self, rig: Rig, *, coarse: bool = False, check: Callable[[], None] = lambda: None) -> None:
        """Light the bake with ``rig`` and nothing else.

        ``coarse``: a hand drags, and quick is better than exact, as far as layers have a quick way; the same without
        it makes it exact, the same as if nothing had been coarse. ``check`` is called now and then, and may raise to
        give up.

        Raises InputError for a light that no layer takes, and as the layers do; then nothing has changed that a
        next call would not set right.
        """
        self._refuse_homeless(rig)
        if self.steered is not None:
            self.steered.light(_steered(rig))
        for layer in self.all_layers:
            own = rig if layer.name == self._sky else replace(rig, environment=_DARK)
            own = own if layer.name == self._lamps else replace(own, lamps=())
            layer.light(own, coarse=self.stand_ins if coarse else None, check=check)
        self._rig = rig

    @cached_property
    def stand_ins(self) -> StandIns | None:
        """The vertices that stand for all while a hand drags; None where there are few vertices."""
        receivers = self.bake.receivers
        return StandIns.of(receivers.positions, receivers.normals)

    @property
    def is_coarse(self) -> bool:
        """Whether some layer's light is not the exact one."""
        return any(layer.is_coarse for layer in self.layers)

    def warm(self) -> None:
        """Make ready what the first drag would wait for."""
        if self.stand_ins is not None:
            for layer in self.layers:
                if (warm := getattr(layer, "warm", None)) is not None:
                    warm(self.stand_ins)

    @property
    def all_layers(self) -> list[LiveLayer | PixelEnvironment]:
        """Those of vertices and of pixels, without the steerable ones."""
        return [*self.layers, *self.pixels]

    @property
    def is_settling(self) -> bool:
        """Whether the same rig would show something else a moment later."""
        return any(getattr(layer, "is_settling", False) for layer in self.layers)

    @property
    def irradiance(self) -> Radiance:
        """(V, 3) irradiance / π before albedo, of all layers of vertices; a copy."""
        total = np.zeros((len(self.bake.receivers), 3), np.float32)
        for layer in self.layers:
            total += layer.irradiance
        return total

    def glossy(self, eye: Triple) -> Radiance | None:
        """(V, 3) what glossy surfaces add toward a point; None where no layer has such."""
        parts = [part for layer in self.layers if (part := layer.glossy(eye)) is not None]
        return None if not parts else np.asarray(sum(parts[1:], start=parts[0]), np.float32)

    def radiance(self, eye: Triple | None = None) -> Radiance:
        """(V, 3) linear radiance of the vertices, toward ``eye`` where there are glossy ones; a copy."""
        diffuse = self.bake.receivers.albedo * self.irradiance
        shine = None if eye is None else self.glossy(eye)
        return diffuse if shine is None else diffuse + shine

    @property
    def notes(self) -> list[str]:
        """What somebody who lights with this rig should know, of layers that have something to say."""
        notes = [note for layer in self.layers for note in getattr(layer, "notes", ())]
        if self.strong_lights:
            one = self.strong_lights == 1
            notes.append(
                f"{'1 strong light is' if one else f'{self.strong_lights} strong lights are'} traced by rays"
            )
        return notes

    @property
    def strong_lights(self) -> int:
        """How many lights of the environment are traced by rays, not lit by clusters."""
        return sum(getattr(layer, "strong_lights", 0) for layer in self.all_layers)

    @property
    def milliseconds(self) -> float:
        """What the last change took, in all layers."""
        return sum(layer.last.milliseconds for layer in self.all_layers)

    @property
    def glossy_milliseconds(self) -> float:
        """What gloss took after the last change, in layers that tell, once it was looked at."""
        return sum(getattr(layer, "glossy_milliseconds", 0.0) for layer in self.layers)

    @property
    def bytes_read(self) -> int:
        """What the last change read, in all layers."""
        return sum(layer.last.bytes_read for layer in self.all_layers)

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of a picture, where nothing else is asked for: the pixels' where layers have pixels."""
        return _PICTURE if self._screen is None else self._screen[1]

    @property
    def has_pixels(self) -> bool:
        """Whether a layer's receivers are pixels: then pictures are what there is, of their eye and size."""
        return self._screen is not None

    def _one_screen(self) -> tuple[Camera, tuple[int, int]] | None:
        """The eye and size of the layers of pixels. Raises InputError where they are not the same."""
        screens = [(layer.name, layer.camera, layer.size) for layer in self.pixels]
        if self.steered is not None:
            screens.append(("of steerable lamps", self.steered.camera, self.steered.size))
        for name, eye, size in screens[1:]:
            if (eye, size) != screens[0][1:]:
                what = f"its layers {screens[0][0]} and {name} are pixels of different eyes or sizes, and do not add"
                raise InputError(self.bake.path, what + "; remove one of them")
        return screens[0][1:] if screens else None

    def camera(self, camera: Camera | str | None = None) -> Camera:
        """A camera by itself or by its name in the bake; else the eye of a layer that has one, or the first there is.

        Raises InputError naming the cameras there are, and for another than the pixels' own.
        """
        cameras = self.bake.cameras
        camera = named_camera(cameras, camera)
        if self._screen is not None:
            if camera not in (None, self._screen[0]):
                what = "another one than the pixels of this bake were made for; leave it out"
                raise InputError("camera", what)
            return self._screen[0]
        eyes = [eye for layer in self.layers if (eye := getattr(layer, "eye", None)) is not None]
        known = [*eyes, *cameras.values()]
        return camera or next(iter(known), None) or Camera.framing(self.bake.receivers.positions)

    def picture(
        self,
        camera: Camera | str | None = None,
        *,
        width: int | None = None,
        height: int | None = None,
        background: str | Triple | None = "environment",
        fine: bool = False,
    ) -> Picture:
        """The scene as a camera sees it, anti-aliased; of the pixels' size where a layer has pixels, else 1280×720.

        ``fine``: direct light of lamps with a place is found for each pixel, so that shadows are finer than the mesh;
        a second or so for each.

        Raises InputError as ``camera``, for another size than the pixels', and for an unknown background.
        """
        if isinstance(background, str) and background != "environment":
            raise InputError("background", f"{background!r}, expected 'environment', three numbers or None")
        eye, size = self.camera(camera), self.size
        chosen = width or size[0], height or size[1]
        if self._screen is not None and chosen != size:
            what = f"{chosen[0]}×{chosen[1]}, but the pixels of this bake are {size[0]}×{size[1]}"
            raise InputError("size", what)
        behind = self.behind(eye.eye) if background == "environment" else background
        if self.pixels and not self.layers:  # whose own samples say where the scene ends
            dark = np.zeros((size[0] * size[1], 3), np.float32)
            picture = pixel_picture(dark, self.pixels[0].coverage, camera=eye, background=behind)
        else:
            picture = self._of_vertices(eye, chosen, behind, fine=fine)
        if self._screen is None:
            return picture
        seen: Pixels = self.pixel_radiance.reshape(size[1], size[0], 3)
        return replace(picture, linear=picture.linear + seen)

    @property
    def pixel_radiance(self) -> Radiance:
        """(pixels, 3) what layers of pixels add to the picture of their eye, where there are such; a copy."""
        parts: list[Radiance] = [layer.radiance for layer in self.pixels]
        if self.steered is not None:
            parts.append(np.maximum(self.steered.radiance, 0))  # noise may leave it a little below
        return np.asarray(sum(parts[1:], start=parts[0]), np.float32)

    def _of_vertices(self, eye: Camera, size: tuple[int, int], behind: Background, *, fine: bool) -> Picture:
        """What layers of vertices bring, before what is behind the scene."""
        panes = next((p for layer in self.layers if (p := getattr(layer, "panes", None)) is not None), None)
        left = slice(None) if panes is None else np.flatnonzero(panes.are_left(self.bake.triangles))
        triangles = self.bake.triangles[left]
        view = self._view(triangles, eye, size, surface=self._surface(left))
        irradiance = self.irradiance
        by_pixel = [lit for layer in self.layers if fine and (lit := layer.point_lit) is not None]
        for own in by_pixel:
            irradiance -= own.lamp_light
        np.maximum(irradiance, 0, out=irradiance)
        diffuse = self.bake.receivers.albedo * irradiance
        picture = view.draw(diffuse, irradiance=irradiance if self._textured else None, background=behind)
        for own in by_pixel:
            picture = lit_at_pixels(view, picture, own, self.bake.receivers, triangles)
        linear, gloss = picture.linear, np.zeros((len(self.bake.receivers), 3), np.float32)
        for layer in self.layers:
            drawn = layer.drawn_gloss(view, triangles, eye=eye.eye, fine=fine)
            if drawn is not None:
                linear = linear + drawn
            beside = layer.glossy if drawn is None else getattr(layer, "pane_shine", None)
            if beside is not None and (shine := beside(eye.eye)) is not None:
                gloss += shine
        picture = replace(picture, linear=np.maximum(linear, 0))
        if panes is not None:
            whole = self._view(self.bake.triangles, eye, size)
            picture = panes.before(picture, whole, len(self.bake.receivers))
            picture = replace(picture, linear=picture.linear + whole.draw(panes.without_clear(gloss)).linear)
        elif gloss.any():
            picture = replace(picture, linear=picture.linear + view.draw(gloss).linear)
        return picture

    def _view(
        self, triangles: Triangles, eye: Camera, size: tuple[int, int], *, surface: Surface | None = None
    ) -> View:
        positions = self.bake.receivers.positions
        return View(positions, triangles, camera=eye, width=size[0], height=size[1], surface=surface)

    @property
    def _textured(self) -> bool:
        return self.bake.uv is not None and bool(self.bake.textures)

    def _surface(self, left: slice | np.ndarray) -> Surface | None:
        """Textures of some triangles."""
        bake = self.bake
        if bake.uv is None or not bake.textures:
            return None
        of = bake.material_of[left]
        return Surface(of, bake.materials, uv=bake.uv, tint=bake.tint, textures=bake.textures)

    def behind(self, eye: Triple) -> Callable[[Directions], Radiance]:
        """What is seen behind the scene: by the layer that knows a world outside, else the environment."""
        for layer in self.layers:
            if layer.name == self._sky and (seen := getattr(layer, "behind", None)) is not None:
                return seen(eye)
        return self._rig.environment.radiance_along

    def _refuse_homeless(self, rig: Rig) -> None:
        """Raises InputError for lights of kinds that no layer takes."""
        kinds = {record.kind for record in self.bake.layers.values()}
        lacking = []
        if self._sky is None and max(rig.environment.total) > 0:
            lacking.append("[environment], [[disc]] or [[paint]] (bake environment)")
        if self._lamps is None and rig.lamps:
            lacking.append("[[lamp]], or [[spot]] or [[panel]] with a place (bake transfer or cloud)")
        if rig.portals and "portals" not in kinds:
            lacking.append("[[portal]] (bake portals)")
        if rig.outside is not None and "portals" not in kinds:
            lacking.append("[outside] (bake portals)")
        if self.steered is None and _steered(rig):
            lacking.append("[[spot]] or [[panel]] with a layer (bake steerable)")
        if lacking:
            what = f"has {' and '.join(lacking)}, but the layers of this bake are {', '.join(sorted(kinds))}"
            raise InputError("rig", what)


_DARK = Environment.dark()


def _steered(rig: Rig) -> list[Spot | Panel]:
    """The rig's lights that have a place in a steerable layer."""
    return list(rig.lights)


def _opened(
    bake: Bake, name: str, kind: str, *, trace_strong: bool, fade: float
) -> LiveLayer | PixelEnvironment:
    if kind == "environment":
        lit = Relighter(bake, layer=name, trace_strong=trace_strong)
        size = lit.picture_size
        return LiveEnvironment(lit) if size is None else PixelEnvironment(lit, size=size)
    if kind == "transfer":
        from .transfer import TransferRelighter

        return TransferRelighter(bake, name)
    if kind == "cloud":
        from .cloud import CloudRelighter
        from .cloud_fading import Fading

        return CloudRelighter(bake, name, fading=Fading(fade) if fade > 0 else None)
    if kind == "portals":
        from .portals import PortalsRelighter

        return PortalsRelighter(bake, name)
    raise InputError(bake.path, f"layer {name!r} is of kind {kind!r}, which does not add to others yet")
