"""A client of AirSim's protocol: `import tileflight_airsim as airsim` and existing scripts run.

Standard library and msgpack only. `MultirotorClient` flies, `VehicleClient` looks around; both have tileflight's own
calls (`tf...`) too.
"""
from .client import MultirotorClient, VehicleClient
from .images import (
    get_pfm_array,
    list_to_2d_float_array,
    read_pfm,
    string_to_float_array,
    string_to_uint8_array,
    write_file,
    write_pfm,
    write_png,
)
from .rotations import to_eularian_angles, to_quaternion
from .rpc import Connection, Future, RPCError, TimeoutError, TransportError
from .types import *  # noqa: F401,F403
from .types import __all__ as _types

__version__ = "0.1.0"

__all__ = [
    "MultirotorClient",
    "VehicleClient",
    "Connection",
    "Future",
    "RPCError",
    "TimeoutError",
    "TransportError",
    "get_pfm_array",
    "list_to_2d_float_array",
    "read_pfm",
    "string_to_float_array",
    "string_to_uint8_array",
    "to_eularian_angles",
    "to_quaternion",
    "write_file",
    "write_pfm",
    "write_png",
    *_types,
]
