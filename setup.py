"""The wheel: package, extension module and program. Flags besides these: the environment's CMAKE_ARGS."""

import pathlib
import re

from skbuild import setup

root = pathlib.Path(__file__).parent
version = re.search(r"project\(tileflight VERSION ([0-9.]+)", (root / "CMakeLists.txt").read_text())[1]

setup(
    name="tileflight",
    version=version,
    description="Fly a drone's camera through 3D Tiles of a real place, and measure how true SLAM's map is",
    license="Apache-2.0",
    python_requires=">=3.9",
    install_requires=["numpy"],
    packages=["tileflight"],
    package_dir={"": "python"},
    package_data={"tileflight": ["py.typed", "*.pyi"]},
    entry_points={"console_scripts": ["tileflight = tileflight.__main__:main"]},
    cmake_args=[
        "-DTILEFLIGHT_PYTHON=ON",
        "-DTILEFLIGHT_TESTS=OFF",
        "-DTILEFLIGHT_BENCHMARKS=OFF",
        "-DCMAKE_UNITY_BUILD=ON",
        "-DCMAKE_UNITY_BUILD_BATCH_SIZE=0",
    ],
    cmake_install_dir="python/tileflight",
    cmake_install_target="install_python_package",
)
