"""Quaternions of NED frames: yaw about down, then pitch about right, then roll about forward."""
from __future__ import annotations

import math
from typing import Tuple

from .types import Quaternionr


def to_quaternion(pitch: float, roll: float, yaw: float) -> Quaternionr:
    """Angles in radians."""
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    return Quaternionr(
        x_val=sr * cp * cy - cr * sp * sy,
        y_val=cr * sp * cy + sr * cp * sy,
        z_val=cr * cp * sy - sr * sp * cy,
        w_val=cr * cp * cy + sr * sp * sy,
    )


def to_eularian_angles(q: Quaternionr) -> Tuple[float, float, float]:
    """(pitch, roll, yaw), radians."""
    w, x, y, z = q.w_val, q.x_val, q.y_val, q.z_val
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return pitch, roll, yaw
