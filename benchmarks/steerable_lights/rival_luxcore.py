"""The fixed lamps of this benchmark in LuxCore, one light group each; run by ``fixed_lights.py`` with pyluxcore to be
found.

Arguments: the scene (.npz), the pictures to write (.npy), samples, seed.
"""

from __future__ import annotations

import json
import os
import sys
import time

import numpy as np
import pyluxcore


def main() -> None:
    source, target, samples, seed = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    given = np.load(source)
    pyluxcore.Init(lambda _: None)
    scene = pyluxcore.Scene()
    lines = _camera(given)
    for n, colour in enumerate(given["colours"]):
        corners = given["triangles"][given["material_of"] == n]
        if len(corners):
            vertices, index = np.unique(corners, return_inverse=True)
            points = [tuple(p) for p in given["positions"][vertices].tolist()]
            faces = [tuple(f) for f in index.reshape(-1, 3).tolist()]
            scene.DefineMesh(f"mesh{n}", points, faces, None, None, None, None)
            lines += [
                f"scene.materials.part{n}.type = matte",
                f"scene.materials.part{n}.kd = {' '.join(f'{c:.6f}' for c in colour)}",
                f"scene.objects.part{n}.shape = mesh{n}",
                f"scene.objects.part{n}.material = part{n}",
            ]
    for k, (at, intensity) in enumerate(zip(given["lamps"], given["intensities"], strict=True)):
        lines += [
            f"scene.lights.lamp{k}.type = sphere",
            f"scene.lights.lamp{k}.position = {' '.join(f'{x:.6f}' for x in at)}",
            f"scene.lights.lamp{k}.radius = {float(given['radius']):.6f}",
            f"scene.lights.lamp{k}.gain = {intensity:.6f} {intensity:.6f} {intensity:.6f}",
            f"scene.lights.lamp{k}.id = {k}",
        ]
    described = pyluxcore.Properties()
    described.SetFromString("\n".join(lines) + "\n")
    scene.Parse(described)
    size, count = int(given["size"]), len(given["lamps"])
    how = [
        "renderengine.type = PATHCPU", "sampler.type = RANDOM", f"renderengine.seed = {seed + 1}",
        f"path.pathdepth.total = {int(given['depth']) - 1}", f"path.pathdepth.diffuse = {int(given['depth']) - 1}",
        f"native.threads.count = {int(given['threads'])}", f"batch.haltspp = {samples}",
        f"film.width = {size}", f"film.height = {size}",
        *(f"film.outputs.{k}.{rest}" for k in range(count) for rest in (
            "type = RADIANCE_GROUP", f"id = {k}", f"filename = g{k}.exr",
        )),
    ]  # fmt: skip
    settings = pyluxcore.Properties()
    settings.SetFromString("\n".join(how) + "\n")
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(settings, scene))
    started, worked = time.perf_counter(), time.process_time()
    session.Start()
    while not session.HasDone():
        time.sleep(0.02)
        session.UpdateStats()
    seconds, processor = time.perf_counter() - started, time.process_time() - worked
    session.Stop()
    found = np.empty((count, size, size, 3), np.float32)
    for k in range(count):
        one = np.empty((size, size, 3), np.float32)
        session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RADIANCE_GROUP, one, k)
        found[k] = one[::-1]
    np.save(target, found)
    print(
        "FOUND "
        + json.dumps(
            {"seconds": seconds, "processor_seconds": processor, "version": f"LuxCore {pyluxcore.Version()}"}
        ),
        flush=True,
    )
    os._exit(0)  # its threads do not always end well, and the pictures are written


def _camera(given: np.lib.npyio.NpzFile) -> list[str]:
    eye, axes = given["eye"], given["axes"]
    target, size = eye - axes[2], float(given["fov"])

    def words(v: np.ndarray) -> str:
        return " ".join(f"{x:.6f}" for x in v)

    return [
        "scene.camera.type = perspective",
        f"scene.camera.lookat.orig = {words(eye)}",
        f"scene.camera.lookat.target = {words(target)}",
        f"scene.camera.up = {words(axes[1])}",
        f"scene.camera.fieldofview = {size}",
    ]


if __name__ == "__main__":
    main()
