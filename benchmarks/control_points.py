"""Surveyed control points against a flight's estimated poses.

Usage: benchmarks/control_points.py FLIGHT GCP_FILE PHOTOS WIDTH [ODOMETRY]
FLIGHT is RUN/real of `tileflight run` (dataset, odometry), GCP_FILE OpenDroneMap's list (UTM: east, north, height, column, row, photo), PHOTOS the folder that was
tracked, WIDTH that of the photos in whose pixels the list is. ODOMETRY: another folder with trajectory.txt and, if it has one, camera.yaml.
The points are triangulated with the estimated poses and lens. The path is aligned to the dataset's positions (least squares, Sim(3)), then the points to the survey.
"""
import pathlib
import re
import sys

import numpy as np
import yaml

np.set_printoptions(suppress=True)

SEMI_AXIS_M, FLATTENING = 6378137.0, 1 / 298.257223563  # WGS84


def geodetic_from_utm(east, north, zone):
    """Longitude and latitude, degrees, of the northern hemisphere (Krueger's series to the third order, errors below a millimetre)."""
    n = FLATTENING / (2 - FLATTENING)
    radius = SEMI_AXIS_M / (1 + n) * (1 + n**2 / 4 + n**4 / 64)
    xi, eta = north / (0.9996 * radius), (east - 500000) / (0.9996 * radius)
    beta = [n / 2 - 2 * n**2 / 3 + 37 * n**3 / 96, n**2 / 48 + n**3 / 15, 17 * n**3 / 480]
    delta = [2 * n - 2 * n**2 / 3 - 2 * n**3, 7 * n**2 / 3 - 8 * n**3 / 5, 56 * n**3 / 15]
    x = xi - sum(b * np.sin(2 * (j + 1) * xi) * np.cosh(2 * (j + 1) * eta) for j, b in enumerate(beta))
    y = eta - sum(b * np.cos(2 * (j + 1) * xi) * np.sinh(2 * (j + 1) * eta) for j, b in enumerate(beta))
    chi = np.arcsin(np.sin(x) / np.cosh(y))
    latitude = chi + sum(d * np.sin(2 * (j + 1) * chi) for j, d in enumerate(delta))
    return 6 * zone - 183 + np.degrees(np.arctan2(np.sinh(y), np.cos(x))), np.degrees(latitude)


def earth_centred(longitude_deg, latitude_deg, height_m):
    e2 = FLATTENING * (2 - FLATTENING)
    l, b = np.radians(longitude_deg), np.radians(latitude_deg)
    across = SEMI_AXIS_M / np.sqrt(1 - e2 * np.sin(b) ** 2)
    return np.array([(across + height_m) * np.cos(b) * np.cos(l), (across + height_m) * np.cos(b) * np.sin(l), (across * (1 - e2) + height_m) * np.sin(b)])


class LocalFrame:
    """East, north, up about a position."""

    def __init__(self, longitude_deg, latitude_deg, height_m):
        l, b = np.radians(longitude_deg), np.radians(latitude_deg)
        self.origin = earth_centred(longitude_deg, latitude_deg, height_m)
        self.axes = np.array([[-np.sin(l), np.cos(l), 0], [-np.sin(b) * np.cos(l), -np.sin(b) * np.sin(l), np.cos(b)], [np.cos(b) * np.cos(l), np.cos(b) * np.sin(l), np.sin(b)]])

    def local(self, longitude_deg, latitude_deg, height_m):
        return self.axes @ (earth_centred(longitude_deg, latitude_deg, height_m) - self.origin)


def rows(file):
    return [line.split() for line in pathlib.Path(file).read_text().splitlines() if line.strip() and not line.startswith("#")]


