#include <nlohmann/json.hpp>

#include "arrays.h"
#include "bindings.h"
#include "input_options.h"
#include "interruptible.h"
#include "tileflight/live/simulator/simulator.h"

namespace tileflight::python {
namespace {

using simulator::Quaternionr;
using simulator::Simulator;
using simulator::Vector3r;

py::array_t<double> to_array(const Vector3r& v) {
  py::array_t<double> array(3);
  array.mutable_at(0) = v.x_val;
  array.mutable_at(1) = v.y_val;
  array.mutable_at(2) = v.z_val;
  return array;
}

py::array_t<double> to_array(const Quaternionr& q) {
  py::array_t<double> array(4);
  array.mutable_at(0) = q.w_val;
  array.mutable_at(1) = q.x_val;
  array.mutable_at(2) = q.y_val;
  array.mutable_at(3) = q.z_val;
  return array;
}

Vector3r vector_from(const std::array<double, 3>& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

simulator::Pose pose_from(const std::array<double, 3>& position, const std::array<double, 4>& q) {
  return {vector_from(position),
          {static_cast<float>(q[0]), static_cast<float>(q[1]), static_cast<float>(q[2]), static_cast<float>(q[3])}};
}

py::dict to_dict(const simulator::Pose& pose) {
  py::dict out;
  out["position"] = to_array(pose.position);
  out["orientation"] = to_array(pose.orientation);
  return out;
}

double seconds(std::uint64_t nanoseconds) { return 1e-9 * static_cast<double>(nanoseconds); }

std::string settings_text(const py::object& settings) {
  if (settings.is_none()) return "";
  if (py::isinstance<py::str>(settings)) return settings.cast<std::string>();
  return to_json(settings, "settings").dump();
}

std::unique_ptr<Simulator> open_simulator(const std::filesystem::path& source, const py::object& settings,
                                          const std::vector<double>& center, const std::vector<double>& center_local,
                                          const std::vector<double>& size, double error_m, double memory_gb,
                                          const py::object& progress) {
  app::RegionOptions region;
  region.center = center;
  region.center_local = center_local;
  region.size = size;
  region.error_m = error_m;
  simulator::SimulatorOptions options;
  options.source = source.string();
  options.settings = settings_text(settings);
  options.settings_name = "settings";
  options.load = app::load_options(region);
  options.load.source = app::source_options({});
  options.max_memory_bytes = static_cast<std::uintmax_t>(memory_gb * 1e9);
  return call_interruptibly(progress, [&](const Progress& report) {
    return std::make_unique<Simulator>(options, simulator::SimulatorLog{}, report);
  });
}

std::unique_ptr<Simulator> simulator_of_scene(const LoadedScene& scene, const py::object& settings,
                                              const std::optional<std::array<double, 3>>& ned_origin) {
  simulator::SimulatorOptions options;
  if (ned_origin) options.ned_origin_local = geometry::Vec3((*ned_origin)[0], (*ned_origin)[1], (*ned_origin)[2]);
  options.settings = settings_text(settings);
  options.settings_name = "settings";
  const py::gil_scoped_release unlocked;
  const auto meshes = scene.scene.meshes();
  return std::make_unique<Simulator>(options, std::vector<imaging::TexturedMesh>(meshes.begin(), meshes.end()));
}

/// A call that blocks until a task ends; Ctrl-C cancels the task.
template <class Call>
bool run_task(Simulator& simulator, const std::string& vehicle, Call call) {
  return call_interruptibly(
      py::none(), [&](const Progress&) { return call(); }, [&] { simulator.flight().cancel_last_task(vehicle); });
}

py::dict state_of(const Simulator& simulator, const std::string& vehicle) {
  simulator::MultirotorState state;
  simulator::KinematicsState truth;
  {
    const py::gil_scoped_release unlocked;
    state = simulator.vehicles().get_multirotor_state(vehicle);
    truth = simulator.vehicles().get_ground_truth_kinematics(vehicle);
  }
  py::dict out;
  out["time"] = seconds(state.timestamp);
  out["position"] = to_array(truth.position);
  out["orientation"] = to_array(truth.orientation);
  out["linear_velocity"] = to_array(truth.linear_velocity);
  out["angular_velocity"] = to_array(truth.angular_velocity);
  out["linear_acceleration"] = to_array(truth.linear_acceleration);
  out["angular_acceleration"] = to_array(truth.angular_acceleration);
  out["landed"] = state.landed_state == 0;
  return out;
}

py::dict collision_of(Simulator& simulator, const std::string& vehicle) {
  simulator::CollisionInfo info;
  {
    const py::gil_scoped_release unlocked;
    info = simulator.vehicles().get_collision_info(vehicle);
  }
  py::dict out;
  out["has_collided"] = info.has_collided;
  out["time"] = seconds(info.time_stamp);
  out["position"] = to_array(info.position);
  out["normal"] = to_array(info.normal);
  out["object_name"] = info.object_name;
  return out;
}

struct ImageKind {
  const char* name;
  simulator::ImageType type;
  bool is_float;
};
constexpr ImageKind kImageKinds[] = {{"rgb", simulator::ImageType::kScene, false},
                                     {"depth", simulator::ImageType::kDepthPlanar, true},
                                     {"range", simulator::ImageType::kDepthPerspective, true},
                                     {"segmentation", simulator::ImageType::kSegmentation, false},
                                     {"normals", simulator::ImageType::kSurfaceNormals, false},
                                     {"infrared", simulator::ImageType::kInfrared, false}};

const ImageKind& kind_named(const std::string& name) {
  std::string known;
  for (const ImageKind& kind : kImageKinds) {
    if (name == kind.name) return kind;
    known += (known.empty() ? "" : ", ") + std::string(kind.name);
  }
  throw py::value_error("unknown kind of image '" + name + "'; known: " + known);
}

/// Three channels come as blue, green, red; arrays hold red, green, blue.
py::array image_to_python(simulator::ImageResponse response) {
  if (response.pixels_as_float)
    return move_to_array<float>(std::move(response.image_data_float), {response.height, response.width});
  for (std::size_t i = 0; i + 2 < response.image_data_uint8.size(); i += 3)
    std::swap(response.image_data_uint8[i], response.image_data_uint8[i + 2]);
  return move_to_array<std::uint8_t>(std::move(response.image_data_uint8), {response.height, response.width, 3});
}

py::list images(Simulator& simulator, const std::vector<std::string>& kinds, const std::string& camera,
                const std::string& vehicle) {
  std::vector<simulator::ImageRequest> requests;
  for (const std::string& name : kinds) {
    const ImageKind& kind = kind_named(name);
    requests.push_back({camera, static_cast<int>(kind.type), kind.is_float, false});
  }
  std::vector<simulator::ImageResponse> responses;
  {
    const py::gil_scoped_release unlocked;
    responses = simulator.cameras().get_images(requests, vehicle, false);
  }
  py::list list;
  for (simulator::ImageResponse& response : responses) list.append(image_to_python(std::move(response)));
  return list;
}

py::dict lidar_scan(Simulator& simulator, const std::string& lidar, const std::string& vehicle) {
  simulator::LidarScanData data;
  {
    const py::gil_scoped_release unlocked;
    data = simulator.sensors().lidar_scan(lidar, vehicle);
  }
  const auto count = static_cast<py::ssize_t>(data.intensity.size());
  py::dict out = to_dict(data.pose);
  out["start"] = seconds(data.time_stamp);
  out["points"] = move_to_array<float>(std::move(data.point_cloud), {count, 3});
  out["intensity"] = move_to_array<float>(std::move(data.intensity), {count});
  out["ring"] = move_to_array<std::uint16_t>(std::move(data.ring), {count});
  out["time"] = move_to_array<float>(std::move(data.time_offset), {count});
  out["segmentation"] = move_to_array<int>(std::move(data.segmentation), {count});
  return out;
}

py::dict imu_reading(Simulator& simulator, const std::string& imu, const std::string& vehicle) {
  const simulator::ImuData data = simulator.sensors().get_imu_data(imu, vehicle);
  py::dict out;
  out["time"] = seconds(data.time_stamp);
  out["orientation"] = to_array(data.orientation);
  out["angular_rate"] = to_array(data.angular_velocity);
  out["specific_force"] = to_array(data.linear_acceleration);
  return out;
}

py::dict gps_reading(Simulator& simulator, const std::string& gps, const std::string& vehicle) {
  const simulator::GpsData data = simulator.sensors().get_gps_data(gps, vehicle);
  const simulator::GnssReport& report = data.gnss;
  py::dict out;
  out["time"] = seconds(data.time_stamp);
  out["geodetic"] = py::make_tuple(report.geo_point.latitude, report.geo_point.longitude, report.geo_point.altitude);
  out["velocity"] = to_array(report.velocity);
  out["is_valid"] = data.is_valid;
  return out;
}

/// Binds the tasks that fly a vehicle somewhere.
void bind_moves(py::class_<Simulator>& simulator) {
  using py::arg;
  constexpr int kAnyDirection = 0;  // AirSim's DrivetrainType.MaxDegreeOfFreedom
  simulator
      .def(
          "move_to_position",
          [](Simulator& s, const std::array<double, 3>& p, float speed, float timeout, const std::string& vehicle) {
            const Vector3r to = vector_from(p);
            return run_task(s, vehicle, [&] {
              return s.flight().move_to_position(to.x_val, to.y_val, to.z_val, speed, timeout, kAnyDirection, {}, -1.0F,
                                                 1.0F, vehicle);
            });
          },
          arg("position"), arg("speed"), arg("timeout") = 3e38F, arg("vehicle") = "",
          "Flies to a position (3), NED metres.")
      .def(
          "move_by_velocity",
          [](Simulator& s, const std::array<double, 3>& v, float duration, float yaw_rate_deg_s,
             const std::string& vehicle) {
            const Vector3r velocity = vector_from(v);
            return run_task(s, vehicle, [&] {
              return s.flight().move_by_velocity(velocity.x_val, velocity.y_val, velocity.z_val, duration,
                                                 kAnyDirection, {true, yaw_rate_deg_s}, vehicle);
            });
          },
          arg("velocity"), arg("duration"), arg("yaw_rate_deg_s") = 0.0F, arg("vehicle") = "",
          "Flies with a velocity (3), NED m/s, for some seconds.")
      .def(
          "move_by_velocity_body",
          [](Simulator& s, const std::array<double, 3>& v, float duration, float yaw_rate_deg_s,
             const std::string& vehicle) {
            const Vector3r velocity = vector_from(v);
            return run_task(s, vehicle, [&] {
              return s.flight().move_by_velocity_body_frame(velocity.x_val, velocity.y_val, velocity.z_val, duration,
                                                            kAnyDirection, {true, yaw_rate_deg_s}, vehicle);
            });
          },
          arg("velocity"), arg("duration"), arg("yaw_rate_deg_s") = 0.0F, arg("vehicle") = "",
          "Flies with a velocity forward, right, down, m/s, for some seconds.")
      .def(
          "move_by_attitude",
          [](Simulator& s, float roll, float pitch, float yaw, float throttle, float duration,
             const std::string& vehicle) {
            return run_task(s, vehicle, [&] {
              return s.flight().move_by_roll_pitch_yaw_throttle(roll, pitch, yaw, throttle, duration, vehicle);
            });
          },
          arg("roll"), arg("pitch"), arg("yaw"), arg("throttle"), arg("duration"), arg("vehicle") = "",
          "Angles in radians: right side down, nose up, clockwise from north; throttle 0 to 1.");
}

void bind_flight(py::class_<Simulator>& simulator) {
  using py::arg;
  simulator
      .def(
          "takeoff",
          [](Simulator& s, float timeout, const std::string& vehicle) {
            return run_task(s, vehicle, [&] { return s.flight().takeoff(timeout, vehicle); });
          },
          arg("timeout") = 20.0F, arg("vehicle") = "", "Takes off; returns whether it was done in time.")
      .def(
          "land",
          [](Simulator& s, float timeout, const std::string& vehicle) {
            return run_task(s, vehicle, [&] { return s.flight().land(timeout, vehicle); });
          },
          arg("timeout") = 60.0F, arg("vehicle") = "")
      .def(
          "hover",
          [](Simulator& s, const std::string& vehicle) {
            return run_task(s, vehicle, [&] { return s.flight().hover(vehicle); });
          },
          arg("vehicle") = "")
      .def(
          "step",
          [](Simulator& s, double duration) {
            run_interruptibly(
                py::none(), [&](const Progress&) { s.clock().continue_for_time(duration); }, [&] { s.stop(); });
          },
          arg("duration"), "Advances simulation time by some seconds, then pauses; Ctrl-C ends the simulator.");
}

void bind_sensors(py::class_<Simulator>& simulator) {
  using py::arg;
  simulator
      .def("images", &images, arg("kinds"), arg("camera") = "front_center", arg("vehicle") = "",
           "Images of one moment, a list as `kinds`: rgb, segmentation, normals, infrared (height, width, 3) uint8; "
           "depth "
           "(along the optical axis), range (along the ray) (height, width) float32 metres.")
      .def(
          "set_camera_fov",
          [](Simulator& s, const std::string& camera, float fov_deg, const std::string& vehicle) {
            s.cameras().set_camera_fov(camera, fov_deg, vehicle, false);
          },
          arg("camera"), arg("fov_deg"), arg("vehicle") = "")
      .def("lidar", &lidar_scan, arg("lidar") = "", arg("vehicle") = "",
           "A whole scan: points (N, 3), intensity, ring, time, segmentation (N), start, position, orientation.")
      .def("imu", &imu_reading, arg("imu") = "", arg("vehicle") = "")
      .def("gps", &gps_reading, arg("gps") = "", arg("vehicle") = "")
      .def(
          "distance",
          [](Simulator& s, const std::string& sensor, const std::string& vehicle) {
            return s.sensors().get_distance_sensor_data(sensor, vehicle).distance;
          },
          arg("sensor") = "", arg("vehicle") = "", "Reading of a distance sensor, metres.");
}

}  // namespace

void bind_simulator(py::module_& module) {
  using py::arg;
  py::class_<Simulator> simulator(
      module, "Simulator",
      "The world behind `tileflight serve`, in this process: vehicles, cameras and sensors over a place. Positions and "
      "velocities: north, east, down (3), metres; orientations: w, x, y, z (4), body to NED. Thread-safe.");
  simulator
      .def(py::init(&open_simulator), arg("source"), arg("settings") = py::none(), py::kw_only(),
           arg("center") = std::vector<double>{}, arg("center_local") = std::vector<double>{},
           arg("size") = std::vector<double>{}, arg("error") = 0.0, arg("memory_gb") = 2.0,
           arg("progress") = py::none(),
           "source and region are those of `load`. settings: AirSim's settings as a dictionary or text; with "
           "\"StepOnDemand\": true time passes only while a task runs, as fast as it can be computed.")
      .def_static("of_scene", &simulator_of_scene, arg("scene"), arg("settings") = py::none(), py::kw_only(),
                  arg("ned_origin") = py::none(),
                  "A simulator over a scene in memory (a copy of its triangles). ned_origin: the local point (3) from "
                  "which positions count; default: the surface at the local frame's origin or the place's middle.")
      .def(
          "close", [](Simulator& s) { s.stop(); }, py::call_guard<py::gil_scoped_release>(),
          "Cancels all tasks and unblocks all calls.")
      .def_property_readonly("warnings", &Simulator::warnings)
      .def_property_readonly("vehicles", [](const Simulator& s) { return s.vehicles().list_vehicles(); })
      .def("reset", &Simulator::reset, py::call_guard<py::gil_scoped_release>(),
           "Puts all vehicles back to their start.")
      .def(
          "enable_control",
          [](Simulator& s, bool enabled, const std::string& v) { s.vehicles().enable_api_control(enabled, v); },
          arg("enabled") = true, arg("vehicle") = "")
      .def(
          "arm", [](Simulator& s, bool armed, const std::string& v) { return s.vehicles().arm_disarm(armed, v); },
          arg("armed") = true, arg("vehicle") = "")
      .def("state", &state_of, arg("vehicle") = "",
           "A dictionary: time (s), position, orientation, linear_velocity (NED), angular_velocity (body, rad/s), "
           "linear_acceleration, angular_acceleration, landed. True values.")
      .def("collision", &collision_of, arg("vehicle") = "",
           "A dictionary: has_collided, time, position, normal, object_name of the last contact.")
      .def(
          "set_pose",
          [](Simulator& s, const std::array<double, 3>& position, const std::array<double, 4>& orientation,
             const std::string& vehicle) {
            const py::gil_scoped_release unlocked;
            s.vehicles().set_vehicle_pose(pose_from(position, orientation), true, vehicle);
          },
          arg("position"), arg("orientation") = std::array<double, 4>{1, 0, 0, 0}, arg("vehicle") = "")
      .def(
          "pose", [](const Simulator& s, const std::string& v) { return to_dict(s.vehicles().get_vehicle_pose(v)); },
          arg("vehicle") = "");
  bind_sensors(simulator);
  bind_flight(simulator);
  bind_moves(simulator);
}

}  // namespace tileflight::python
