"""Images as bytes for a live sum: signed bytes in blocks of 64 values with a scale each, one or two planes an image.

A picture is Σ_k w_k·C_k. Image k is one plane of bytes; where a byte is too coarse, a second plane holds what the first
leaves (so 15 bits in all), and takes the same weight. Blocks are consecutive pixels of one channel; all planes of a
block lie side by side, a cache line each, so that a relight reads memory from end to end once.

A few pixels are far brighter than the rest: a lamp in a mirror. In a block with them, bytes would leave nothing of
their neighbours, so they are kept apart as numbers, and are zero in the planes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..arrays import Float32, Float64, Int32
from ..errors import InputError

BLOCK = 64
_LEVELS = 127


@dataclass(frozen=True)
class BytePlanes:
    """What is kept of K images of so many pixels, three channels each.

    ``bytes`` (blocks, 3, planes, 64) int8 and ``scales`` (blocks, 3, planes): value = byte × scale. ``image_of``
    (planes,) says whose plane it is; ``salience`` (planes, 3) is the mean absolute value of a plane in each channel.
    ``bright`` (B,) are the pixels kept apart, in rising order, with ``bright_values`` (3, K, B).
    """

    pixels: int
    bytes: np.ndarray
    scales: Float32[np.ndarray, "blocks channels planes"]
    image_of: Int32[np.ndarray, "planes"]
    salience: Float64[np.ndarray, "planes 3"]
    bright: Int32[np.ndarray, "bright"] = field(default_factory=lambda: np.zeros(0, np.int32))
    bright_values: Float32[np.ndarray, "3 images bright"] = field(
        default_factory=lambda: np.zeros((3, 0, 0), np.float32)
    )

    def __post_init__(self) -> None:
        blocks, planes = -(-self.pixels // BLOCK), len(self.image_of)
        fits = (
            self.pixels > 0
            and self.bytes.dtype == np.int8
            and self.bytes.shape == (blocks, 3, planes, BLOCK)
            and self.scales.dtype == np.float32
            and self.scales.shape == (blocks, 3, planes)
            and self.salience.shape == (planes, 3)
            and (planes == 0 or int(self.image_of.min()) >= 0)
            and self._apart_fits()
        )
        if not fits:
            raise InputError("planes", "bytes, scales and planes do not fit together")

    def _apart_fits(self) -> bool:
        index, values = self.bright, self.bright_values
        return (
            index.ndim == 1
            and values.ndim == 3
            and values.dtype == np.float32
            and (len(values), values.shape[2]) == (3, len(index))
            and (
                not len(index)
                or (
                    values.shape[1] > int(self.image_of.max(initial=0))
                    and int(index[0]) >= 0
                    and int(index[-1]) < self.pixels
                    and bool((np.diff(index) > 0).all())
                )
            )
        )

    @property
    def planes(self) -> int:
        """How many planes of bytes there are."""
        return len(self.image_of)

    @property
    def size(self) -> int:
        """Bytes in all."""
        return self.bytes.nbytes + self.scales.nbytes + self.bright.nbytes + self.bright_values.nbytes

    def add_bright(self, weights: np.ndarray, picture: Float32[np.ndarray, "pixels 3"]) -> None:
        """Add the pixels kept apart to a picture, in place; weights (3, K) of the images."""
        if len(self.bright):
            for c in range(3):
                picture[self.bright, c] += weights[c].astype(np.float32) @ self.bright_values[c]

    def decoded(self, images: int, part: slice = slice(None)) -> Float32[np.ndarray, "images pixels 3"]:
        """The images as they are kept, (images, pixels, 3); of a part of the pixels that begins with a block."""
        first, stop, _ = part.indices(self.pixels)
        blocks = slice(first // BLOCK, -(-stop // BLOCK))
        values = self.bytes[blocks] * self.scales[blocks][..., None]  # (blocks, 3, planes, 64)
        flat = values.transpose(2, 0, 3, 1).reshape(self.planes, -1, 3)[:, : stop - first]
        found = np.zeros((images, stop - first, 3), np.float32)
        np.add.at(found, self.image_of, flat)
        low, high = np.searchsorted(self.bright, (first, stop))
        apart = self.bright_values[:, :, low:high]
        found[: apart.shape[1], self.bright[low:high] - first] += apart.transpose(1, 2, 0)
        return found


def _blocked(image: np.ndarray, bright: np.ndarray) -> np.ndarray:
    """(pixels, 3) as (blocks, 3, 64), zeros behind the last pixel and for the bright ones."""
    blocks = -(-len(image) // BLOCK)
    padded = np.zeros((blocks * BLOCK, 3), np.float32)
    padded[: len(image)] = image
    padded[bright] = 0.0
    return padded.reshape(blocks, BLOCK, 3).transpose(0, 2, 1)


def _quantized(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bytes, scales and what they leave of blocks (blocks, 3, 64)."""
    scales = np.abs(values).max(axis=-1) / np.float32(_LEVELS)
    steps = np.divide(values, scales[..., None], out=np.zeros_like(values), where=scales[..., None] > 0)
    found = np.rint(np.clip(steps, -_LEVELS, _LEVELS)).astype(np.int8)
    return found, scales.astype(np.float32), values - found * scales[..., None]


