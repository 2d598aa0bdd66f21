"""Lights of a rig as Mitsuba is to see them: their true shapes, not what a basis holds of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..bases.steering import SpotBasis
from ..lighting.distributions import Distribution, Polynomial, Power, frame
from ..lighting.panel import Panel, soft_power
from ..lighting.places import Place
from ..lighting.spot import Spot
from ..relighting.steerable_layer import SteerableLayer
from ..relighting.stored_steerable import degree_of
from ..transport.steered_reference import Emission

_ROWS = 512  # of a measured shape between its poles

Light = Spot | Panel
_Beam = Callable[[Any], Any]  # of a direction: Mitsuba's colour


def emission_of(lights: Sequence[Light], layer: SteerableLayer, *, mi: Any) -> Emission:
    """What lights of one layer send out together, in Mitsuba's arithmetic: intensity W/sr, or radiance.

    Raises InputError for a light that the layer is not for.
    """
    for light in lights:
        light.coefficients(layer.basis, layer.place)  # says what does not fit
    parts = [
        _of_panel(light, layer, mi) if isinstance(light, Panel) else _of_spot(light, layer, mi)
        for light in lights
    ]

    def emission(mi: Any, d: Any, u: Any, v: Any) -> Any:
        total = mi.Color3f(0)
        for part in parts:
            total += part(mi, d, u, v)
        return total

    return emission


def _own_shape(layer: SteerableLayer) -> Distribution:
    basis = layer.basis
    if isinstance(basis, SpotBasis) and basis.parity != "all":
        return Polynomial((0.0,) * basis.degree + (1.0,))
    return Power(float(degree_of(basis) or 0))


def _of_spot(light: Spot, layer: SteerableLayer, mi: Any) -> Emission:
    beam = _beam(light, layer.place, _own_shape(layer), mi)
    intensity = light.intensity
    return lambda mi, d, u, v: beam(mi, d) * mi.Color3f(*intensity)


def _of_panel(light: Panel, layer: SteerableLayer, mi: Any) -> Emission:
    aimed = light.beam
    if aimed is None and degree_of(layer.basis) is not None:
        aimed = Spot((1.0, 1.0, 1.0), direction=light.ahead(layer.place))
    beam = None if aimed is None else _beam(aimed, layer.place, _own_shape(layer), mi)

    def emission(mi: Any, d: Any, u: Any, v: Any) -> Any:
        value = mi.Color3f(*light.radiance)
        for x, at, width in zip((u, v), light.position, light.width, strict=True):
            value *= _along_axis(mi, light.shape, x - at, width)
        if beam is not None and aimed is not None:
            value *= beam(mi, d) * mi.Color3f(*aimed.intensity)
        return value

    return emission


def _along_axis(mi: Any, shape: str, x: Any, width: float) -> Any:
    """As `lighting.panel.axis_shape`."""
    import drjit as dr

    if shape == "soft":
        power = 2 * soft_power(0.5 * width)
        return dr.select(dr.abs(x) < 0.5, dr.power(dr.abs(dr.cos(dr.pi * x)), power), 0)
    return dr.select(dr.abs(x) < 0.5 * width, 0.5 + 0.5 * dr.cos(2 * dr.pi / width * x), 0)


def _beam(spot: Spot, place: Place, own: Distribution, mi: Any) -> Callable[[Any, Any], Any]:
    """A spot's shape along directions of the world, without its colour."""
    left, up, ahead = frame(spot.aim(place), spot.roll_deg).T
    shape = spot.distribution or own
    table = (
        None if isinstance(shape, Power | Polynomial) else _measured(mi, shape)
    )  # not while paths are recorded

    def along(mi: Any, d: Any) -> Any:
        import drjit as dr

        x, y, z = (dr.dot(d, mi.Vector3f(*axis.tolist())) for axis in (left, up, ahead))
        if isinstance(shape, Power):
            return mi.Color3f(dr.power(dr.maximum(0.5 + 0.5 * z, 0), shape.power))
        if isinstance(shape, Polynomial):
            total = mi.Float(0)
            for factor in shape.coefficients[::-1]:
                total = total * z + factor
            return mi.Color3f(total)
        assert table is not None
        return table(mi.Vector3f(x, y, z))

    return along


def _measured(mi: Any, shape: Distribution) -> _Beam:
    """A shape known by its values: a table over its sphere, read between the entries."""
    import drjit as dr

    polar = (np.arange(_ROWS) + 0.5) * np.pi / _ROWS
    around = (np.arange(2 * _ROWS) + 0.5) * np.pi / _ROWS
    p, a = np.meshgrid(polar, around, indexing="ij")
    d = np.stack([np.sin(p) * np.cos(a), np.sin(p) * np.sin(a), np.cos(p)], axis=-1).reshape(-1, 3)
    values = np.broadcast_to(shape.along(d), (len(d), 3)).reshape(_ROWS, 2 * _ROWS, 3)
    table = mi.Texture2f(mi.TensorXf(np.ascontiguousarray(values, np.float32)), wrap_mode=dr.WrapMode.Repeat)

    def along(w: Any) -> Any:
        v = dr.safe_acos(w.z) * dr.inv_pi
        v = dr.clip(v, 0.5 / _ROWS, 1 - 0.5 / _ROWS)
        u = dr.atan2(w.y, w.x) * (0.5 * dr.inv_pi)
        return mi.Color3f(*table.eval(mi.Point2f(u - dr.floor(u), v)))

    return along
