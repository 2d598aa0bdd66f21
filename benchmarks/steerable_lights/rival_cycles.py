"""The fixed lamps of this benchmark in Cycles, one light group each; run by ``fixed_lights.py`` with bpy to be found.

Arguments: the scene (.npz), the picture to write (.exr, all groups), samples, seed.
"""

from __future__ import annotations

import json
import sys
import time

import bpy
import mathutils
import numpy as np


def main() -> None:
    source, target, samples, seed = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    given = np.load(source)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    _surfaces(scene, given)
    _camera(scene, given)
    for k, (at, intensity) in enumerate(zip(given["lamps"], given["intensities"], strict=True)):
        light = bpy.data.lights.new(f"lamp{k}", "POINT")
        light.energy, light.shadow_soft_size = float(4 * np.pi**2 * intensity), float(given["radius"])
        thing = bpy.data.objects.new(f"lamp{k}", light)
        thing.location = at.tolist()
        thing.visible_camera = False
        scene.collection.objects.link(thing)
        bpy.context.view_layer.lightgroups.add(name=f"g{k:02}")
        thing.lightgroup = f"g{k:02}"
    render, cycles = scene.render, scene.cycles
    render.engine, cycles.device, cycles.samples, cycles.seed = "CYCLES", "CPU", samples, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = int(given["depth"]) - 2
    cycles.sample_clamp_indirect = cycles.sample_clamp_direct = 0.0
    render.threads_mode, render.threads = "FIXED", int(given["threads"])
    if hasattr(render.image_settings, "media_type"):
        render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    render.filepath = target
    started, worked = time.perf_counter(), time.process_time()
    bpy.ops.render.render(write_still=True)
    said = {
        "seconds": time.perf_counter() - started,
        "processor_seconds": time.process_time() - worked,
        "version": f"Cycles of Blender {bpy.app.version_string}",
    }
    print("FOUND " + json.dumps(said), flush=True)


def _surfaces(scene: bpy.types.Scene, given: np.lib.npyio.NpzFile) -> None:
    for n, colour in enumerate(given["colours"]):
        corners = given["triangles"][given["material_of"] == n]
        if not len(corners):
            continue
        vertices, index = np.unique(corners, return_inverse=True)
        mesh = bpy.data.meshes.new(f"part{n}")
        mesh.from_pydata(given["positions"][vertices].tolist(), [], index.reshape(-1, 3).tolist())
        material = bpy.data.materials.new(f"part{n}")
        material.use_nodes = True
        nodes = material.node_tree.nodes
        nodes.clear()
        diffuse, out = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
        diffuse.inputs["Color"].default_value = (*map(float, colour), 1.0)
        material.node_tree.links.new(diffuse.outputs[0], out.inputs[0])
        mesh.materials.append(material)
        scene.collection.objects.link(bpy.data.objects.new(f"part{n}", mesh))


def _camera(scene: bpy.types.Scene, given: np.lib.npyio.NpzFile) -> None:
    camera = bpy.data.cameras.new("eye")
    camera.sensor_fit, camera.angle = "VERTICAL", float(np.radians(given["fov"]))
    eye = bpy.data.objects.new("eye", camera)
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = (
        given["axes"].T,
        given["eye"],
    )  # right, up and back, as Blender's camera has them
    eye.matrix_world = mathutils.Matrix(frame.tolist())
    scene.collection.objects.link(eye)
    scene.camera = eye
    scene.render.resolution_x = scene.render.resolution_y = int(given["size"])
    scene.render.resolution_percentage = 100


if __name__ == "__main__":
    main()
