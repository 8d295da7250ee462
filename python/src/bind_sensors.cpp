#include <array>
#include <nlohmann/json.hpp>

#include "arrays.h"
#include "bindings.h"
#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/sensors/imu.h"
#include "tileflight/capture/sensors/lidar.h"
#include "tileflight/capture/sensors/sensor_suite.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::python {
namespace {

/// A lidar with the numbers of a model's data sheet, in a scene.
class SceneLidar {
 public:
  SceneLidar(SceneHandle scene, const std::string& model, const std::optional<InputArray<double>>& T_camera_lidar,
             std::uint64_t seed, bool perfect, const std::string& motion)
      : scene_(std::move(scene)) {
    sensors::LidarOptions options = sensors::lidar_preset(model);
    options.seed = seed;
    if (T_camera_lidar) options.T_camera_lidar = rigid_motion_from(*T_camera_lidar, "T_camera_lidar");
    if (perfect) {
      options.range_sigma_m = options.range_sigma_share = options.signal_spread = options.dropout_share = 0.0;
      options.white_range_m = std::numeric_limits<double>::infinity();
    }
    options.motion = motion_named(motion);
    period_s_ = sensors::scan_period_s(options.pattern);
    const py::gil_scoped_release unlocked;
    lidar_ = std::make_unique<sensors::Lidar>(scene_->scene, options);
  }

  double period_s() const { return period_s_; }

  py::dict scan(const flight_path::Path& path, std::uint64_t number, double start_s) const {
    return to_arrays([&] { return lidar_->scan(number, start_s, [&](double t) { return path.pose(t); }); });
  }
  py::dict scan_at_rest(const InputArray<double>& T_local_camera, std::uint64_t number) const {
    const geometry::SE3 pose = rigid_motion_from(T_local_camera, "T_local_camera");
    return to_arrays([&] { return lidar_->scan(number, 0.0, [&](double) { return pose; }); });
  }

 private:
  static sensors::ScanMotion motion_named(const std::string& name) {
    if (name == "distorted") return sensors::ScanMotion::kDistorted;
    if (name == "corrected") return sensors::ScanMotion::kCorrected;
    if (name == "frozen") return sensors::ScanMotion::kFrozen;
    throw py::value_error("motion must be 'distorted', 'corrected' or 'frozen', not '" + name + "'");
  }

  template <class Scan>
  static py::dict to_arrays(Scan scan) {
    sensors::LidarScan result;
    {
      const py::gil_scoped_release unlocked;
      result = scan();
    }
    const auto count = static_cast<py::ssize_t>(result.points.size());
    std::vector<float> positions, intensities, times;
    std::vector<std::uint16_t> rings;
    for (const sensors::LidarPoint& point : result.points) {
      positions.insert(positions.end(), point.position.data(), point.position.data() + 3);
      intensities.push_back(point.intensity);
      times.push_back(point.time_s);
      rings.push_back(point.ring);
    }
    py::dict arrays;
    arrays["points"] = move_to_array<float>(std::move(positions), {count, 3});
    arrays["intensity"] = move_to_array<float>(std::move(intensities), {count});
    arrays["time"] = move_to_array<float>(std::move(times), {count});
    arrays["ring"] = move_to_array<std::uint16_t>(std::move(rings), {count});
    arrays["start"] = result.time_s;
    arrays["T_local_lidar"] = py::cast(result.T_local_lidar.matrix());
    arrays["beams"] = result.beams;
    return arrays;
  }

