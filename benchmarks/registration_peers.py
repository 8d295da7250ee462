#!/usr/bin/env python3
"""Registration against PCL and Open3D, the same task in one run.

    registration_peers.py TRUTH [--icp build/release/bin/icp_benchmark] [--folder DIR]

TRUTH is a folder that `tileflight extract` wrote (voxels of 1 m). The task: 84 029 points on its surface with 0.3 m of
noise, moved by 2 degrees and (0.6, -0.5, 0.3) m, radius 1 m, at most 1500 iterations; to the voxel centres and to the
surface (500 000 points of it for those that know only points). Time without reading files, but with trees and normals;
beside it how far the points end from their true places (RMS). Needs python3-numpy and python3-open3d, and libpcl-dev
with a compiler for PCL; what is not installed is left out and named.
"""

import argparse
import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time

import numpy as np

POINTS, SURFACE_POINTS, NOISE_M = 84029, 500000, 0.3
HERE = pathlib.Path(__file__).resolve().parent


def write_ply(file, points):
    header = ("ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty double x\nproperty double y\n"
              "property double z\nend_header\n") % len(points)
    file.write_bytes(header.encode() + points.astype("<f8").tobytes())


def write_float_ply(file, points):
    header = ("ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
              "property float z\nend_header\n") % len(points)
    file.write_bytes(header.encode() + points.astype("<f4").tobytes())


def rotation(axis, angle):
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def read_ply_points(file):
    """Positions of a binary little-endian PLY with numbers only."""
    sizes = {"double": "f8", "float": "f4", "uchar": "u1", "int": "i4", "uint": "u4", "short": "i2", "ushort": "u2"}
    with open(file, "rb") as stream:
        fields, count = [], 0
        while (line := stream.readline().decode().strip()) != "end_header":
            word = line.split()
            if word[:2] == ["element", "vertex"]:
                count = int(word[2])
            elif word[0] == "property":
                fields.append((word[2], "<" + sizes[word[1]]))
        rows = np.fromfile(stream, dtype=np.dtype(fields), count=count)
    return np.stack([rows["x"], rows["y"], rows["z"]], axis=1).astype(float)


def make_task(truth, folder):
    random = np.random.default_rng(1)
    surface = read_ply_points(truth / "surface.ply")
    chosen = surface[random.choice(len(surface), POINTS, replace=len(surface) < POINTS)]
    true = chosen + random.normal(0.0, NOISE_M, chosen.shape)
    center = true.mean(axis=0)
    source = (true - center) @ rotation([0.3, -0.4, 0.866], np.radians(2.0)).T + center + [0.6, -0.5, 0.3]
    fewer = surface[random.choice(len(surface), min(SURFACE_POINTS, len(surface)), replace=False)]
    voxels = read_ply_points(truth / "voxels.ply")
    for name, points in (("source", source), ("true", true), ("voxels", voxels), ("surface", fewer)):
        write_ply(folder / f"{name}.ply", points)
        write_float_ply(folder / f"{name}-float.ply", points)
    shutil.copy(truth / "mesh.glb", folder / "mesh.glb")
    return source, true, voxels, fewer


def error_m(matrix, source, true):
    moved = source @ matrix[:3, :3].T + matrix[:3, 3]
    return float(np.sqrt(((moved - true) ** 2).sum(axis=1).mean()))


def run_own(program, folder):
    filters = "icp_to_voxel_centers|icp_to_mesh|icp_to_surface_points|icp_generalized"
    out = subprocess.run([program, "--benchmark_format=json", f"--benchmark_filter={filters}",
                          "--benchmark_repetitions=3"], check=True, capture_output=True,
                         env={**os.environ, "TILEFLIGHT_ICP_TASK": str(folder)}).stdout
    for b in json.loads(out)["benchmarks"]:
        if b.get("aggregate_name") == "median":
            name = b["run_name"].split("/")[0].removeprefix("icp_").replace("_", " ")
            yield f"tileflight {name}", b["real_time"] / 1000.0, b["error_m"]


def run_open3d(source, true, voxels, surface):
    try:
        import open3d as o3d
    except ImportError:
        print("Open3D is not installed (python3-open3d): left out")
        return
    registration = o3d.pipelines.registration

    def cloud(points):
        return o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))

    def task(name, target, estimation, change):
        begin = time.perf_counter()
        goal = cloud(target)
        if isinstance(estimation, registration.TransformationEstimationPointToPlane):
            goal.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(16))
        criteria = registration.ICPConvergenceCriteria(relative_fitness=change, relative_rmse=change,
                                                       max_iteration=1500)
        found = registration.registration_icp(cloud(source), goal, 1.0, np.eye(4), estimation, criteria)
        return name, time.perf_counter() - begin, error_m(found.transformation, source, true)

    yield task("Open3D to voxel centers, change 1e-5", voxels, registration.TransformationEstimationPointToPoint(), 1e-5)
    yield task("Open3D to voxel centers, change 1e-8", voxels, registration.TransformationEstimationPointToPoint(), 1e-8)
    yield task("Open3D to surface points", surface, registration.TransformationEstimationPointToPlane(), 1e-5)


def run_pcl(folder):
    flags = subprocess.run(["pkg-config", "--cflags", "--libs", "pcl_registration", "pcl_io"], capture_output=True,
                           text=True)
    if flags.returncode != 0:
        print("PCL is not installed (libpcl-dev, pkg-config): left out")
        return
    subprocess.run(["c++", "-O3", "-std=c++17", "-fopenmp", HERE / "pcl_peer.cpp", "-o", folder / "pcl_peer",
                    *flags.stdout.split(), "-lboost_system"], check=True)
    out = subprocess.run([folder / "pcl_peer", *(folder / f"{n}-float.ply" for n in ("source", "voxels", "true"))],
                         check=True, capture_output=True, text=True).stdout
    found = json.loads(out.strip().splitlines()[-1])
    yield "PCL to voxel centers", found["seconds"], found["error_m"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("truth", type=pathlib.Path)
    parser.add_argument("--icp", default="build/release/bin/icp_benchmark")
    parser.add_argument("--folder", type=pathlib.Path)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        source, true, voxels, surface = make_task(options.truth, folder)
        print(f"{len(source)} points to {len(voxels)} voxel centers and {len(surface)} surface points; "
              f"{os.cpu_count()} cores; before: {error_m(np.eye(4), source, true):.3f} m")
        print("| | seconds | RMS from true places, m |\n| --- | --- | --- |")
        for runs in (run_own(options.icp, folder), run_open3d(source, true, voxels, surface), run_pcl(folder)):
            for name, seconds, error in runs:
                print(f"| {name} | {seconds:.3f} | {error:.4f} |", flush=True)


if __name__ == "__main__":
    main()
