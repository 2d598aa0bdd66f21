"""Images as bytes for a live sum: signed bytes in blocks of 64 values with a scale each, one or two planes an image.

A picture is Σ_k w_k·C_k. Image k is one plane of bytes; where a byte is too coarse, a second plane holds what the first
leaves (so 15 bits in all), and takes the same weight. Blocks are consecutive pixels of one channel; all planes of a
block lie side by side, a cache line each, so that a relight reads memory from end to end once.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    """

    pixels: int
    bytes: np.ndarray
    scales: Float32[np.ndarray, "blocks channels planes"]
    image_of: Int32[np.ndarray, "planes"]
    salience: Float64[np.ndarray, "planes 3"]

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
        )
        if not fits:
            raise InputError("planes", "bytes, scales and planes do not fit together")

    @property
    def planes(self) -> int:
        """How many planes of bytes there are."""
        return len(self.image_of)

    @property
    def size(self) -> int:
        """Bytes in all."""
        return self.bytes.nbytes + self.scales.nbytes

    def decoded(self, images: int) -> Float32[np.ndarray, "images pixels 3"]:
        """The images as they are kept, (images, pixels, 3)."""
        values = self.bytes * self.scales[..., None]  # (blocks, 3, planes, 64)
        flat = values.transpose(2, 0, 3, 1).reshape(self.planes, -1, 3)[:, : self.pixels]
        found = np.zeros((images, self.pixels, 3), np.float32)
        np.add.at(found, self.image_of, flat)
        return found


def _blocked(image: np.ndarray) -> np.ndarray:
    """(pixels, 3) as (blocks, 3, 64), zeros behind the last pixel."""
    blocks = -(-len(image) // BLOCK)
    padded = np.zeros((blocks * BLOCK, 3), np.float32)
    padded[: len(image)] = image
    return padded.reshape(blocks, BLOCK, 3).transpose(0, 2, 1)


def _quantized(values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bytes, scales and what they leave of blocks (blocks, 3, 64)."""
    scales = np.abs(values).max(axis=-1) / np.float32(_LEVELS)
    steps = np.divide(values, scales[..., None], out=np.zeros_like(values), where=scales[..., None] > 0)
    found = np.rint(np.clip(steps, -_LEVELS, _LEVELS)).astype(np.int8)
    return found, scales.astype(np.float32), values - found * scales[..., None]


def one_plane_errors(images: np.ndarray) -> Float64[np.ndarray, "images"]:
    """Mean squared error of each image (K, pixels, 3) as one plane of bytes."""
    found = []
    for image in images:
        left = _quantized(_blocked(image))[2]
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


def encoded(images: np.ndarray, *, twice: np.ndarray | None = None) -> BytePlanes:
    """Planes of images (K, pixels, 3) float32; ``twice`` (K,) says which get two.

    Raises InputError for other shapes, and values that are not finite.
    """
    if images.ndim != 3 or images.shape[2] != 3 or not images.shape[1] or images.dtype != np.float32:
        raise InputError("images", f"{images.dtype} {images.shape}, expected float32 (images, pixels, 3)")
    twice = np.zeros(len(images), bool) if twice is None else twice
    image_of = np.repeat(np.arange(len(images)), 1 + twice).astype(np.int32)
    blocks, pixels = -(-images.shape[1] // BLOCK), images.shape[1]
    data = np.empty((blocks, 3, len(image_of), BLOCK), np.int8)
    scales = np.empty((blocks, 3, len(image_of)), np.float32)
    salience = np.empty((len(image_of), 3))
    plane = 0
    for image, two in zip(images, twice, strict=True):
        left = _blocked(image)
        if not np.isfinite(left).all():
            raise InputError("images", "a value is not finite; render them again")
        for _ in range(2 if two else 1):
            salience[plane] = np.abs(left, dtype=np.float64).sum(axis=(0, 2)) / pixels
            data[:, :, plane], scales[:, :, plane], left = _quantized(left)
            plane += 1
    return BytePlanes(pixels, data, scales, image_of, salience)
