"""Distances from a map to the true surface by CloudCompare and by `evaluate`, point by point.

Usage: cloudcompare_peer.py FLIGHT TRUTH
FLIGHT: a flight's folder of a run (odometry/map.ply, transform.json, errors.ply), e.g. out/stadium/simulated.
TRUTH: the run's truth folder (mesh.glb). Needs CloudCompare (Debian's package cloudcompare) and numpy.
"""
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time

try:
    import numpy as np
except ImportError:
    sys.exit("numpy is not installed (Debian: python3-numpy)")

PLY_TYPES = {"double": "<f8", "float": "<f4", "uchar": "u1", "ushort": "<u2", "uint": "<u4", "int": "<i4",
             "float64": "<f8", "float32": "<f4", "uint8": "u1", "int32": "<i4", "uint32": "<u4"}
AROUND_M = 10.0
TIMEOUT_S = 300
GLTF_TYPES = {5121: "u1", 5123: "<u2", 5125: "<u4", 5126: "<f4"}


def read_points(path):
    """Columns of a binary PLY's vertices by name."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().splitlines()
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    columns = [(line.split()[2], PLY_TYPES[line.split()[1]]) for line in lines if line.startswith("property")]
    return np.frombuffer(data, dtype=np.dtype(columns), count=count, offset=end)


def positions(vertices):
    return np.stack([vertices[axis].astype(float) for axis in "xyz"], axis=1)


def read_mesh(path):
    """Corners of all triangles of a mesh.glb, n x 3 x 3, local frame: below the root, which only turns it for viewers."""
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    gltf = json.loads(data[20:20 + length])
    binary = data[20 + length + 8:]

    def accessor(index):
        a = gltf["accessors"][index]
        view = gltf["bufferViews"][a["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3}[a["type"]]
        offset = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        kind = np.dtype(GLTF_TYPES[a["componentType"]])
        if view.get("byteStride", kind.itemsize * width) != kind.itemsize * width:
            sys.exit(f"{path}: interleaved vertices are not read")
        return np.frombuffer(binary, kind, a["count"] * width, offset).reshape(-1, width)

    corners = []
    for node in gltf["nodes"]:
        if "mesh" not in node:
            continue
        shift = np.array(node.get("translation", node.get("matrix", [0] * 15)[12:15]), float)
        for primitive in gltf["meshes"][node["mesh"]]["primitives"]:
            vertices = accessor(primitive["attributes"]["POSITION"]).astype(float) + shift
            corners.append(vertices[accessor(primitive["indices"]).astype(np.int64).ravel()].reshape(-1, 3, 3))
    return np.concatenate(corners)


def write_points(path, points):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    path.write_bytes(header.encode() + points.astype("<f4").tobytes())


def write_mesh(path, corners):
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {3 * len(corners)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz")
    header += f"element face {len(corners)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.zeros(len(corners), dtype=[("n", "u1"), ("i", "<i4", 3)])
    faces["n"] = 3
    faces["i"] = np.arange(3 * len(corners)).reshape(-1, 3)
    path.write_bytes(header.encode() + corners.astype("<f4").tobytes() + faces.tobytes())


def cloudcompare_distances(folder, program):
    """|distance| of each point, in order."""
    command = [program, "-SILENT", "-AUTO_SAVE", "OFF", "-C_EXPORT_FMT", "PLY", "-PLY_EXPORT_FMT",
               "BINARY_LE", "-O", folder / "points.ply", "-O", folder / "mesh.ply", "-C2M_DIST", "-SAVE_CLOUDS", "FILE",
               folder / "measured.ply"]
    start = time.monotonic()
    done = subprocess.run(command, env=dict(os.environ, QT_QPA_PLATFORM="offscreen"), capture_output=True, text=True,
                          timeout=TIMEOUT_S)
    seconds = time.monotonic() - start
    if not (folder / "measured.ply").exists():
        sys.exit(f"CloudCompare wrote nothing:\n{done.stdout[-2000:]}")
    measured = read_points(folder / "measured.ply")
    name = next(n for n in measured.dtype.names if "C2M" in n or "scalar" in n)
    return np.abs(measured[name].astype(float)), seconds


def main(flight, truth):
    program = shutil.which("CloudCompare") or shutil.which("cloudcompare.CloudCompare")
    if program is None:
        sys.exit("CloudCompare is not installed (Debian: apt-get install cloudcompare)")
    transform = json.loads((flight / "transform.json").read_text())
    matrix = np.array(transform.get("to_surface", transform)["matrix"])
    points = positions(read_points(flight / "odometry/map.ply")) @ matrix[:3, :3].T + matrix[:3, 3]
    corners = read_mesh(truth / "mesh.glb")
    ours = read_points(flight / "errors.ply")["surface_distance"].astype(float)
    # CloudCompare keeps floats, and its grid spans the points: one that is kilometres away makes its cells too coarse.
    middle = corners.reshape(-1, 3).mean(axis=0)
    low, high = corners.min(axis=(0, 1)) - AROUND_M, corners.max(axis=(0, 1)) + AROUND_M
    near = np.all((points >= low) & (points <= high), axis=1)
    left_out = len(points) - near.sum()
    points, ours = points[near], ours[near]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        write_points(folder / "points.ply", points - middle)
        write_mesh(folder / "mesh.ply", corners - middle)
        theirs, seconds = cloudcompare_distances(folder, program)
    difference = np.abs(ours - theirs)
    print(f"{len(points)} points ({left_out} far from everything left out), {len(corners)} triangles: mean {ours.mean():.6f} m here, {theirs.mean():.6f} m by "
          f"CloudCompare (whole process {seconds:.2f} s)")
    print(f"difference: mean {difference.mean():.2e} m, largest {difference.max():.2e} m, "
          f"{(difference <= 1e-4).mean():.6f} of the points within 1e-4 m")
    return 0 if difference.max() <= 1e-4 else 1


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    sys.exit(main(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])))
