"""The structures and numbers of the protocol. NED metres, quaternions body to NED, angles as each field says."""
from __future__ import annotations

import math
from typing import Any, Dict, Iterable, List, Optional


class MsgpackMixin:
    """A structure that is a map of its attributes in a message."""

    def to_msgpack(self, *_: Any, **__: Any) -> Dict[str, Any]:
        return {name: value.to_msgpack() if hasattr(value, "to_msgpack") else value
                for name, value in vars(self).items()}

    @classmethod
    def from_msgpack(cls, encoded: Dict[str, Any]) -> Any:
        """Fields that are not in the map keep their defaults; a map becomes the structure that the default is of."""
        result = cls()
        for name, value in encoded.items():
            default = getattr(result, name, None)
            if isinstance(value, dict) and isinstance(default, MsgpackMixin):
                value = type(default).from_msgpack(value)
            setattr(result, name, value)
        return result

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and vars(self) == vars(other)

    def __repr__(self) -> str:
        fields = ", ".join(f"{name}={value!r}" for name, value in vars(self).items())
        return f"{type(self).__name__}({fields})"

    __hash__ = None  # type: ignore[assignment]


class ImageType:
    Scene = 0
    DepthPlanar = 1
    DepthPerspective = 2
    DepthVis = 3
    DisparityNormalized = 4
    Segmentation = 5
    SurfaceNormals = 6
    Infrared = 7
    OpticalFlow = 8
    OpticalFlowVis = 9


class DrivetrainType:
    MaxDegreeOfFreedom = 0
    ForwardOnly = 1


class LandedState:
    Landed = 0
    Flying = 1


class WeatherParameter:
    Rain = 0
    Roadwetness = 1
    Snow = 2
    RoadSnow = 3
    MapleLeaf = 4
    RoadLeaf = 5
    Dust = 6
    Fog = 7
    Enabled = 8


class Vector2r(MsgpackMixin):
    def __init__(self, x_val: float = 0.0, y_val: float = 0.0):
        self.x_val, self.y_val = x_val, y_val


class Vector3r(MsgpackMixin):
    def __init__(self, x_val: float = 0.0, y_val: float = 0.0, z_val: float = 0.0):
        self.x_val, self.y_val, self.z_val = x_val, y_val, z_val

    @staticmethod
    def nanVector3r() -> "Vector3r":
        return Vector3r(math.nan, math.nan, math.nan)

    def containsNan(self) -> bool:
        return any(math.isnan(v) for v in self)

    def __iter__(self):
        return iter((self.x_val, self.y_val, self.z_val))

    def __add__(self, other: "Vector3r") -> "Vector3r":
        return Vector3r(*(a + b for a, b in zip(self, other)))

    def __sub__(self, other: "Vector3r") -> "Vector3r":
        return Vector3r(*(a - b for a, b in zip(self, other)))

    def __mul__(self, factor: float) -> "Vector3r":
        return Vector3r(*(a * factor for a in self))

    __rmul__ = __mul__

    def __truediv__(self, divisor: float) -> "Vector3r":
        return Vector3r(*(a / divisor for a in self))

    def __neg__(self) -> "Vector3r":
        return self * -1.0

    def dot(self, other: "Vector3r") -> float:
        return sum(a * b for a, b in zip(self, other))

    def cross(self, other: "Vector3r") -> "Vector3r":
        (a, b, c), (d, e, f) = self, other
        return Vector3r(b * f - c * e, c * d - a * f, a * e - b * d)

    def get_length(self) -> float:
        return math.sqrt(self.dot(self))

    def distance_to(self, other: "Vector3r") -> float:
        return (self - other).get_length()

    def to_Quaternionr(self) -> "Quaternionr":
        return Quaternionr(self.x_val, self.y_val, self.z_val, 0.0)

    def to_numpy_array(self) -> Any:
        import numpy

        return numpy.array(list(self), dtype=numpy.float32)


