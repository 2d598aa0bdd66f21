"""Sensors of a Mitsuba scene as cameras."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from ...camera import Camera
from ...errors import InputError
from ..mesh import short_name
from .node import Node, is_transform
from .shapes import matrix_of

_FILM = (768, 576)  # Mitsuba's, where none is given
_DIAGONAL_35MM = math.hypot(36, 24)


def cameras_of(root: Node, unread: Counter[str]) -> dict[str, Camera]:
    """Perspective and thin-lens sensors by name, as pinholes."""
    cameras: dict[str, Camera] = {}
    for number, sensor in enumerate(root.of_kind("Sensor")):
        if sensor.plugin not in ("perspective", "thinlens"):
            unread[f"sensors of type {short_name(sensor.plugin)} not read"] += 1
            continue
        if sensor.plugin == "thinlens":
            unread["thin lenses read as pinholes"] += 1
        camera = _camera(sensor, unread)
        if camera is None:
            unread["sensors without a usable frame or field of view not read"] += 1
            continue
        name = short_name(sensor.name or "camera")
        cameras[name if name not in cameras else f"{name} {number + 1}"] = camera
    return cameras


def _camera(sensor: Node, unread: Counter[str]) -> Camera | None:
    values = sensor.values
    matrix = matrix_of(values["to_world"]) if is_transform(values.get("to_world")) else np.eye(4)
    if np.linalg.det(matrix[:3, :3]) < 0:
        unread["mirrored sensors read the right way round"] += 1
    if any(values.get(f"principal_point_offset_{axis}", 0) for axis in "xy"):
        unread["shifted lenses read as centred"] += 1
    width, height = _film(sensor)
    try:
        angle = _vertical_angle(sensor, width / height)
        eye, forward, up = matrix[:3, 3], matrix[:3, 2], matrix[:3, 1]
        target = eye + forward / max(float(np.linalg.norm(forward)), 1e-30)
        return Camera(tuple(eye), tuple(target), tuple(up), vertical_fov_deg=math.degrees(angle))
    except (InputError, ValueError, OverflowError, ZeroDivisionError):
        return None


def _film(sensor: Node) -> tuple[int, int]:
    film = next(iter(sensor.of_kind("Film")), None)
    if film is None:
        return _FILM
    width, height = film.values.get("size", (film.values.get("width"), film.values.get("height")))
    return int(width or _FILM[0]), int(height or _FILM[1])


def _vertical_angle(sensor: Node, aspect: float) -> float:
    """In radians, of what ``fov`` and ``fov_axis`` or ``focal_length`` say of a film this wide for its height."""
    if "focal_length" in sensor.values and "fov" not in sensor.values:
        millimetres = float(str(sensor.values["focal_length"]).removesuffix("mm"))
        half, axis = math.atan(_DIAGONAL_35MM / 2 / millimetres), "diagonal"
    else:
        half = math.radians(float(sensor.values.get("fov", 50.0))) / 2
        axis = sensor.values.get("fov_axis", "x")
    axis = {"smaller": "x" if aspect < 1 else "y", "larger": "y" if aspect < 1 else "x"}.get(axis, axis)
    slope = math.tan(half)
    if axis == "x":
        slope /= aspect
    elif axis == "diagonal":
        slope /= math.hypot(aspect, 1)
    return 2 * math.atan(slope)
