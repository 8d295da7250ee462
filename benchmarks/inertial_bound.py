"""What any estimator can know of a flight's scale, vertical and clocks' offset: the Cramer-Rao bound for its motion.

    python3 benchmarks/inertial_bound.py DATASET… [--seconds 3,4,8] [--step-mm 4] [--turn-mdeg 4]

The measurements are the readings of DATASET's unit (noise of imu.yaml) and a camera's steps from keyframe to keyframe, of
the given standard deviations, up to scale; the motion is that of groundtruth.txt. Unknown are poses, velocities and biases
at the keyframes, the scale and the clocks' offset, as in tileflight/slam/inertial/visual_inertial_problem.h, but linearised at
the truth and written apart from it. `--step-mm 0.01 --turn-mdeg 0.01 --offset-ms 0.001` is a perfect camera.
"""

import argparse
import pathlib

import numpy
import yaml
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

GRAVITY = numpy.array([0.0, 0.0, -9.80665])
# Of a keyframe's unknowns: turn (in the unit's axes), position, velocity, gyroscope's and accelerometer's bias.
TURN, POSITION, VELOCITY, GYROSCOPE, ACCELEROMETER = (slice(3 * i, 3 * i + 3) for i in range(5))
SIZE = 15
ONE = numpy.eye(3)


def skew(v):
    return numpy.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


class Motion:
    """The unit's motion in the world's axes at the keyframes."""

    def __init__(self, dataset, seconds, interval_s):
        rows = numpy.loadtxt(dataset / "groundtruth.txt")
        T_cam_imu = numpy.array(yaml.safe_load((dataset / "camera.yaml").read_text())["cam0"]["T_cam_imu"])
        times = rows[:, 0] - rows[0, 0]
        camera = Rotation.from_quat(rows[:, 4:8])
        place = CubicSpline(times, rows[:, 1:4] + camera.apply(T_cam_imu[:3, 3]))
        turn = RotationSpline(times, camera * Rotation.from_matrix(T_cam_imu[:3, :3]))
        self.times = numpy.arange(0.0, min(seconds, times[-1]) + 1e-9, interval_s)
        self.position, self.velocity = place(self.times), place(self.times, 1)
        self.rotation, self.rate = turn(self.times).as_matrix(), turn(self.times, 1)


class Information:
    """Sum of J^T W J."""

    def __init__(self, unknowns):
        self.matrix = numpy.zeros((unknowns, unknowns))

    def add(self, covariance, blocks):
        weight = numpy.linalg.inv(covariance)
        for at, a in blocks:
            for to, b in blocks:
                self.matrix[at, to] += a.T @ weight @ b


def shifted(block, keyframe):
    return slice(block.start + SIZE * keyframe, block.stop + SIZE * keyframe)


def add_readings(information, motion, k, noise):
    """Preintegrated readings (Forster et al. 2017) to first order, and the biases' walks."""
    dt = motion.times[k + 1] - motion.times[k]
    to_unit = motion.rotation[k].T
    turned = to_unit @ motion.rotation[k + 1]
    velocity = to_unit @ (motion.velocity[k + 1] - motion.velocity[k] - dt * GRAVITY)
    place = to_unit @ (motion.position[k + 1] - motion.position[k] - dt * motion.velocity[k] - 0.5 * dt * dt * GRAVITY)
    first, second, zero = (lambda b: shifted(b, k)), (lambda b: shifted(b, k + 1)), numpy.zeros((3, 3))
    rows = lambda *parts: numpy.vstack(parts)
    rate, force = noise["gyroscope_noise_density"] ** 2, noise["accelerometer_noise_density"] ** 2
    covariance = numpy.zeros((9, 9))
    covariance[0:3, 0:3] = rate * dt * ONE
    covariance[3:6, 3:6], covariance[6:9, 6:9] = force * dt * ONE, force * dt**3 / 3 * ONE
    covariance[3:6, 6:9] = covariance[6:9, 3:6] = force * dt**2 / 2 * ONE
    information.add(covariance, [
        (first(TURN), rows(-turned.T, skew(velocity), skew(place))), (second(TURN), rows(ONE, zero, zero)),
        (first(POSITION), rows(zero, zero, -to_unit)), (second(POSITION), rows(zero, zero, to_unit)),
        (first(VELOCITY), rows(zero, -to_unit, -dt * to_unit)), (second(VELOCITY), rows(zero, to_unit, zero)),
        (first(GYROSCOPE), rows(dt * ONE, -dt / 2 * skew(velocity), -dt / 3 * skew(place))),
        (first(ACCELEROMETER), rows(zero, dt * ONE, dt * dt / 2 * ONE))])
    for bias, walk in ((GYROSCOPE, "gyroscope_random_walk"), (ACCELEROMETER, "accelerometer_random_walk")):
        information.add(noise[walk] ** 2 * dt * ONE, [(first(bias), -ONE), (second(bias), ONE)])


