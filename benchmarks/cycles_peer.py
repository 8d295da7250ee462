#!/usr/bin/env python3
"""Blender's Cycles as a peer of `tileflight render`: the same mesh, poses and lens, emission only.

    apt-get install --no-install-recommends blender python3-numpy
    tileflight extract  TILESET ... --out TRUTH
    tileflight render   TILESET ... --flight FLIGHT --png --depth --samples 16 --out DATASET
    python3 benchmarks/cycles_peer.py TRUTH/mesh.glb DATASET [--frames 4] [--samples 64] [--keep FOLDER]

Prints the seconds that a frame takes when everything is resident (the first frame, which builds the tree, is not
counted), and how the pictures differ: mean absolute difference out of 255 where the depth is smooth over 3 x 3 pixels.
DATASET's camera.yaml must be a pinhole without distortion or an equidistant fisheye whose coefficients are 0, with the
principal point in the middle. A picture with several samples is the oracle for lens and texture: one sample of Cycles
reads one texel, without the filter over a pixel's footprint that ours has.
"""
import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
import zlib

try:
    import bpy
except ImportError:  # outside of Blender
    bpy = None
if bpy:
    import mathutils
    import numpy

    numpy.bool = bool  # Debian's glTF importer still asks for the name that its numpy has dropped

SENSOR_WIDTH_MM = 36.0


def numbers(text, key):
    found = re.search(key + r":\s*\[([^\]]*)\]", text)
    return [float(word) for word in found.group(1).split(",") if word.strip()] if found else []


def read_camera(dataset):
    with open(os.path.join(dataset, "camera.yaml")) as file:
        text = file.read()
    fx, fy, cx, cy = numbers(text, "intrinsics")
    width, height = (int(side) for side in numbers(text, "resolution"))
    fisheye = "equidistant" in text
    plain = not any(numbers(text, "distortion_coeffs")) and "camera_model: pinhole" in text
    middle = abs(cx - (width - 1) / 2) < 1e-6 and abs(cy - (height - 1) / 2) < 1e-6
    if not (plain and middle and abs(fx - fy) < 1e-9):
        sys.exit(dataset + ": the camera must be a centred pinhole or equidistant fisheye without distortion")
    return {"f": fx, "width": width, "height": height, "fisheye": fisheye}


def read_poses(dataset, count):
    with open(os.path.join(dataset, "groundtruth.txt")) as file:
        rows = [line.split() for line in file if line.strip() and not line.startswith("#")]
    return [[float(word) for word in row[1:8]] for row in rows[:count]]