  SceneHandle scene_;
  double period_s_ = 0.0;
  std::unique_ptr<sensors::Lidar> lidar_;
};

flight_path::Path path_from(const InputArray<double>& times, const InputArray<double>& poses) {
  return flight_path::path_through_poses(trajectory_from(times, poses));
}

py::dict simulate_imu(const flight_path::Path& path, const std::string& model, std::optional<double> rate_hz,
                      std::uint64_t seed, const std::optional<InputArray<double>>& T_camera_imu) {
  sensors::ImuOptions options = sensors::imu_preset(model);
  options.seed = seed;
  if (rate_hz) options.rate_hz = *rate_hz;
  if (T_camera_imu) options.T_camera_imu = rigid_motion_from(*T_camera_imu, "T_camera_imu");
  sensors::ImuRecording recording;
  {
    const py::gil_scoped_release unlocked;
    recording = sensors::simulate_imu(sensors::motion_along(path), path.start_s(), path.end_s(), options);
  }
  const auto count = static_cast<py::ssize_t>(recording.samples.size());
  std::vector<double> times;
  std::vector<geometry::Vec3> rates, forces, rate_biases, force_biases;
  for (const geometry::ImuSample& sample : recording.samples) {
    times.push_back(sample.time_s);
    rates.push_back(sample.angular_rate_rad_s);
    forces.push_back(sample.specific_force_m_s2);
  }
  for (const geometry::ImuBias& bias : recording.biases) {
    rate_biases.push_back(bias.gyroscope_rad_s);
    force_biases.push_back(bias.accelerometer_m_s2);
  }
  py::dict arrays;
  arrays["times"] = move_to_array<double>(std::move(times), {count});
  arrays["angular_rate"] = points_to_array(std::move(rates));
  arrays["specific_force"] = points_to_array(std::move(forces));
  arrays["gyroscope_bias"] = points_to_array(std::move(rate_biases));
  arrays["accelerometer_bias"] = points_to_array(std::move(force_biases));
  return arrays;
}

/// Builds a dictionary of arrays from attributes of samples, one attribute a call.
template <class Sample>
class Columns {
 public:
  explicit Columns(const std::vector<Sample>& samples) : samples_(samples) {}

  template <class Read>
  Columns& numbers(const char* name, const Read& read) {
    std::vector<double> values;
    values.reserve(samples_.size());
    for (const Sample& sample : samples_) values.push_back(read(sample));
    arrays_[name] = move_to_array<double>(std::move(values), {count()});
    return *this;
  }
  template <class Read>
  Columns& vectors(const char* name, const Read& read) {
    std::vector<geometry::Vec3> values;
    values.reserve(samples_.size());
    for (const Sample& sample : samples_) values.push_back(read(sample));
    arrays_[name] = points_to_array(std::move(values));
    return *this;
  }
  template <class Read>
  Columns& rotations(const char* name, const Read& read) {
    std::vector<double> values;
    values.reserve(9 * samples_.size());
    for (const Sample& sample : samples_) {
      const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> matrix = read(sample);
      values.insert(values.end(), matrix.data(), matrix.data() + 9);
    }
    arrays_[name] = move_to_array<double>(std::move(values), {count(), 3, 3});
    return *this;
  }
  py::dict take() { return std::move(arrays_); }

 private:
  py::ssize_t count() const { return static_cast<py::ssize_t>(samples_.size()); }