def add_camera(information, motion, k, step_m, share, turn_rad):
    """The camera's step, in the unit's axes; the last two unknowns are the scale's logarithm and the clocks' offset."""
    to_unit = motion.rotation[k].T
    turned = to_unit @ motion.rotation[k + 1]
    step = to_unit @ (motion.position[k + 1] - motion.position[k])
    scale, offset = (slice(len(information.matrix) - n, len(information.matrix) - n + 1) for n in (2, 1))
    zero, rows = numpy.zeros((3, 3)), lambda *parts: numpy.vstack(parts)
    by_offset = numpy.concatenate([
        to_unit @ (motion.velocity[k + 1] - motion.velocity[k]) - numpy.cross(motion.rate[k], step),
        motion.rate[k + 1] - turned.T @ motion.rate[k]])
    variance = [step_m**2 + (share * numpy.linalg.norm(step)) ** 2] * 3 + [turn_rad**2] * 3
    information.add(numpy.diag(variance), [
        (shifted(TURN, k), rows(skew(step), -turned.T)), (shifted(TURN, k + 1), rows(zero, ONE)),
        (shifted(POSITION, k), rows(-to_unit, zero)), (shifted(POSITION, k + 1), rows(to_unit, zero)),
        (scale, numpy.concatenate([-step, numpy.zeros(3)])[:, None]), (offset, by_offset[:, None])])


def bound(motion, noise, arguments):
    """Standard deviations of scale (share), vertical at the first keyframe (radians) and offset (seconds)."""
    count = len(motion.times)
    information = Information(SIZE * count + 2)
    for k in range(count - 1):
        add_readings(information, motion, k, noise)
        add_camera(information, motion, k, arguments.step_mm / 1e3, arguments.step_share, numpy.radians(arguments.turn_mdeg / 1e3))
    for block, sigma in ((GYROSCOPE, 0.1), (ACCELEROMETER, arguments.bias), (POSITION, 1e-3)):
        information.add(sigma**2 * ONE, [(block, ONE)])
    up = motion.rotation[0].T[:, 2]
    information.matrix[TURN, TURN] += 1e8 * numpy.outer(up, up)  # the heading, which nothing measures, is held
    information.matrix[-1, -1] += 1.0 / (arguments.offset_ms / 1e3) ** 2
    covariance = numpy.linalg.inv(information.matrix)
    level = motion.rotation[0][:2]
    tilt = numpy.trace(level @ covariance[TURN, TURN] @ level.T)
    return numpy.sqrt([covariance[-2, -2], tilt, covariance[-1, -1]])


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("datasets", nargs="+", type=pathlib.Path)
    parser.add_argument("--seconds", type=lambda text: [float(part) for part in text.split(",")], default=[3.0, 4.0, 8.0, 1e9])
    parser.add_argument("--interval-s", type=float, default=0.3, help="between keyframes")
    parser.add_argument("--step-mm", type=float, default=4.0, help="the camera's error of a step along each axis")
    parser.add_argument("--step-share", type=float, default=0.0003, help="and of its length")
    parser.add_argument("--turn-mdeg", type=float, default=4.0, help="and about each axis")
    parser.add_argument("--bias", type=float, default=0.5, help="what is known of the accelerometer's first bias, m/s^2")
    parser.add_argument("--offset-ms", type=float, default=100.0, help="what is known of the clocks' offset")
    arguments = parser.parse_args()
    for dataset in arguments.datasets:
        noise = yaml.safe_load((dataset / "imu.yaml").read_text())
        noise = noise.get("imu0", noise)
        for seconds in arguments.seconds:
            motion = Motion(dataset, seconds, arguments.interval_s)
            scale, up, offset = bound(motion, noise, arguments)
            print(f"{dataset.name}: {motion.times[-1]:.1f} s, {len(motion.times)} keyframes: scale {100 * scale:.2f} %, "
                  f"vertical {numpy.degrees(up):.3f} degrees, offset {1e3 * offset:.1f} ms")


if __name__ == "__main__":
    main()