class Quaternionr(MsgpackMixin):
    def __init__(self, x_val: float = 0.0, y_val: float = 0.0, z_val: float = 0.0, w_val: float = 1.0):
        self.x_val, self.y_val, self.z_val, self.w_val = x_val, y_val, z_val, w_val

    @staticmethod
    def nanQuaternionr() -> "Quaternionr":
        return Quaternionr(math.nan, math.nan, math.nan, math.nan)

    def containsNan(self) -> bool:
        return any(math.isnan(v) for v in self)

    def __iter__(self):
        return iter((self.x_val, self.y_val, self.z_val, self.w_val))

    def __mul__(self, other: "Quaternionr") -> "Quaternionr":
        (x, y, z, w), (p, q, r, s) = self, other
        return Quaternionr(w * p + s * x + y * r - z * q, w * q + s * y + z * p - x * r,
                           w * r + s * z + x * q - y * p, w * s - x * p - y * q - z * r)

    def conjugate(self) -> "Quaternionr":
        return Quaternionr(-self.x_val, -self.y_val, -self.z_val, self.w_val)

    star = conjugate

    def get_length(self) -> float:
        return math.sqrt(sum(v * v for v in self))

    def inverse(self) -> "Quaternionr":
        square = self.get_length() ** 2
        return Quaternionr(-self.x_val / square, -self.y_val / square, -self.z_val / square, self.w_val / square)

    def sgn(self) -> "Quaternionr":
        length = self.get_length()
        return Quaternionr(*(v / length for v in self))

    def rotate(self, vector: Vector3r) -> Vector3r:
        """The vector of body axes, in NED."""
        turned = self * vector.to_Quaternionr() * self.inverse()
        return Vector3r(turned.x_val, turned.y_val, turned.z_val)

    def to_numpy_array(self) -> Any:
        import numpy

        return numpy.array(list(self), dtype=numpy.float32)


class Pose(MsgpackMixin):
    def __init__(self, position_val: Optional[Vector3r] = None, orientation_val: Optional[Quaternionr] = None):
        self.position = Vector3r() if position_val is None else position_val
        self.orientation = Quaternionr() if orientation_val is None else orientation_val

    @staticmethod
    def nanPose() -> "Pose":
        return Pose(Vector3r.nanVector3r(), Quaternionr.nanQuaternionr())

    def containsNan(self) -> bool:
        return self.position.containsNan() or self.orientation.containsNan()


class GeoPoint(MsgpackMixin):
    def __init__(self, latitude: float = 0.0, longitude: float = 0.0, altitude: float = 0.0):
        self.latitude, self.longitude, self.altitude = latitude, longitude, altitude


class YawMode(MsgpackMixin):
    def __init__(self, is_rate: bool = True, yaw_or_rate: float = 0.0):
        """yaw_or_rate: degrees per second, or degrees."""
        self.is_rate, self.yaw_or_rate = is_rate, yaw_or_rate


class KinematicsState(MsgpackMixin):
    def __init__(self) -> None:
        self.position, self.orientation = Vector3r(), Quaternionr()
        self.linear_velocity, self.angular_velocity = Vector3r(), Vector3r()
        self.linear_acceleration, self.angular_acceleration = Vector3r(), Vector3r()


class EnvironmentState(MsgpackMixin):
    def __init__(self) -> None:
        self.position, self.geo_point, self.gravity = Vector3r(), GeoPoint(), Vector3r()
        self.air_pressure = self.temperature = self.air_density = 0.0


class CollisionInfo(MsgpackMixin):
    def __init__(self) -> None:
        self.has_collided = False
        self.normal, self.impact_point, self.position = Vector3r(), Vector3r(), Vector3r()
        self.penetration_depth, self.time_stamp = 0.0, 0
        self.object_name, self.object_id = "", -1