  const std::vector<Sample>& samples_;
  py::dict arrays_;
};

/// Readings of a suite's sensors along a path; empty for a sensor that the suite lacks.
struct Recordings {
  std::vector<sensors::GnssFix> gnss;
  std::vector<sensors::AttitudeSample> attitude;
  std::vector<sensors::BarometerSample> barometer;
  std::vector<sensors::MagnetometerSample> magnetometer;
  std::vector<sensors::RangeSample> range_finder;
};

Recordings record(const sensors::SensorSuite& suite, const flight_path::Path& path, const scene::Scene* scene,
                  const std::optional<geometry::LocalFrame>& frame) {
  const double from_s = path.start_s(), to_s = path.end_s();
  const auto pose_at = [&](double t) { return path.pose(t); };
  Recordings out;
  if (suite.gnss)
    out.gnss = sensors::simulate_gnss([&](double t) { return path.pose(t).translation; }, from_s, to_s, *suite.gnss);
  if (suite.attitude)
    out.attitude = sensors::simulate_attitude(
        pose_at, flight_path::make_sample_times("attitude", from_s, to_s, suite.attitude->rate_hz), *suite.attitude);
  if (suite.barometer) {
    const auto height_m = sensors::height_above_sea(suite, frame, path.pose(from_s).translation);
    out.barometer = sensors::simulate_barometer([&](double t) { return height_m(path.pose(t).translation); }, from_s,
                                                to_s, *suite.barometer);
  }
  if (suite.magnetometer)
    out.magnetometer = sensors::simulate_magnetometer(pose_at, sensors::magnetic_field_at(suite.magnetic_field, frame),
                                                      from_s, to_s, *suite.magnetometer);
  if (suite.range_finder) {
    const auto times = flight_path::make_sample_times("range finder", from_s, to_s, suite.range_finder->rate_hz);
    out.range_finder = sensors::simulate_range_finder(*scene, pose_at, times, 0, times.count(), *suite.range_finder);
  }
  return out;
}

std::optional<geometry::LocalFrame> frame_of(const std::optional<std::array<double, 3>>& origin,
                                             const SceneHandle& scene) {
  if (origin) return geometry::LocalFrame({(*origin)[0], (*origin)[1], geometry::EllipsoidalHeight{(*origin)[2]}});
  return scene ? scene->tiles.local_frame : std::nullopt;
}

py::dict simulate_sensors(const flight_path::Path& path, const py::dict& options, const SceneHandle& scene,
                          std::uint64_t seed, const std::optional<std::array<double, 3>>& origin) {
  const nlohmann::json json = to_json(options, "sensors");
  for (const char* other : {"imu", "lidar"}) {
    if (json.contains(other))
      throw py::value_error(std::string("sensors: ") + other + " is simulated by " +
                            (std::string(other) == "imu" ? "simulate_imu" : "Lidar"));
  }
  const sensors::SensorSuite suite = sensors::read_sensor_suite(base::StrictSection(json, "sensors"), seed, {});
  if (suite.range_finder && !scene) throw py::value_error("sensors: a range_finder needs a scene");
  const auto frame = frame_of(origin, scene);
  Recordings recorded;
  {
    const py::gil_scoped_release unlocked;
    recorded = record(suite, path, scene ? &scene->scene : nullptr, frame);
  }
  const auto time = [](const auto& sample) { return sample.time_s; };
  py::dict out;
  if (suite.gnss)
    out["gnss"] = Columns(recorded.gnss)
                      .numbers("times", time)
                      .vectors("position", [](const auto& s) { return s.position; })
                      .numbers("horizontal_sigma", [](const auto& s) { return s.horizontal_sigma_m; })
                      .numbers("vertical_sigma", [](const auto& s) { return s.vertical_sigma_m; })
                      .take();
  if (suite.attitude)
    out["attitude"] =
        Columns(recorded.attitude)
            .numbers("times", time)
            .rotations("R_local_camera", [](const auto& s) { return s.R_local_camera.toRotationMatrix(); })
            .take();
  if (suite.barometer)
    out["barometer"] = Columns(recorded.barometer)
                           .numbers("times", time)
                           .numbers("pressure", [](const auto& s) { return s.pressure_pa; })
                           .numbers("temperature", [](const auto& s) { return s.temperature_k; })
                           .numbers("altitude", [](const auto& s) { return s.altitude_m; })
                           .take();
  if (suite.magnetometer)
    out["magnetometer"] = Columns(recorded.magnetometer)
                              .numbers("times", time)
                              .vectors("field", [](const auto& s) { return s.field_ut; })
                              .take();
  if (suite.range_finder)
    out["range_finder"] = Columns(recorded.range_finder)
                              .numbers("times", time)
                              .numbers("range", [](const auto& s) { return s.range_m; })
                              .take();
  return out;
}

}  // namespace

