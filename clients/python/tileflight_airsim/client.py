"""VehicleClient and MultirotorClient, with the names and arguments that AirSim's scripts call.

Calls that take time come as `...Async` and give a Future: `client.takeoffAsync().join()`.
"""
from __future__ import annotations

import sys
from typing import Any, Iterable, List, Optional, Sequence

from . import types as t
from .rpc import Connection, Future

_FOREVER_S = 3e38


class VehicleClient:
    """Looks around: cameras, sensors, objects, the clock. All positions NED metres."""

    def __init__(self, ip: str = "", port: int = 41451, timeout_value: float = 3600, token: Optional[str] = None):
        """timeout_value: seconds that an answer is waited for. token: what the server was given with --token."""
        self.client = Connection(ip or "127.0.0.1", port, timeout_value)
        if token is not None:
            try:
                self.tfAuthenticate(token)
            except Exception:
                self.close()
                raise

    def close(self) -> None:
        self.client.close()

    def __enter__(self) -> "VehicleClient":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    # The server.

    def ping(self) -> bool:
        return self.client.call("ping")

    def getClientVersion(self) -> int:
        return 1

    def getMinRequiredServerVersion(self) -> int:
        return 1

    def getServerVersion(self) -> int:
        return self.client.call("getServerVersion")

    def getMinRequiredClientVersion(self) -> int:
        return self.client.call("getMinRequiredClientVersion")

    def confirmConnection(self) -> None:
        """Raises if the server cannot be spoken to; else prints what AirSim's client prints."""
        print("Connected!" if self.ping() else "Ping returned false!")
        server, needed = self.getServerVersion(), self.getMinRequiredClientVersion()
        versions = (f"Client Ver:{self.getClientVersion()} (Min Req: {needed}), "
                    f"Server Ver:{server} (Min Req: {self.getMinRequiredServerVersion()})")
        fits = server >= self.getMinRequiredServerVersion() and needed <= self.getClientVersion()
        print(versions, file=sys.stdout if fits else sys.stderr)
        if not fits:
            print("client and server versions are incompatible", file=sys.stderr)
        print()

    def reset(self) -> None:
        self.client.call("reset")

    def enableApiControl(self, is_enabled: bool, vehicle_name: str = "") -> None:
        self.client.call("enableApiControl", is_enabled, vehicle_name)

    def isApiControlEnabled(self, vehicle_name: str = "") -> bool:
        return self.client.call("isApiControlEnabled", vehicle_name)

    def armDisarm(self, arm: bool, vehicle_name: str = "") -> bool:
        return self.client.call("armDisarm", arm, vehicle_name)

    def listVehicles(self) -> List[str]:
        return self.client.call("listVehicles")

    def getSettingsString(self) -> str:
        return self.client.call("getSettingsString")

    def getHomeGeoPoint(self, vehicle_name: str = "") -> t.GeoPoint:
        return t.GeoPoint.from_msgpack(self.client.call("getHomeGeoPoint", vehicle_name))

    # The clock.

    def simPause(self, is_paused: bool) -> None:
        self.client.call("simPause", is_paused)

    def simIsPause(self) -> bool:
        return self.client.call("simIsPaused")

    simIsPaused = simIsPause

    def simContinueForTime(self, seconds: float) -> None:
        """Seconds of the simulation; returns when they are over and it is paused."""
        self.client.call("simContinueForTime", float(seconds))

    def simContinueForFrames(self, frames: int) -> None:
        self.client.call("simContinueForFrames", frames)

    # Pictures and cameras.

    def simGetImage(self, camera_name: Any, image_type: int, vehicle_name: str = "",
                    external: bool = False) -> Optional[bytes]:
        """A PNG; None if there is none."""
        image = self.client.call("simGetImage", str(camera_name), image_type, vehicle_name, external)
        return None if image in (b"", b"\0", "") else image

    def simGetImages(self, requests: Sequence[t.ImageRequest], vehicle_name: str = "",
                     external: bool = False) -> List[t.ImageResponse]:
        answers = self.client.call("simGetImages", list(requests), vehicle_name, external)
        return [t.ImageResponse.from_msgpack(answer) for answer in answers]

    def simGetCameraInfo(self, camera_name: Any, vehicle_name: str = "", external: bool = False) -> t.CameraInfo:
        answer = self.client.call("simGetCameraInfo", str(camera_name), vehicle_name, external)
        return t.CameraInfo.from_msgpack(answer)

    def simSetCameraPose(self, camera_name: Any, pose: t.Pose, vehicle_name: str = "",
                         external: bool = False) -> None:
        """pose: relative to the vehicle's body."""
        self.client.call("simSetCameraPose", str(camera_name), pose, vehicle_name, external)

    def simSetCameraFov(self, camera_name: Any, fov_degrees: float, vehicle_name: str = "",
                        external: bool = False) -> None:
        self.client.call("simSetCameraFov", str(camera_name), fov_degrees, vehicle_name, external)

    def simGetDistortionParams(self, camera_name: Any, vehicle_name: str = "", external: bool = False) -> List[float]:
        return self.client.call("simGetDistortionParams", str(camera_name), vehicle_name, external)

    def simSetDistortionParams(self, camera_name: Any, distortion_params: dict, vehicle_name: str = "",
                               external: bool = False) -> None:
        for name, value in distortion_params.items():
            self.simSetDistortionParam(camera_name, name, value, vehicle_name, external)

    def simSetDistortionParam(self, camera_name: Any, param_name: str, value: float, vehicle_name: str = "",
                              external: bool = False) -> None:
        self.client.call("simSetDistortionParam", str(camera_name), param_name, value, vehicle_name, external)

    # The state of a vehicle.

    def simSetVehiclePose(self, pose: t.Pose, ignore_collision: bool, vehicle_name: str = "") -> None:
        self.client.call("simSetVehiclePose", pose, ignore_collision, vehicle_name)

    def simGetVehiclePose(self, vehicle_name: str = "") -> t.Pose:
        return t.Pose.from_msgpack(self.client.call("simGetVehiclePose", vehicle_name))

    def simGetGroundTruthKinematics(self, vehicle_name: str = "") -> t.KinematicsState:
        return t.KinematicsState.from_msgpack(self.client.call("simGetGroundTruthKinematics", vehicle_name))

    def simSetKinematics(self, state: t.KinematicsState, ignore_collision: bool, vehicle_name: str = "") -> None:
        self.client.call("simSetKinematics", state, ignore_collision, vehicle_name)

    def simGetGroundTruthEnvironment(self, vehicle_name: str = "") -> t.EnvironmentState:
        return t.EnvironmentState.from_msgpack(self.client.call("simGetGroundTruthEnvironment", vehicle_name))

    def simGetCollisionInfo(self, vehicle_name: str = "") -> t.CollisionInfo:
        return t.CollisionInfo.from_msgpack(self.client.call("simGetCollisionInfo", vehicle_name))

    # Sensors.

    def getImuData(self, imu_name: str = "", vehicle_name: str = "") -> t.ImuData:
        return t.ImuData.from_msgpack(self.client.call("getImuData", imu_name, vehicle_name))

    def getBarometerData(self, barometer_name: str = "", vehicle_name: str = "") -> t.BarometerData:
        return t.BarometerData.from_msgpack(self.client.call("getBarometerData", barometer_name, vehicle_name))

    def getMagnetometerData(self, magnetometer_name: str = "", vehicle_name: str = "") -> t.MagnetometerData:
        return t.MagnetometerData.from_msgpack(self.client.call("getMagnetometerData", magnetometer_name, vehicle_name))

    def getGpsData(self, gps_name: str = "", vehicle_name: str = "") -> t.GpsData:
        return t.GpsData.from_msgpack(self.client.call("getGpsData", gps_name, vehicle_name))

    def getDistanceSensorData(self, distance_sensor_name: str = "", vehicle_name: str = "") -> t.DistanceSensorData:
        answer = self.client.call("getDistanceSensorData", distance_sensor_name, vehicle_name)
        return t.DistanceSensorData.from_msgpack(answer)

    def getLidarData(self, lidar_name: str = "", vehicle_name: str = "") -> t.LidarData:
        return t.LidarData.from_msgpack(self.client.call("getLidarData", lidar_name, vehicle_name))

    def simGetLidarSegmentation(self, lidar_name: str = "", vehicle_name: str = "") -> List[int]:
        return self.getLidarData(lidar_name, vehicle_name).segmentation

    # The place and what is in it.

    def simListSceneObjects(self, name_regex: str = ".*") -> List[str]:
        return self.client.call("simListSceneObjects", name_regex)

    def simSetSegmentationObjectID(self, mesh_name: str, object_id: int, is_name_regex: bool = False) -> bool:
        return self.client.call("simSetSegmentationObjectID", mesh_name, object_id, is_name_regex)

    def simGetSegmentationObjectID(self, mesh_name: str) -> int:
        return self.client.call("simGetSegmentationObjectID", mesh_name)

    def simGetMeshPositionVertexBuffers(self) -> List[t.MeshPositionVertexBuffersResponse]:
        answers = self.client.call("simGetMeshPositionVertexBuffers")
        return [t.MeshPositionVertexBuffersResponse.from_msgpack(answer) for answer in answers]

    def simGetObjectPose(self, object_name: str) -> t.Pose:
        return t.Pose.from_msgpack(self.client.call("simGetObjectPose", object_name))

    def simSetObjectPose(self, object_name: str, pose: t.Pose, teleport: bool = True) -> bool:
        return self.client.call("simSetObjectPose", object_name, pose, teleport)

    def simGetObjectScale(self, object_name: str) -> t.Vector3r:
        return t.Vector3r.from_msgpack(self.client.call("simGetObjectScale", object_name))

    def simSetObjectScale(self, object_name: str, scale_vector: t.Vector3r) -> bool:
        return self.client.call("simSetObjectScale", object_name, scale_vector)

    def simSpawnObject(self, object_name: str, asset_name: str, pose: t.Pose, scale: t.Vector3r,
                       physics_enabled: bool = False, is_blueprint: bool = False) -> str:
        return self.client.call("simSpawnObject", object_name, asset_name, pose, scale, physics_enabled, is_blueprint)

    def simDestroyObject(self, object_name: str) -> bool:
        return self.client.call("simDestroyObject", object_name)

    def simListAssets(self) -> List[str]:
        return self.client.call("simListAssets")

    def simCreateVoxelGrid(self, position: t.Vector3r, x: int, y: int, z: int, res: float, of: str) -> bool:
        """Writes a .binvox on the server, into the folder that it was given with --files."""
        return self.client.call("simCreateVoxelGrid", position, x, y, z, res, of)

    def simTestLineOfSightToPoint(self, point: t.GeoPoint, vehicle_name: str = "") -> bool:
        return self.client.call("simTestLineOfSightToPoint", point, vehicle_name)

    def simTestLineOfSightBetweenPoints(self, point1: t.GeoPoint, point2: t.GeoPoint) -> bool:
        return self.client.call("simTestLineOfSightBetweenPoints", point1, point2)

    def simGetWorldExtents(self) -> List[t.GeoPoint]:
        return [t.GeoPoint.from_msgpack(point) for point in self.client.call("simGetWorldExtents")]

    # Detections.

    def simAddDetectionFilterMeshName(self, camera_name: Any, image_type: int, mesh_name: str, vehicle_name: str = "",
                                      external: bool = False) -> None:
        self.client.call("simAddDetectionFilterMeshName", str(camera_name), image_type, mesh_name, vehicle_name,
                         external)

    def simSetDetectionFilterRadius(self, camera_name: Any, image_type: int, radius_cm: float, vehicle_name: str = "",
                                    external: bool = False) -> None:
        self.client.call("simSetDetectionFilterRadius", str(camera_name), image_type, radius_cm, vehicle_name, external)

    def simClearDetectionMeshNames(self, camera_name: Any, image_type: int, vehicle_name: str = "",
                                   external: bool = False) -> None:
        self.client.call("simClearDetectionMeshNames", str(camera_name), image_type, vehicle_name, external)

    def simGetDetections(self, camera_name: Any, image_type: int, vehicle_name: str = "",
                         external: bool = False) -> List[t.DetectionInfo]:
        answers = self.client.call("simGetDetections", str(camera_name), image_type, vehicle_name, external)
        return [t.DetectionInfo.from_msgpack(answer) for answer in answers]

    # Recording, weather, markers and the rest.

    def startRecording(self) -> None:
        self.client.call("startRecording")

    def stopRecording(self) -> None:
        self.client.call("stopRecording")

    def isRecording(self) -> bool:
        return self.client.call("isRecording")

    def simSetWind(self, wind: t.Vector3r) -> None:
        self.client.call("simSetWind", wind)

    def simEnableWeather(self, enable: bool) -> None:
        self.client.call("simEnableWeather", enable)

    def simSetWeatherParameter(self, param: int, val: float) -> None:
        self.client.call("simSetWeatherParameter", param, val)

    def simSetTimeOfDay(self, is_enabled: bool, start_datetime: str = "", is_start_datetime_dst: bool = False,
                        celestial_clock_speed: float = 1, update_interval_secs: float = 60,
                        move_sun: bool = True) -> None:
        self.client.call("simSetTimeOfDay", is_enabled, start_datetime, is_start_datetime_dst, celestial_clock_speed,
                         update_interval_secs, move_sun)

    def simPrintLogMessage(self, message: str, message_param: str = "", severity: int = 0) -> None:
        self.client.call("simPrintLogMessage", message, message_param, severity)

    def simRunConsoleCommand(self, command: str) -> bool:
        return self.client.call("simRunConsoleCommand", command)

    def simAddVehicle(self, vehicle_name: str, vehicle_type: str, pose: t.Pose, pawn_path: str = "") -> bool:
        return self.client.call("simAddVehicle", vehicle_name, vehicle_type, pose, pawn_path)

    def simLoadLevel(self, level_name: str) -> bool:
        return self.client.call("simLoadLevel", level_name)

    def simFlushPersistentMarkers(self) -> None:
        self.client.call("simFlushPersistentMarkers")

    def simPlotPoints(self, points: Sequence[t.Vector3r], color_rgba: Sequence[float] = (1.0, 0.0, 0.0, 1.0),
                      size: float = 10.0, duration: float = -1.0, is_persistent: bool = False) -> None:
        self.client.call("simPlotPoints", list(points), color_rgba, size, duration, is_persistent)

    def simPlotLineStrip(self, points: Sequence[t.Vector3r], color_rgba: Sequence[float] = (1.0, 0.0, 0.0, 1.0),
                         thickness: float = 5.0, duration: float = -1.0, is_persistent: bool = False) -> None:
        self.client.call("simPlotLineStrip", list(points), color_rgba, thickness, duration, is_persistent)

    def simPlotLineList(self, points: Sequence[t.Vector3r], color_rgba: Sequence[float] = (1.0, 0.0, 0.0, 1.0),
                        thickness: float = 5.0, duration: float = -1.0, is_persistent: bool = False) -> None:
        self.client.call("simPlotLineList", list(points), color_rgba, thickness, duration, is_persistent)

    def simPlotArrows(self, points_start: Sequence[t.Vector3r], points_end: Sequence[t.Vector3r],
                      color_rgba: Sequence[float] = (1.0, 0.0, 0.0, 1.0), thickness: float = 5.0,
                      arrow_size: float = 2.0, duration: float = -1.0, is_persistent: bool = False) -> None:
        self.client.call("simPlotArrows", list(points_start), list(points_end), color_rgba, thickness, arrow_size,
                         duration, is_persistent)

    def simPlotStrings(self, strings: Sequence[str], positions: Sequence[t.Vector3r], scale: float = 5,
                       color_rgba: Sequence[float] = (1.0, 0.0, 0.0, 1.0), duration: float = -1.0) -> None:
        self.client.call("simPlotStrings", list(strings), list(positions), scale, color_rgba, duration)

    def simPlotTransforms(self, poses: Sequence[t.Pose], scale: float = 5.0, thickness: float = 5.0,
                          duration: float = -1.0, is_persistent: bool = False) -> None:
        self.client.call("simPlotTransforms", list(poses), scale, thickness, duration, is_persistent)

    def simSetTraceLine(self, color_rgba: Sequence[float], thickness: float = 1.0, vehicle_name: str = "") -> None:
        self.client.call("simSetTraceLine", color_rgba, thickness, vehicle_name)

    def cancelLastTask(self, vehicle_name: str = "") -> None:
        self.client.call("cancelLastTask", vehicle_name)

    # Beyond AirSim.

    def tfAuthenticate(self, token: str) -> bool:
        """The first call to a server that was given a --token; it closes the connection to whoever has a wrong one."""
        return self.client.call("tfAuthenticate", token)

    def tfLoadRegion(self, center: t.Vector3r, size: t.Vector3r, error_m: float = 0.0) -> t.Answer:
        """Loads what lies in a box (global NED) at a geometric error, and keeps it."""
        return t.Answer.from_msgpack(self.client.call("tfLoadRegion", center, size, error_m))

    def tfCoverage(self, camera_name: Any = "", vehicle_name: str = "", external: bool = False) -> t.Answer:
        """How fine the tiles in a camera's view are, and whether any is missing."""
        return t.Answer.from_msgpack(self.client.call("tfCoverage", str(camera_name), vehicle_name, external))

    def tfGroundTruth(self, center: t.Vector3r, size: t.Vector3r, folder: str, error_m: float = 0.0,
                      voxel_m: float = 1.0) -> t.Answer:
        """Mesh, surface cloud, voxels and octree of a box, written into a folder on the server (below its --files)."""
        return t.Answer.from_msgpack(self.client.call("tfGroundTruth", center, size, error_m, voxel_m, folder))

    def tfGeodeticPose(self, vehicle_name: str = "") -> t.Answer:
        """Latitude, longitude, height above the ellipsoid and heading of a vehicle."""
        return t.Answer.from_msgpack(self.client.call("tfGeodeticPose", vehicle_name))

    def tfStatistics(self) -> t.Answer:
        """Returns counts of what the server has done: `.simulator`, `.server`."""
        return t.Answer.from_msgpack(self.client.call("tfStatistics"))

    def tfCreateVoxelGrid(self, center: t.Vector3r, size: t.Vector3r, resolution: float) -> t.Answer:
        """The cells of a box that any surface touches: `dims`, `origin`, `resolution`, `occupied` (a byte a cell)."""
        return t.Answer.from_msgpack(self.client.call("tfCreateVoxelGrid", center, size, resolution))

    def tfLidarScan(self, lidar_name: str = "", vehicle_name: str = "") -> t.Answer:
        """A whole scan with intensity, ring and time of each point."""
        return t.Answer.from_msgpack(self.client.call("tfLidarScan", lidar_name, vehicle_name))

    def tfSetLens(self, camera_name: Any, lens: t.Lens, vehicle_name: str = "", external: bool = False) -> None:
        self.client.call("tfSetLens", str(camera_name), lens, vehicle_name, external)