def one_plane_errors(
    images: np.ndarray, *, bright: np.ndarray | None = None
) -> Float64[np.ndarray, "images"]:
    """Mean squared error of each image (K, pixels, 3) as one plane of bytes, but for the bright pixels (B,)."""
    bright = np.zeros(0, np.int32) if bright is None else bright
    found = []
    for image in images:
        left = _quantized(_blocked(image, bright))[2]
        found.append(float(np.square(left, dtype=np.float64).sum() / image.size))
    return np.array(found)


def two_planes_needed(errors: np.ndarray, allowed: float) -> np.ndarray:
    """Which images, those with the largest errors first, need two planes so that Σ errors is at most ``allowed``."""
    order = np.argsort(errors)[::-1]
    left = errors.sum() - np.concatenate([[0.0], np.cumsum(errors[order])])
    number = int(np.argmax(left <= allowed)) if (left <= allowed).any() else len(errors)
    chosen = np.zeros(len(errors), bool)
    chosen[order[:number]] = True
    return chosen


def far_brighter(images: np.ndarray) -> Int32[np.ndarray, "bright"]:
    """Pixels of images (K, pixels, 3) to be kept apart: beyond twice what 99 % of all pixels stay below.

    Measured by the root of Σ_k value², the picture of all lights together. At most one in a hundred, so.
    """
    loudness = np.zeros(images.shape[1], np.float32)
    for image in images:
        loudness += np.square(image).max(axis=1)
    return np.flatnonzero(loudness > 4.0 * np.percentile(loudness, 99.0)).astype(np.int32)


def encoded(
    images: np.ndarray, *, twice: np.ndarray | None = None, bright: np.ndarray | None = None
) -> BytePlanes:
    """Planes of images (K, pixels, 3) float32; ``twice`` (K,) says which get two, ``bright`` (B,) which pixels
    are kept apart.

    Raises InputError for other shapes, and values that are not finite.
    """
    if images.ndim != 3 or images.shape[2] != 3 or not images.shape[1] or images.dtype != np.float32:
        raise InputError("images", f"{images.dtype} {images.shape}, expected float32 (images, pixels, 3)")
    twice = np.zeros(len(images), bool) if twice is None else twice
    bright = np.zeros(0, np.int32) if bright is None else bright
    image_of = np.repeat(np.arange(len(images)), 1 + twice).astype(np.int32)
    blocks, pixels = -(-images.shape[1] // BLOCK), images.shape[1]
    data = np.empty((blocks, 3, len(image_of), BLOCK), np.int8)
    scales = np.empty((blocks, 3, len(image_of)), np.float32)
    salience = np.empty((len(image_of), 3))
    plane = 0
    for image, two in zip(images, twice, strict=True):
        if not np.isfinite(image).all():
            raise InputError("images", "a value is not finite; render them again")
        left = _blocked(image, bright)
        for _ in range(2 if two else 1):
            salience[plane] = np.abs(left, dtype=np.float64).sum(axis=(0, 2)) / pixels
            data[:, :, plane], scales[:, :, plane], left = _quantized(left)
            plane += 1
    apart = np.ascontiguousarray(images[:, bright].transpose(2, 0, 1))
    return BytePlanes(pixels, data, scales, image_of, salience, bright, apart)
