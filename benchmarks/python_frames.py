"""What an image costs from Python, compared with C++: processor time of Renderer.render against that of frame_peer.

    PYTHONPATH=build/release/python python3 benchmarks/python_frames.py TILESET [--peer build/release/bin/frame_peer]

Both render the same poses, each in a process of its own, in turns; the ratio of the smallest of the rounds counts.
"""

import argparse
import subprocess
import sys
import time

import numpy as np

import tileflight as tf


def python_ms(tileset, width, height, frames):
    """Processor milliseconds an image, in this process."""
    scene = tf.load(tileset)
    renderer = tf.Renderer(scene, tf.Camera.pinhole(width, height, 90))
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    middle = (scene.bounds[0] + scene.bounds[1]) / 2
    pose[:3, 3] = middle + [0, 0, 40]
    renderer.render(pose)
    begin = time.process_time()
    for frame in range(frames):
        pose[0, 3] = middle[0] + 0.001 * frame
        if renderer.render(pose).rgb.shape[1] != width:
            sys.exit("python_frames: an image of another size")
    return 1000 * (time.process_time() - begin) / frames


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tileset")
    parser.add_argument("--peer", default="build/release/bin/frame_peer")
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--once", nargs=3, type=int, metavar=("WIDTH", "HEIGHT", "FRAMES"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.once:
        print(python_ms(arguments.tileset, *arguments.once))
        return
    print("| image | C++, CPU ms | Python, CPU ms | ratio |\n| --- | ---: | ---: | ---: |")
    for width, height, frames in ((128, 72, 2000), (640, 480, 200), (1920, 1080, 30)):
        size = [str(number) for number in (width, height, frames)]
        commands = ([arguments.peer, arguments.tileset, *size], [sys.executable, __file__, arguments.tileset, "--once", *size])
        rounds = [[float(subprocess.run(command, capture_output=True, text=True, check=True).stdout) for command in commands]
                  for _ in range(arguments.rounds)]
        cpp, python = np.min(rounds, axis=0)
        print(f"| {width} x {height} | {cpp:.3f} | {python:.3f} | {python / cpp:.3f} |", flush=True)


if __name__ == "__main__":
    main()
