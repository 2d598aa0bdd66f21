"""Linear radiance to a display: exposure, a tone curve, sRGB.

References
----------
IEC 61966-2-1:1999 (sRGB).  E. Reinhard et al., "Photographic Tone Reproduction for Digital Images", 2002
(the log-average as a light meter).  K. Naka and W. Rushton, 1966 (the shape of the filmic curve).
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ..arrays import Bytes, Float32, Picture
from ..errors import InputError

CURVES = ("filmic", "linear")
MIDDLE_GREY = 0.18
_BRIGHTER = 1.3  # stops above the meter's reading: the shoulder is soft, and models are mostly pale
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)  # of linear Rec.709
_STEPS = 65_536  # of the table from linear display values to bytes: a twentieth of a byte in the blacks

# The filmic curve: f(x) = top·xⁿ / (xⁿ + c) through middle grey unchanged, reaching 1 at the white point.
_CONTRAST = 1.375  # n; the slope at middle grey is 1.13 stops a stop
_WHITE = 16.0  # 6.5 stops above middle grey
_MIXED = 0.16  # how much of each channel becomes grey before the curve: strong lights fade to white
_UNMIXED = 0.13  # how much of that is taken back after it: plain colours keep their strength
_HUE_KEPT = 0.35  # how much the curve works on the brightest channel alone, which keeps the hue
_PIXELS_AT_ONCE = 32_768  # pixels; a block stays in the cache


def srgb_encode(linear: Float32[np.ndarray, "..."]) -> Float32[np.ndarray, "..."]:
    """Linear display values in [0, 1] to sRGB-encoded values in [0, 1]; values outside are clipped."""
    x = np.clip(linear, 0.0, 1.0).astype(np.float32)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** np.float32(1 / 2.4) - 0.055).astype(np.float32)


def srgb_decode(encoded: Float32[np.ndarray, "..."]) -> Float32[np.ndarray, "..."]:
    """The inverse of ``srgb_encode``; bytes are divided by 255 first."""
    y = np.asarray(encoded)
    y = np.clip(y / np.float32(255) if y.dtype == np.uint8 else y, 0.0, 1.0).astype(np.float32)
    return np.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** np.float32(2.4)).astype(np.float32)


@lru_cache(maxsize=1)
def _byte_table() -> Bytes:
    steps = srgb_encode(np.linspace(0.0, 1.0, _STEPS, dtype=np.float32))
    return np.rint(steps * 255).astype(np.uint8)


def _to_bytes(display: Picture) -> Bytes:
    """Linear display values to sRGB bytes, NaN to 0; changes its argument."""
    np.fmax(display, 0.0, out=display)  # fmax, unlike maximum, takes the number where there is a NaN
    np.minimum(display, 1.0, out=display)
    display *= _STEPS - 1
    display += 0.5
    return _byte_table()[display.astype(np.uint16)]


def exposure_for(picture: Picture, mask: np.ndarray | None = None) -> float:
    """An exposure in stops that shows the picture, or the part of it under a mask, well.

    A light meter that looks at typical pixels: the mean of log₂ luminance over the middle half of them
    (25th to 75th percentile, so that neither a sun nor a deep shadow counts) is brought to middle grey,
    0.18, then raised by 1.3 stops.

    Parameters
    ----------
    picture
        Linear radiance (H, W, 3).
    mask
        Boolean (H, W): what matters, as the object without the environment behind it. All, if None or empty.

    Returns
    -------
    Stops: radiance is multiplied by 2 to this power. 0 where no pixel is above 0.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # NaN and infinities are left out below
        luminance = picture @ _LUMINANCE
    if mask is not None and mask.any():
        luminance = luminance[mask]
    lit = luminance[(luminance > 1e-30) & (luminance < np.inf)]
    if not lit.size:
        return 0.0
    low, high = np.quantile(lit, [0.25, 0.75])
    typical = lit[(lit >= low) & (lit <= high)]
    return float(np.log2(MIDDLE_GREY) - np.log2(typical, dtype=np.float64).mean()) + _BRIGHTER


def _filmic_constants() -> tuple[float, float]:
    """c and top of the curve, from middle grey unchanged and white at 1."""
    grey, white = MIDDLE_GREY**_CONTRAST, _WHITE**_CONTRAST
    c = grey * (1.0 - MIDDLE_GREY) / (MIDDLE_GREY - grey / white)
    return c, 1.0 + c / white


def _mixing(share: float) -> Float32[np.ndarray, "3 3"]:
    """Moves each channel towards the mean of the three; grey stays as it is."""
    return ((1.0 - share) * np.eye(3) + share / 3.0).astype(np.float32)


def _shoulder(x: Float32[np.ndarray, "..."]) -> Float32[np.ndarray, "..."]:
    """The filmic curve by itself; x not negative."""
    c, top = _filmic_constants()
    x = np.minimum(x, np.float32(_WHITE))
    root = np.sqrt(np.sqrt(x))
    x *= root
    x *= np.sqrt(root)  # x to the power 1.375, several times as fast as power()
    x /= (x + np.float32(c)) * np.float32(1.0 / top)
    return x


def _filmic(x: Float32[np.ndarray, "pixels 3"]) -> Float32[np.ndarray, "pixels 3"]:
    """Scene-linear, exposed, not negative, to linear display values."""
    x = x @ _mixing(_MIXED)
    brightest = np.maximum(np.maximum(x[:, 0], x[:, 1]), x[:, 2])[:, None]
    level = _shoulder(brightest)
    square = level * level
    kept = np.float32(_HUE_KEPT) * (1 - square * square)  # none at white, or a strong colour would never fade
    display = _shoulder(x)
    display *= 1 - kept
    x *= kept * level / np.maximum(brightest, np.float32(1e-20))
    display += x
    return display @ np.linalg.inv(_mixing(_UNMIXED))


def tonemap(picture: Picture, *, exposure: float = 0.0, curve: str = "filmic") -> Bytes:
    """Linear Rec.709 radiance (H, W, 3) to sRGB bytes (H, W, 3).

    Parameters
    ----------
    picture
        Linear radiance, any scale; negative values and NaN are shown black, infinities white.
    exposure
        Stops; radiance is multiplied by 2 to this power first (see ``exposure_for``).
    curve
        ``"filmic"``: middle grey stays 0.18, a little contrast around it, a soft shoulder that reaches
        white 6.5 stops above it; strong colours fade to white as they brighten and turn their hue little.
        ``"linear"``: clipped at 1, for measurements and comparisons.

    Raises
    ------
    InputError
        If the exposure is not finite or the curve unknown.
    """
    if curve not in CURVES:
        raise InputError("curve", f"{curve!r} is unknown, expected one of {', '.join(CURVES)}")
    if not math.isfinite(exposure):
        raise InputError("exposure", f"{exposure} stops, expected a finite number")
    gain = np.float32(2.0 ** min(max(exposure, -120.0), 120.0))
    pixels = picture.reshape(-1, 3)
    out = np.empty(pixels.shape, np.uint8)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        for start in range(0, len(pixels), _PIXELS_AT_ONCE):
            x = pixels[start : start + _PIXELS_AT_ONCE] * gain
            if curve == "filmic":
                np.fmax(x, 0.0, out=x)
                np.minimum(x, 1e6, out=x)  # keeps an infinity from becoming NaN in the mixing
                x = _filmic(x)
            out[start : start + _PIXELS_AT_ONCE] = _to_bytes(x)
    return out.reshape(picture.shape)
