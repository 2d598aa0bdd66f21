"""What a bake takes from glTF materials, and what it leaves."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

from ...material import Material
from ..mesh import short_name
from .appearance import MetallicRoughness, Specular, Surface, TextureInfo
from .specular_glossiness import MetalAndRoughness, converted
from .textures import Mapping, TextureShelf

_BRIGHTEST = 1e30


@dataclass(frozen=True)
class Look:
    """A material as Prelight has it, and how its textures are looked up; without ``mapping`` it has none."""

    material: Material
    mapping: Mapping | None = None

    @property
    def untextured(self) -> Material:
        """For a primitive without coordinates: the factors alone, and no light where a texture says where."""
        if self.mapping is None:
            return self.material
        dark = self.material.emission_texture is not None
        emission = (0.0, 0.0, 0.0) if dark else self.material.emission
        none = {"colour_texture": None, "roughness_texture": None, "emission_texture": None}
        return replace(self.material, emission=emission, **none)


@dataclass
class Looks:
    """Materials of a document, read one by one; what is not read is counted on the way."""

    surfaces: list[Surface]
    shelf: TextureShelf
    counts: Counter[str] = field(default_factory=Counter)
    unused: Counter[str] = field(default_factory=Counter)  # textures, by what they are for
    _known: dict[int | None, Look] = field(default_factory=dict)
    _outside: bool = False  # whether a factor of the material being read is out of range

    def find(self, index: int | None) -> Look:
        """The material of a primitive; None is the default material. Raises UnreadableMesh."""
        if index not in self._known:
            surface = Surface(name="default") if index is None else self.surfaces[index]
            self._known[index] = self._read(surface, surface.name or f"material {index}")
        return self._known[index]

    def notes(self) -> list[str]:
        """One line a kind."""
        lines = [f"{what} (materials: {count:,})" for what, count in self.counts.items()]
        if self.unused:
            kinds = ", ".join(f"{kind} {count:,}" for kind, count in self.unused.items())
            lines.append(f"textures not used: {kinds}")
        if faults := list(self.shelf.faults):
            more = f", and {len(faults) - 1:,} more" if len(faults) > 1 else ""
            lines.append(f"image not read, factors used instead: {faults[0]}{more}")
        if self.shelf.smoothed:
            lines.append(f"textures without filtering looked up with it: {len(self.shelf.smoothed):,}")
        return lines

    def _read(self, surface: Surface, name: str) -> Look:
        extensions, self._outside = surface.extensions, False
        model, colour_info, roughness_info = self._model(surface)
        transmission, coat = extensions.KHR_materials_transmission, extensions.KHR_materials_clearcoat
        material = Material(
            name=short_name(name),
            colour=model.colour,
            roughness=model.roughness,
            metallic=model.metallic,
            specular=model.specular * self._specular(extensions.KHR_materials_specular),
            ior=self._ior(surface),
            transmission=self._unit(transmission.transmissionFactor) if transmission else 0.0,
            clearcoat=self._unit(coat.clearcoatFactor) if coat else 0.0,
            clearcoat_roughness=self._unit(coat.clearcoatRoughnessFactor) if coat else 0.0,
            emission=self._emission(surface),
        )
        if extensions.KHR_materials_unlit is not None:
            self.counts["unlit surfaces lit as matte ones"] += 1
            material = Material(name=material.name, colour=material.colour)
            roughness_info = None
        elif material.metallic > 0:
            self.counts["metal is matte of its colour in a bake without an eye"] += 1
        if surface.alphaMode != "OPAQUE":
            self.counts["transparency not read, surfaces are opaque"] += 1
        if self._outside:
            self.counts["factors out of range clipped"] += 1
        self._count_unused(surface)
        return self._textured(material, colour_info, roughness_info, surface.emissiveTexture)

    def _model(self, surface: Surface) -> tuple[MetalAndRoughness, TextureInfo | None, TextureInfo | None]:
        """Colour, metal and roughness, and the textures of the first and of the others."""
        old = surface.extensions.KHR_materials_pbrSpecularGlossiness
        if old is not None:
            return converted(old), old.diffuseTexture, None
        new: MetallicRoughness = surface.pbrMetallicRoughness
        red, green, blue = (self._unit(value) for value in new.baseColorFactor[:3])
        model = MetalAndRoughness(
            (red, green, blue), self._unit(new.metallicFactor), self._unit(new.roughnessFactor), specular=1.0
        )
        return model, new.baseColorTexture, new.metallicRoughnessTexture

    def _specular(self, given: Specular | None) -> float:
        """`KHR_materials_specular`: its factor, times its colour where that is a grey."""
        if given is None:
            return 1.0
        low, high = min(given.specularColorFactor), max(given.specularColorFactor)
        if high - low > 0.01:
            self.counts["coloured reflections of dielectrics taken as grey"] += 1
        return self._unit(given.specularFactor) * self._unit((low + high) / 2)

    def _ior(self, surface: Surface) -> float:
        given = surface.extensions.KHR_materials_ior
        if given is None:
            return 1.5
        if given.ior == 0:  # the extension's word for "reflects everything"
            return 3.0
        return self._clipped(given.ior, 1.0, 3.0)

    def _emission(self, surface: Surface) -> tuple[float, float, float]:
        strength = surface.extensions.KHR_materials_emissive_strength
        times = 1.0 if strength is None else strength.emissiveStrength
        red, green, blue = (self._clipped(v * times, 0.0, _BRIGHTEST) for v in surface.emissiveFactor)
        return red, green, blue

    def _textured(
        self,
        material: Material,
        colour: TextureInfo | None,
        roughness: TextureInfo | None,
        emission: TextureInfo | None,
    ) -> Look:
        """With the textures that can be read and lie on one set of coordinates, the colour's first."""
        mapping: Mapping | None = None
        fields: dict[str, int] = {}
        emits = any(material.emission) and emission is not None
        wanted = {"colour": colour, "emission": emission if emits else None, "roughness": roughness}
        for name, info in wanted.items():
            found = None if info is None else self.shelf.find(info)
            if found is None:
                continue
            if mapping is not None and not mapping.agrees_with(found[1]):
                self.unused[f"{name} with coordinates of its own"] += 1
                continue
            fields[f"{name}_texture"], own = found
            mapping = mapping or own
        if emits and "emission_texture" not in fields:  # rather no light than light all over
            material = replace(material, emission=(0.0, 0.0, 0.0))
        return Look(replace(material, **fields), mapping)

    def _count_unused(self, surface: Surface) -> None:
        given = surface.extensions
        specular, coat = given.KHR_materials_specular, given.KHR_materials_clearcoat
        old, through = given.KHR_materials_pbrSpecularGlossiness, given.KHR_materials_transmission
        coats = coat and (
            coat.clearcoatTexture or coat.clearcoatRoughnessTexture or coat.clearcoatNormalTexture
        )
        for kind, info in (
            ("normal", surface.normalTexture),
            ("occlusion", surface.occlusionTexture),
            ("clearcoat", coats),
            ("specular", specular and (specular.specularTexture or specular.specularColorTexture)),
            ("transmission", through and through.transmissionTexture),
            ("specular-glossiness", old and old.specularGlossinessTexture),
        ):
            self.unused[kind] += bool(info)
        self.unused = +self.unused

    def _unit(self, value: float) -> float:
        return self._clipped(value, 0.0, 1.0)

    def _clipped(self, value: float, least: float, most: float) -> float:
        inside = min(max(value, least), most)
        if abs(inside - value) > 1e-5:
            self._outside = True
        return inside