def emissive(material):
    """The material's colour, shining; nothing else."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    texture = next((node for node in nodes if node.type == "TEX_IMAGE"), None)
    principled = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)
    color = tuple(principled.inputs["Base Color"].default_value) if principled else (1, 1, 1, 1)
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    emission = nodes.new("ShaderNodeEmission")
    emission.inputs["Color"].default_value = color
    if texture:
        links.new(texture.outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs["Emission"], output.inputs["Surface"])


def set_up(mesh, camera, samples):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=mesh)
    for material in bpy.data.materials:
        if material.use_nodes:
            emissive(material)
    scene = bpy.context.scene
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.sensor_width = "HORIZONTAL", SENSOR_WIDTH_MM
    data.clip_start, data.clip_end = 1e-3, 1e5
    focal_mm = camera["f"] * SENSOR_WIDTH_MM / camera["width"]
    if camera["fisheye"]:
        data.type = "PANO"
        data.cycles.panorama_type = "FISHEYE_LENS_POLYNOMIAL"
        data.cycles.fisheye_fov = math.pi * 2
        polynomial = [0.0, -1.0 / focal_mm, 0.0, 0.0, 0.0]
        for power, value in enumerate(polynomial):
            setattr(data.cycles, "fisheye_polynomial_k%d" % power, value)
    else:
        data.lens = focal_mm
    scene.camera = bpy.data.objects.new("camera", data)
    scene.collection.objects.link(scene.camera)
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = camera["width"], camera["height"]
    scene.render.resolution_percentage = 100
    scene.render.use_persistent_data = True
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.compression = 0
    scene.view_settings.view_transform = "Standard"
    scene.cycles.device, scene.cycles.samples = "CPU", samples
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.max_bounces = scene.cycles.transparent_max_bounces = 0
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 1.0 if samples > 1 else 0.01
    return scene


def place_camera(scene, pose):
    x, y, z, qx, qy, qz, qw = pose
    # Blender's cameras look along -z with y up; ours along z with y down.
    rotation = mathutils.Quaternion((qw, qx, qy, qz)).to_matrix() @ mathutils.Matrix.Diagonal((1, -1, -1))
    scene.camera.matrix_world = mathutils.Matrix.Translation((x, y, z)) @ rotation.to_4x4()


def pixels_of(path):
    image = bpy.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    values = numpy.empty(width * height * 4, dtype=numpy.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(height, width, 4)[..., :3]


def read_depth(path):
    """Our depth file: one float channel, zip-compressed scanlines (https://openexr.com/en/latest/OpenEXRFileLayout.html);
    rows from below, as Blender has pictures. Blender itself shows a lone Z channel black."""
    with open(path, "rb") as file:
        data = file.read()
    at, attributes = 8, {}
    while data[at]:
        name, kind = data[at:].split(b"\0", 2)[:2]
        at += len(name) + len(kind) + 2
        size = int.from_bytes(data[at:at + 4], "little")
        attributes[name] = data[at + 4:at + 4 + size]
        at += 4 + size
    x0, y0, x1, y1 = numpy.frombuffer(attributes[b"dataWindow"], dtype="<i4")
    width, height = int(x1 - x0 + 1), int(y1 - y0 + 1)
    depth = numpy.empty((height, width), dtype=numpy.float32)
    for offset in numpy.frombuffer(data, "<u8", (height + 15) // 16, at + 1):
        row, size = numpy.frombuffer(data, "<i4", 2, int(offset))
        rows = min(16, height - (row - y0))
        packed = data[int(offset) + 8:int(offset) + 8 + size]
        if size == rows * width * 4:
            raw = numpy.frombuffer(packed, numpy.uint8)
        else:
            steps = numpy.frombuffer(zlib.decompress(packed), numpy.uint8).astype(numpy.int64)
            steps[1:] -= 128
            sums, half = numpy.cumsum(steps).astype(numpy.uint8), (len(steps) + 1) // 2
            raw = numpy.empty_like(sums)
            raw[0::2], raw[1::2] = sums[:half], sums[half:]
        depth[row - y0:row - y0 + rows] = raw.view("<f4").reshape(rows, width)
    return depth[::-1]


def smooth(depth):
    """Where all of 3 x 3 pixels see a surface whose depth changes by less than 2 %."""
    depth = numpy.where(numpy.isfinite(depth), depth, 0.0)
    padded = numpy.pad(depth, 1, mode="edge")
    around = numpy.stack([padded[j:j + depth.shape[0], i:i + depth.shape[1]] for j in range(3) for i in range(3)])
    return (around.min(axis=0) > 0) & (around.max(axis=0) < 1.02 * around.min(axis=0))


def inside_blender(arguments):
    camera = read_camera(arguments.dataset)
    poses = read_poses(arguments.dataset, arguments.frames)
    scene = set_up(arguments.mesh, camera, arguments.samples)
    seconds, differences, shares = [], [], []
    for number, pose in enumerate(poses):
        name = "%06d" % number
        place_camera(scene, pose)
        scene.render.filepath = os.path.join(arguments.keep, name + ".png")
        begun = time.monotonic()
        bpy.ops.render.render(write_still=True)
        seconds.append(time.monotonic() - begun)
        ours = os.path.join(arguments.dataset, "images", name + ".png")
        depth = os.path.join(arguments.dataset, "depth", name + ".exr")
        if os.path.exists(ours) and os.path.exists(depth):
            even = smooth(read_depth(depth))
            difference = numpy.abs(pixels_of(ours) - pixels_of(scene.render.filepath)).mean(axis=2)
            differences.append(255 * float(difference[even].mean()))
            shares.append(float(even.mean()))
    result = {"frames": len(poses), "width": camera["width"], "height": camera["height"],
              "samples": arguments.samples, "first_frame_s": seconds[0],
              "seconds_per_frame": sum(seconds[1:]) / max(1, len(seconds) - 1)}
    if differences:
        result["mean_absolute_difference"] = sum(differences) / len(differences)
        result["pixels_compared"] = sum(shares) / len(shares)
    print("RESULT " + json.dumps(result))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mesh")
    parser.add_argument("dataset")
    parser.add_argument("--frames", type=int, default=4)
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--keep", help="folder for Cycles' pictures")
    own = sys.argv[sys.argv.index("--") + 1:] if bpy else sys.argv[1:]
    arguments = parser.parse_args(own)
    if bpy:
        inside_blender(arguments)
        return
    with tempfile.TemporaryDirectory() as scratch:
        keep = ["--keep", scratch] if not arguments.keep else []
        done = subprocess.run(["blender", "-b", "--python-exit-code", "1", "--python", __file__, "--"] + own + keep,
                              capture_output=True, text=True, check=False)
    lines = [line for line in done.stdout.splitlines() if line.startswith("RESULT ")]
    if not lines:
        sys.exit(done.stdout[-2000:] + done.stderr[-2000:])
    print(lines[-1][len("RESULT "):])


if __name__ == "__main__":
    main()