void bind_sensors(py::module_& module) {
  using flight_path::Path;
  using py::arg;
  py::class_<Path>(module, "Path",
                   "A smooth camera path. Before its start and after its end, the camera is at the respective end.")
      .def(py::init(&path_from), arg("times"), arg("poses"),
           "Makes a path through poses T_local_camera (N, 4, 4) at times (N), seconds: cubic splines in position and "
           "quaternion.")
      .def_property_readonly("start", &Path::start_s, "Seconds.")
      .def_property_readonly("end", &Path::end_s, "Seconds.")
      .def(
          "pose", [](const Path& p, double t) { return p.pose(t).matrix(); }, arg("time"), "T_local_camera (4, 4).")
      .def("velocity", &Path::velocity, arg("time"), "Velocity of the camera in the local frame (3), m/s.")
      .def("acceleration", &Path::acceleration, arg("time"),
           "Acceleration of the camera in the local frame (3), m/s^2, without gravity.")
      .def("angular_velocity", &Path::angular_velocity, arg("time"), "Angular velocity in camera axes (3), rad/s.");
  py::class_<SceneLidar>(module, "Lidar",
                         "A lidar in a scene; lidar frame: x forward, y left, z up. A scan is a dictionary: points "
                         "(N, 3) float32 metres in the lidar frame, intensity (N) 0 to 1, time (N) seconds after the "
                         "start, ring (N), start, T_local_lidar (4, 4) at the start, beams fired.")
      .def(
          py::init<SceneHandle, const std::string&, const std::optional<InputArray<double>>&, std::uint64_t, bool,
                   const std::string&>(),
          arg("scene"), arg("model") = "vlp-16", py::kw_only(), arg("T_camera_lidar") = py::none(), arg("seed") = 1,
          arg("perfect") = false, arg("motion") = "distorted",
          "model: vlp-16, os1-64, hdl-64e, livox-mid-40. T_camera_lidar: mounting (default: upright on the camera). "
          "perfect: no noise and no lost returns. motion: 'distorted' (points in the lidar's frame at their time, as a "
          "real one gives them), 'corrected' (in its frame at the start), 'frozen' (all beams at the start).")
      .def_property_readonly("period", &SceneLidar::period_s, "Seconds from scan to scan.")
      .def("scan", &SceneLidar::scan, arg("path"), arg("number") = 0, arg("start") = 0.0,
           "Scan `number`, which starts at `start` seconds, of a camera that moves along the path.")
      .def("scan_at_rest", &SceneLidar::scan_at_rest, arg("T_local_camera"), arg("number") = 0,
           "A scan from a camera at rest.");
  module.def("simulate_imu", &simulate_imu, arg("path"), arg("model") = "adis16448", py::kw_only(),
             arg("rate_hz") = py::none(), arg("seed") = 1, arg("T_camera_imu") = py::none(),
             "Readings of an inertial unit along a path. model: adis16448 (EuRoC's), bmi160, perfect. A dictionary: "
             "times (N), angular_rate (N, 3) rad/s, specific_force (N, 3) m/s^2 in the unit's axes, gyroscope_bias and "
             "accelerometer_bias (N, 3), the true ones.");
  module.def(
      "simulate_sensors", &simulate_sensors, arg("path"), arg("sensors"), py::kw_only(), arg("scene") = SceneHandle(),
      arg("seed") = 1, arg("origin") = py::none(),
      "Readings of other sensors along a path. sensors: as `sensors:` of a flight file, for example {'gnss': "
      "{'rate_hz': 5}, 'barometer': {}}; there are gnss, attitude, barometer, magnetometer and range_finder, which "
      "needs a scene. origin: latitude, longitude (degrees), height (metres above the ellipsoid) of the local "
      "frame; default: the scene's. A dictionary by sensor of dictionaries with times (N), seconds, and: gnss: "
      "position (N, 3) local metres, horizontal_sigma and vertical_sigma (N); attitude: R_local_camera (N, 3, 3); "
      "barometer: pressure (N) Pa, temperature (N) K, altitude (N) metres above the sea by the standard "
      "atmosphere; magnetometer: field (N, 3) microtesla in camera axes; range_finder: range (N) metres, "
      "infinite beyond the largest. Raises InputError for keys and values that a flight file may not have.");
}

}  // namespace tileflight::python
