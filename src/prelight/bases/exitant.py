"""Exitant radiance in spherical harmonics, fitted on the hemisphere: a surface's lobes for light from any angle.

What leaves a surface is known on its hemisphere alone, and harmonics live on the sphere: their coefficients are
those of least squares on the hemisphere (Sloan, Hall, Hart and Snyder 2003), here weighted by the cosine, so that
no energy is lost and errors count as a picture shows them. For an isotropic surface the problem falls apart into
one of each azimuthal frequency m, because f depends on the difference of azimuths alone and is even in it:

    f(θᵢ, θₒ, φₒ − φᵢ) ≈ Σ_m Σ_{l ≥ m} p_lm(θᵢ) · Λ_lm(θₒ) · cos m(φₒ − φᵢ),    Y_l±m = Λ_lm(θ) · (cos | sin) mφ.

A *lobe table* is p, for angles of incidence in steps of a degree or so. Functions (l, m ≥ 0) stand by m, then l.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ..arrays import Float32, Float64, Int64
from .spherical_harmonics import components

MOST_ORDER = 16
INCIDENT = 90  # angles of incidence in a table, in the middles of equal steps from 0 to 90°
_EXITANT = 32  # nodes of the polar angle where a BRDF is asked
_AZIMUTHS = 48  # of half a turn
HIGHLIGHT = (48, 24, 9)  # nodes of a highlight table: half vector, difference, azimuth
_RELATIVE = 1e-5  # singular values below this share of the largest are noise

BrdfValues = Float64[np.ndarray, "incident exitant azimuths channels"]


def count(order: int) -> int:
    """Functions of a table: (order + 1)(order + 2) / 2."""
    return (order + 1) * (order + 2) // 2


def order_of(functions: int) -> int:
    """n of a table of so many functions, rounded down where there is none."""
    return (math.isqrt(8 * functions + 1) - 3) // 2


def starts(order: int) -> Int64[np.ndarray, "frequencies+1"]:
    """Where the functions of each m begin."""
    return np.concatenate([[0], np.cumsum(np.arange(order + 1, 0, -1))]).astype(np.int64)


def polar(order: int, cosines: np.ndarray) -> Float64[np.ndarray, "functions angles"]:
    """Λ_lm at cosines of the polar angle."""
    z = np.asarray(cosines, np.float64)
    values = components(order, np.sqrt(np.maximum(1 - z * z, 0)), np.zeros_like(z), z)  # at azimuth 0
    return np.stack([values[l * (l + 1) + m] for m in range(order + 1) for l in range(m, order + 1)])


@lru_cache(maxsize=1)
def nodes() -> tuple[
    Float64[np.ndarray, "incident"], Float64[np.ndarray, "exitant"], Float64[np.ndarray, "a"]
]:
    """Where a BRDF is asked for a table: angles of incidence, cosines of the exitant angle, azimuths 0 to π."""
    incident = (np.arange(INCIDENT) + 0.5) * (0.5 * np.pi / INCIDENT)
    x, _ = np.polynomial.legendre.leggauss(_EXITANT)
    return incident, 0.5 * (x + 1), (np.arange(_AZIMUTHS) + 0.5) * (np.pi / _AZIMUTHS)


def _weights() -> Float64[np.ndarray, "exitant"]:
    """∫ g dz over (0, 1) is their sum times g at the nodes."""
    return 0.5 * np.polynomial.legendre.leggauss(_EXITANT)[1]


def lobe_table(values: BrdfValues, order: int) -> Float32[np.ndarray, "incident channels functions"]:
    """p of a BRDF given at ``nodes``, 1/sr without any cosine."""
    _, z, azimuth = nodes()
    weight = np.sqrt(_weights() * z)
    table, at = np.empty((INCIDENT, values.shape[3], count(order))), starts(order)
    functions = polar(order, z)
    for m in range(order + 1):
        wave = np.cos(m * azimuth) * ((1 if m == 0 else 2) / _AZIMUTHS)
        of_m = np.einsum("ieac,a->eic", values, wave).reshape(_EXITANT, -1)
        basis = functions[at[m] : at[m + 1]].T
        fitted = np.linalg.lstsq(basis * weight[:, None], of_m * weight[:, None], rcond=_RELATIVE)[0]
        table[:, :, at[m] : at[m + 1]] = fitted.reshape(len(fitted), INCIDENT, -1).transpose(1, 2, 0)
    return table.astype(np.float32)


def half_angle_pairs() -> tuple[Float64[np.ndarray, "pairs 3"], Float64[np.ndarray, "pairs 3"]]:
    """Two unit directions for each element of a highlight table; one of them may be below the horizon.

    Rusinkiewicz's coordinates (A new change of variables for efficient BRDF representation, 1998), in which a lobe is
    alike for all angles: √sin θ_h of the half vector, cos θ_d of a direction to it, and cos² of its azimuth about it,
    each from 0 to 1 in equal steps of ``HIGHLIGHT`` nodes.
    """
    root, cosine, square = np.meshgrid(*(np.linspace(0, 1, n) for n in HIGHLIGHT), indexing="ij")
    sine_h = (root**2).ravel()
    cosine_h, z = np.sqrt(1 - sine_h**2), cosine.ravel()
    across = np.sqrt(1 - z * z)
    x, y = across * np.sqrt(square.ravel()), across * np.sqrt(1 - square.ravel())
    one = np.stack([cosine_h * x + sine_h * z, y, cosine_h * z - sine_h * x], axis=1)
    half = np.stack([sine_h, 0 * sine_h, cosine_h], axis=1)
    return one, 2 * z[:, None] * half - one


def highlight_table(
    values: Float64[np.ndarray, "pairs channels"],
) -> Float32[np.ndarray, "halves differences azimuths channels"]:
    """f · cos θᵢ · cos θₒ of a BRDF given at ``half_angle_pairs``: no more than finite, and 0 from the horizon on."""
    one, other = half_angle_pairs()
    cosines = np.maximum(one[:, 2], 0) * np.maximum(other[:, 2], 0)
    return (values * cosines[:, None]).reshape(*HIGHLIGHT, -1).astype(np.float32)


def directional_albedo(values: BrdfValues) -> Float64[np.ndarray, "incident channels"]:
    """Share of light from each angle that leaves the surface: ∫ f cos θₒ dωₒ."""
    _, z, _ = nodes()
    return 2 * np.pi * np.einsum("ieac,e->ic", values, _weights() * z) / _AZIMUTHS


def mean_albedo(values: BrdfValues) -> Float64[np.ndarray, "channels"]:
    """Share of even light that leaves the surface."""
    incident, _, _ = nodes()
    weight = np.sin(2 * incident)
    return weight @ directional_albedo(values) / weight.sum()


def fit_error(values: BrdfValues, order: int) -> float:
    """What the fit leaves: RMS over pairs of directions, both weighted by their cosines, as a share of the BRDF's."""
    incident, z, azimuth = nodes()
    table, at, functions = lobe_table(values, order), starts(order), polar(order, z)
    fitted = np.zeros(values.shape)
    for m in range(order + 1):
        of_m = np.einsum("icp,pe->iec", table[:, :, at[m] : at[m + 1]], functions[at[m] : at[m + 1]])
        fitted += of_m[:, :, None] * np.cos(m * azimuth)[None, None, :, None]
    weight = (np.sin(2 * incident)[:, None] * (_weights() * z))[:, :, None, None]
    whole = float((weight * values**2).sum())
    return float(np.sqrt((weight * (fitted - values) ** 2).sum() / whole)) if whole else 0.0


def milliseconds(rows: int, order: int) -> float:
    """What a change of light takes for so many glossy vertices, about, on two cores: measured."""
    return rows * (5 + 0.6 * (2 * order + 1)) * 1e-3