def read_poses(trajectory, times):
    """{index of the image: (rotation, position)}"""
    poses = {}
    for row in rows(trajectory):
        t, px, py, pz, x, y, z, w = map(float, row)
        rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                             [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                             [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        poses[int(np.argmin(np.abs(times - t)))] = (rotation, np.array([px, py, pz]))
    return poses


class Lens:
    """Kalibr's pinhole with radtan distortion."""

    def __init__(self, file):
        camera = yaml.safe_load(file.read_text())["cam0"]
        if (camera["camera_model"], camera["distortion_model"]) != ("pinhole", "radtan"):
            sys.exit(f"{file}: only pinhole with radtan distortion is read here")
        self.fx, self.fy, self.cx, self.cy = camera["intrinsics"]
        self.k1, self.k2, self.p1, self.p2 = camera["distortion_coeffs"]
        self.width = camera["resolution"][0]

    def ray(self, column, row):
        distorted = np.array([(column - self.cx) / self.fx, (row - self.cy) / self.fy])
        x, y = distorted
        for _ in range(30):
            r2 = x * x + y * y
            radial = 1 + self.k1 * r2 + self.k2 * r2 * r2
            x, y = (distorted - [2 * self.p1 * x * y + self.p2 * (r2 + 2 * x * x), self.p1 * (r2 + 2 * y * y) + 2 * self.p2 * x * y]) / radial
        ray = np.array([x, y, 1.0])
        return ray / np.linalg.norm(ray)


def similarity(source, target):
    """Scale, rotation, translation: Umeyama 1991."""
    source, target = np.array(source), np.array(target)
    a, b = source.mean(0), target.mean(0)
    u, d, v = np.linalg.svd((target - b).T @ (source - a) / len(source))
    signs = np.diag([1, 1, np.sign(np.linalg.det(u @ v))])
    rotation = u @ signs @ v
    scale = np.trace(np.diag(d) @ signs) / ((source - a) ** 2).sum() * len(source)
    return scale, rotation, b - scale * rotation @ a


def triangulate(rays):
    """The point nearest to the lines (position, direction), and their RMS distance from it as an angle, radians."""
    information, right = np.zeros((3, 3)), np.zeros(3)
    for position, direction in rays:
        across = np.eye(3) - np.outer(direction, direction)
        information += across
        right += across @ position
    point = np.linalg.solve(information, right)
    angles = [np.linalg.norm(np.cross(direction, point - position)) / np.linalg.norm(point - position) for position, direction in rays]
    return point, np.sqrt(np.mean(np.square(angles)))


def main(flight, gcp_file, photos, width, odometry=None):
    flight = pathlib.Path(flight)
    odometry = pathlib.Path(odometry) if odometry else flight / "odometry"
    times = np.array([float(row[1]) for row in rows(flight / "dataset/times.txt")])
    names = sorted(file.name for file in pathlib.Path(photos).iterdir() if file.suffix.lower() in (".jpg", ".jpeg"))
    if len(names) != len(times):
        sys.exit(f"{photos} has {len(names)} photos, the dataset {len(times)}: give the folder whose photos were all tracked")
    poses = read_poses(odometry / "trajectory.txt", times)
    lens = Lens(odometry / "camera.yaml" if (odometry / "camera.yaml").exists() else flight / "dataset/camera.yaml")
    lines = pathlib.Path(gcp_file).read_text().splitlines()
    zone = int(re.search(r"\+zone=(\d+)", lines[0]).group(1))
    gps = [list(map(float, line.split(",")[:4])) for line in (flight / "dataset/gps.csv").read_text().splitlines()[1:]]
    frame = LocalFrame(gps[0][2], gps[0][1], gps[0][3])
    at = {int(np.argmin(np.abs(times - t))): frame.local(longitude, latitude, height) for t, latitude, longitude, height in gps}
    both = [i for i in poses if i in at]
    scale, rotation, shift = similarity([poses[i][1] for i in both], [at[i] for i in both])
    errors = np.array([scale * rotation @ poses[i][1] + shift - at[i] for i in both])
    print(f"{len(poses)} of {len(times)} photos; path against positions, RMS east, north, up: {np.sqrt((errors**2).mean(0)).round(3)} m, together {np.sqrt((errors**2).sum(1).mean()):.3f} m")

    seen = {}
    for line in lines[1:]:
        if line.strip():
            east, north, height, column, row, name = line.split()[:6]
            seen.setdefault((float(east), float(north), float(height)), []).append((float(column), float(row), names.index(name)))
    factor = lens.width / float(width)
    found, surveyed = [], []
    for (east, north, height), observations in seen.items():
        rays = [(poses[i][1], poses[i][0] @ lens.ray((column + 0.5) * factor - 0.5, (row + 0.5) * factor - 0.5)) for column, row, i in observations if i in poses]
        if len(rays) < 2:
            continue
        point, angle = triangulate(rays)
        found.append(scale * rotation @ point + shift)
        surveyed.append(frame.local(*geodetic_from_utm(east, north, zone), height))
        print(f"point {east:.2f} {north:.2f}: {len(rays)} photos, rays {angle * lens.fx:.2f} pixels RMS; by the positions' frame minus survey, east, north, up: {(found[-1] - surveyed[-1]).round(2)} m")
    size, turn, offset = similarity(found, surveyed)
    errors = np.array([size * turn @ p + offset for p in found]) - np.array(surveyed)
    print(f"{len(found)} points fitted to the survey, RMS level {np.sqrt((errors[:, :2]**2).sum(1).mean()):.3f} m, up {np.sqrt((errors[:, 2]**2).mean()):.3f} m; "
          f"scale by the positions over that by the survey: {1 / size:.4f}")


if __name__ == "__main__":
    if len(sys.argv) not in (5, 6):
        sys.exit(__doc__)
    main(*sys.argv[1:])