class RCData(MsgpackMixin):
    def __init__(self, timestamp: int = 0, pitch: float = 0.0, roll: float = 0.0, throttle: float = 0.0,
                 yaw: float = 0.0, switch1: int = 0, switch2: int = 0, switch3: int = 0, switch4: int = 0,
                 switch5: int = 0, switch6: int = 0, switch7: int = 0, switch8: int = 0,
                 is_initialized: bool = False, is_valid: bool = False):
        self.timestamp, self.pitch, self.roll, self.throttle, self.yaw = timestamp, pitch, roll, throttle, yaw
        self.left_z = self.right_z = 0.0
        bits = (switch1, switch2, switch3, switch4, switch5, switch6, switch7, switch8)
        self.switches = sum(1 << i for i, bit in enumerate(bits) if bit)
        self.vendor_id, self.is_initialized, self.is_valid = "", is_initialized, is_valid


class MultirotorState(MsgpackMixin):
    def __init__(self) -> None:
        self.collision, self.kinematics_estimated = CollisionInfo(), KinematicsState()
        self.gps_location, self.timestamp, self.landed_state = GeoPoint(), 0, LandedState.Landed
        self.rc_data = RCData()
        self.ready, self.ready_message, self.can_arm = False, "", False


class RotorStates(MsgpackMixin):
    def __init__(self) -> None:
        self.timestamp = 0
        self.rotors: List[Dict[str, float]] = []


class ImageRequest(MsgpackMixin):
    def __init__(self, camera_name: Any = "", image_type: int = ImageType.Scene, pixels_as_float: bool = False,
                 compress: bool = True):
        self.camera_name, self.image_type = str(camera_name), image_type
        self.pixels_as_float, self.compress = pixels_as_float, compress


class ImageResponse(MsgpackMixin):
    def __init__(self) -> None:
        self.image_data_uint8 = b""
        self.image_data_float: List[float] = []
        self.camera_position, self.camera_name, self.camera_orientation = Vector3r(), "", Quaternionr()
        self.time_stamp, self.message = 0, ""
        self.pixels_as_float, self.compress = False, True
        self.width = self.height = 0
        self.image_type = ImageType.Scene


class ProjectionMatrix(MsgpackMixin):
    def __init__(self) -> None:
        self.matrix: List[List[float]] = []


class CameraInfo(MsgpackMixin):
    def __init__(self) -> None:
        self.pose, self.fov, self.proj_mat = Pose(), -1.0, ProjectionMatrix()


class LidarData(MsgpackMixin):
    def __init__(self) -> None:
        self.point_cloud: List[float] = []
        self.time_stamp, self.pose = 0, Pose()
        self.segmentation: List[int] = []


class ImuData(MsgpackMixin):
    def __init__(self) -> None:
        self.time_stamp, self.orientation = 0, Quaternionr()
        self.angular_velocity, self.linear_acceleration = Vector3r(), Vector3r()


class BarometerData(MsgpackMixin):
    def __init__(self) -> None:
        self.time_stamp, self.altitude, self.pressure, self.qnh = 0, 0.0, 0.0, 0.0


class MagnetometerData(MsgpackMixin):
    def __init__(self) -> None:
        self.time_stamp, self.magnetic_field_body = 0, Vector3r()
        self.magnetic_field_covariance: List[float] = []


class GnssReport(MsgpackMixin):
    def __init__(self) -> None:
        self.geo_point, self.eph, self.epv, self.velocity = GeoPoint(), 0.0, 0.0, Vector3r()
        self.fix_type, self.time_utc = 0, 0


class GpsData(MsgpackMixin):
    def __init__(self) -> None:
        self.time_stamp, self.gnss, self.is_valid = 0, GnssReport(), False


class DistanceSensorData(MsgpackMixin):
    def __init__(self) -> None:
        self.time_stamp, self.distance, self.min_distance, self.max_distance = 0, 0.0, 0.0, 0.0
        self.relative_pose = Pose()


class MeshPositionVertexBuffersResponse(MsgpackMixin):
    def __init__(self) -> None:
        self.position, self.orientation = Vector3r(), Quaternionr()
        self.vertices: List[float] = []
        self.indices: List[int] = []
        self.name = ""


