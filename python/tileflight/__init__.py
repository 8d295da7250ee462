"""Fly a drone's camera through 3D Tiles of a real place, and measure how true SLAM's map is.

Two ways in, which may be mixed:

- **Arrays.** `load` a place into memory, then `Renderer`, `Lidar`, `simulate_imu`, `Odometry`, `Scene.voxelize`, `icp`,
  `evaluate_trajectory` and `Simulator` take and give numpy arrays.
- **Folders.** Every command of the program is a function with the command's options as keywords (`extract`, `render`,
  `odometry`, `align`, `evaluate`, `run`, ...); it writes the same files and returns the command's JSON as a dictionary.

Conventions: metres, seconds, degrees only where a name says so; the local frame is x east, y north, z up; cameras look
along z, with x right and y down; `T_a_b` is the 4x4 matrix that maps coordinates in frame b to frame a. Results do not
depend on the number of threads. What cannot be used raises `InputError`, a `ValueError` of one line.
"""

import importlib.machinery as _machinery
import pathlib as _pathlib
import sys as _sys

if not any((_pathlib.Path(__file__).parent / ("_core" + suffix)).exists() for suffix in _machinery.EXTENSION_SUFFIXES):
    _built_for = sorted(f"3.{file.name[15:].split('-')[0]}" for file in _pathlib.Path(__file__).parent.glob("_core.cpython-3*.so"))
    raise ImportError(f"tileflight: this package is for Python {' and '.join(_built_for) or 'no version, its module is missing'}; "
                      f"this is Python {_sys.version_info.major}.{_sys.version_info.minor}")

from . import _core, commands
from ._core import (
    Camera,
    Flight,
    FlightFrames,
    Frame,
    InputError,
    Lidar,
    Localizer,
    LocatedPose,
    Odometry,
    Path,
    Renderer,
    Scene,
    TrackedFrame,
    VoxelGrid,
    __version__,
    commit,
    evaluate_trajectory,
    icp,
    load,
    read_binvox,
    render_flight,
    set_threads,
    simulate_imu,
    simulate_sensors,
    umeyama,
)
from .commands import (
    align,
    compare,
    coverage,
    evaluate,
    export,
    extract,
    ingest,
    inspect,
    lens,
    localize,
    make_fort,
    make_ravine,
    make_stadium,
    make_suburb,
    make_town,
    make_woods,
    make_works,
    new,
    odometry,
    preview,
    render,
    report,
    run,
    study,
    systems,
    tile,
)

__all__ = [
    "Camera",
    "Flight",
    "FlightFrames",
    "Frame",
    "InputError",
    "Lidar",
    "Localizer",
    "LocatedPose",
    "Odometry",
    "Path",
    "Renderer",
    "Scene",
    "TrackedFrame",
    "VoxelGrid",
    "__version__",
    "align",
    "commands",
    "commit",
    "compare",
    "coverage",
    "evaluate",
    "evaluate_trajectory",
    "export",
    "extract",
    "icp",
    "ingest",
    "inspect",
    "lens",
    "load",
    "localize",
    "make_fort",
    "make_ravine",
    "make_stadium",
    "make_suburb",
    "make_town",
    "make_woods",
    "make_works",
    "new",
    "odometry",
    "preview",
    "read_binvox",
    "render",
    "render_flight",
    "report",
    "run",
    "set_threads",
    "simulate_imu",
    "simulate_sensors",
    "study",
    "systems",
    "tile",
    "umeyama",
]

if hasattr(_core, "Simulator"):  # absent from a library that was built without the simulator (TILEFLIGHT_LIVE=OFF)
    from ._core import Simulator

    __all__ += ["Simulator"]