class MultirotorClient(VehicleClient):
    """Flies. Of a vehicle, a new task ends the one before, whose answer is then False."""

    def takeoffAsync(self, timeout_sec: float = 20, vehicle_name: str = "") -> Future:
        return self.client.call_async("takeoff", timeout_sec, vehicle_name)

    def landAsync(self, timeout_sec: float = 60, vehicle_name: str = "") -> Future:
        return self.client.call_async("land", timeout_sec, vehicle_name)

    def goHomeAsync(self, timeout_sec: float = _FOREVER_S, vehicle_name: str = "") -> Future:
        return self.client.call_async("goHome", timeout_sec, vehicle_name)

    def hoverAsync(self, vehicle_name: str = "") -> Future:
        return self.client.call_async("hover", vehicle_name)

    def moveToPositionAsync(self, x: float, y: float, z: float, velocity: float, timeout_sec: float = _FOREVER_S,
                            drivetrain: int = t.DrivetrainType.MaxDegreeOfFreedom,
                            yaw_mode: Optional[t.YawMode] = None, lookahead: float = -1,
                            adaptive_lookahead: float = 1, vehicle_name: str = "") -> Future:
        return self.client.call_async("moveToPosition", x, y, z, velocity, timeout_sec, drivetrain,
                                      yaw_mode or t.YawMode(), lookahead, adaptive_lookahead, vehicle_name)

    def moveOnPathAsync(self, path: Iterable[t.Vector3r], velocity: float, timeout_sec: float = _FOREVER_S,
                        drivetrain: int = t.DrivetrainType.MaxDegreeOfFreedom, yaw_mode: Optional[t.YawMode] = None,
                        lookahead: float = -1, adaptive_lookahead: float = 1, vehicle_name: str = "") -> Future:
        return self.client.call_async("moveOnPath", list(path), velocity, timeout_sec, drivetrain,
                                      yaw_mode or t.YawMode(), lookahead, adaptive_lookahead, vehicle_name)

    def moveToZAsync(self, z: float, velocity: float, timeout_sec: float = _FOREVER_S,
                     yaw_mode: Optional[t.YawMode] = None, lookahead: float = -1, adaptive_lookahead: float = 1,
                     vehicle_name: str = "") -> Future:
        return self.client.call_async("moveToZ", z, velocity, timeout_sec, yaw_mode or t.YawMode(), lookahead,
                                      adaptive_lookahead, vehicle_name)

    def moveToGPSAsync(self, latitude: float, longitude: float, altitude: float, velocity: float,
                       timeout_sec: float = _FOREVER_S, drivetrain: int = t.DrivetrainType.MaxDegreeOfFreedom,
                       yaw_mode: Optional[t.YawMode] = None, lookahead: float = -1, adaptive_lookahead: float = 1,
                       vehicle_name: str = "") -> Future:
        return self.client.call_async("moveToGPS", latitude, longitude, altitude, velocity, timeout_sec, drivetrain,
                                      yaw_mode or t.YawMode(), lookahead, adaptive_lookahead, vehicle_name)

    def moveByVelocityAsync(self, vx: float, vy: float, vz: float, duration: float,
                            drivetrain: int = t.DrivetrainType.MaxDegreeOfFreedom,
                            yaw_mode: Optional[t.YawMode] = None, vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByVelocity", vx, vy, vz, duration, drivetrain, yaw_mode or t.YawMode(),
                                      vehicle_name)

    def moveByVelocityZAsync(self, vx: float, vy: float, z: float, duration: float,
                             drivetrain: int = t.DrivetrainType.MaxDegreeOfFreedom,
                             yaw_mode: Optional[t.YawMode] = None, vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByVelocityZ", vx, vy, z, duration, drivetrain, yaw_mode or t.YawMode(),
                                      vehicle_name)

    def moveByVelocityBodyFrameAsync(self, vx: float, vy: float, vz: float, duration: float,
                                     drivetrain: int = t.DrivetrainType.MaxDegreeOfFreedom,
                                     yaw_mode: Optional[t.YawMode] = None, vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByVelocityBodyFrame", vx, vy, vz, duration, drivetrain,
                                      yaw_mode or t.YawMode(), vehicle_name)

    def moveByVelocityZBodyFrameAsync(self, vx: float, vy: float, z: float, duration: float,
                                      drivetrain: int = t.DrivetrainType.MaxDegreeOfFreedom,
                                      yaw_mode: Optional[t.YawMode] = None, vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByVelocityZBodyFrame", vx, vy, z, duration, drivetrain,
                                      yaw_mode or t.YawMode(), vehicle_name)

    def rotateToYawAsync(self, yaw: float, timeout_sec: float = _FOREVER_S, margin: float = 5,
                         vehicle_name: str = "") -> Future:
        """yaw, margin: degrees."""
        return self.client.call_async("rotateToYaw", yaw, timeout_sec, margin, vehicle_name)

    def rotateByYawRateAsync(self, yaw_rate: float, duration: float, vehicle_name: str = "") -> Future:
        """yaw_rate: degrees per second."""
        return self.client.call_async("rotateByYawRate", yaw_rate, duration, vehicle_name)

    # Radians about the body's axes x forward, y left, z up, as in AirSim's client: pitch the nose down, yaw to the left.

    def moveByRollPitchYawZAsync(self, roll: float, pitch: float, yaw: float, z: float, duration: float,
                                 vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByRollPitchYawZ", roll, -pitch, -yaw, z, duration, vehicle_name)

    def moveByRollPitchYawThrottleAsync(self, roll: float, pitch: float, yaw: float, throttle: float, duration: float,
                                        vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByRollPitchYawThrottle", roll, -pitch, -yaw, throttle, duration,
                                      vehicle_name)

    def moveByRollPitchYawrateZAsync(self, roll: float, pitch: float, yaw_rate: float, z: float, duration: float,
                                     vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByRollPitchYawrateZ", roll, -pitch, -yaw_rate, z, duration, vehicle_name)

    def moveByRollPitchYawrateThrottleAsync(self, roll: float, pitch: float, yaw_rate: float, throttle: float,
                                            duration: float, vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByRollPitchYawrateThrottle", roll, -pitch, -yaw_rate, throttle, duration,
                                      vehicle_name)

    def moveByAngleRatesZAsync(self, roll_rate: float, pitch_rate: float, yaw_rate: float, z: float, duration: float,
                               vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByAngleRatesZ", roll_rate, -pitch_rate, -yaw_rate, z, duration,
                                      vehicle_name)

    def moveByAngleRatesThrottleAsync(self, roll_rate: float, pitch_rate: float, yaw_rate: float, throttle: float,
                                      duration: float, vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByAngleRatesThrottle", roll_rate, -pitch_rate, -yaw_rate, throttle, duration,
                                      vehicle_name)

    def moveByMotorPWMsAsync(self, front_right_pwm: float, rear_left_pwm: float, front_left_pwm: float,
                             rear_right_pwm: float, duration: float, vehicle_name: str = "") -> Future:
        return self.client.call_async("moveByMotorPWMs", front_right_pwm, rear_left_pwm, front_left_pwm,
                                      rear_right_pwm, duration, vehicle_name)

    def moveByRC(self, rcdata: Optional[t.RCData] = None, vehicle_name: str = "") -> None:
        self.client.call("moveByRC", rcdata or t.RCData(), vehicle_name)

    def setVelocityControllerGains(self, velocity_gains: Optional[t.VelocityControllerGains] = None,
                                   vehicle_name: str = "") -> None:
        gains = velocity_gains or t.VelocityControllerGains()
        self.client.call("setVelocityControllerGains", *gains.to_lists(), vehicle_name)

    def setPositionControllerGains(self, position_gains: Optional[t.PositionControllerGains] = None,
                                   vehicle_name: str = "") -> None:
        gains = position_gains or t.PositionControllerGains()
        self.client.call("setPositionControllerGains", *gains.to_lists(), vehicle_name)

    def setAngleRateControllerGains(self, angle_rate_gains: Optional[t.AngleRateControllerGains] = None,
                                    vehicle_name: str = "") -> None:
        gains = angle_rate_gains or t.AngleRateControllerGains()
        self.client.call("setAngleRateControllerGains", *gains.to_lists(), vehicle_name)

    def setAngleLevelControllerGains(self, angle_level_gains: Optional[t.AngleLevelControllerGains] = None,
                                     vehicle_name: str = "") -> None:
        gains = angle_level_gains or t.AngleLevelControllerGains()
        self.client.call("setAngleLevelControllerGains", *gains.to_lists(), vehicle_name)

    def getMultirotorState(self, vehicle_name: str = "") -> t.MultirotorState:
        return t.MultirotorState.from_msgpack(self.client.call("getMultirotorState", vehicle_name))

    def getRotorStates(self, vehicle_name: str = "") -> t.RotorStates:
        return t.RotorStates.from_msgpack(self.client.call("getRotorStates", vehicle_name))