class Box2D(MsgpackMixin):
    def __init__(self) -> None:
        self.min, self.max = Vector2r(), Vector2r()


class Box3D(MsgpackMixin):
    def __init__(self) -> None:
        self.min, self.max = Vector3r(), Vector3r()


class DetectionInfo(MsgpackMixin):
    def __init__(self) -> None:
        self.name, self.geo_point = "", GeoPoint()
        self.box2D, self.box3D, self.relative_pose = Box2D(), Box3D(), Pose()


class PIDGains:
    def __init__(self, kp: float, ki: float, kd: float):
        self.kp, self.ki, self.kd = kp, ki, kd

    def to_list(self) -> List[float]:
        return [self.kp, self.ki, self.kd]


class _ControllerGains:
    """Three PID gains, sent as the lists of their kp, ki and kd."""

    def __init__(self, gains: Iterable[PIDGains]):
        self.gains = list(gains)

    def to_lists(self) -> List[List[float]]:
        return [[g.kp for g in self.gains], [g.ki for g in self.gains], [g.kd for g in self.gains]]


class AngleRateControllerGains(_ControllerGains):
    def __init__(self, roll_gains: PIDGains = PIDGains(0.25, 0, 0), pitch_gains: PIDGains = PIDGains(0.25, 0, 0),
                 yaw_gains: PIDGains = PIDGains(0.25, 0, 0)):
        super().__init__((roll_gains, pitch_gains, yaw_gains))


class AngleLevelControllerGains(_ControllerGains):
    def __init__(self, roll_gains: PIDGains = PIDGains(2.5, 0, 0), pitch_gains: PIDGains = PIDGains(2.5, 0, 0),
                 yaw_gains: PIDGains = PIDGains(2.5, 0, 0)):
        super().__init__((roll_gains, pitch_gains, yaw_gains))


class VelocityControllerGains(_ControllerGains):
    def __init__(self, x_gains: PIDGains = PIDGains(0.2, 0, 0), y_gains: PIDGains = PIDGains(0.2, 0, 0),
                 z_gains: PIDGains = PIDGains(2.0, 2.0, 0)):
        super().__init__((x_gains, y_gains, z_gains))


class PositionControllerGains(_ControllerGains):
    def __init__(self, x_gains: PIDGains = PIDGains(0.25, 0, 0), y_gains: PIDGains = PIDGains(0.25, 0, 0),
                 z_gains: PIDGains = PIDGains(0.25, 0, 0)):
        super().__init__((x_gains, y_gains, z_gains))


class Lens(MsgpackMixin):
    """A lens for tfSetLens: "pinhole", "fisheye" (Kannala-Brandt) or "panorama"."""

    def __init__(self, model: str = "pinhole", width: int = 0, height: int = 0, fov_degrees: float = 0.0,
                 k: Iterable[float] = (), intrinsics: Iterable[float] = ()):
        """k: up to four coefficients; intrinsics: none, or fx, fy, cx, cy in pixels, centres at +0.5."""
        self.model, self.width, self.height, self.fov_degrees = model, width, height, fov_degrees
        self.k, self.intrinsics = list(k), list(intrinsics)


class Answer(MsgpackMixin):
    """Answer to a call that only tileflight has: the map's entries as attributes, nested ones too."""

    @classmethod
    def from_msgpack(cls, encoded: Dict[str, Any]) -> "Answer":
        result = cls()
        for name, value in encoded.items():
            setattr(result, name, _known.get(name, cls).from_msgpack(value) if isinstance(value, dict) else value)
        return result


_known = {"pose": Pose, "origin": Vector3r, "geo_point": GeoPoint, "orientation": Quaternionr}


class _Plain(dict):
    @classmethod
    def from_msgpack(cls, encoded: Dict[str, Any]) -> Dict[str, Any]:
        return encoded


_known["methods"] = _Plain

__all__ = [name for name, value in list(globals().items()) if isinstance(value, type) and not name.startswith("_")
           and value.__module__ == __name__]
