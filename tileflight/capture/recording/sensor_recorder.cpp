#include "tileflight/capture/recording/sensor_recorder.h"

#include <cmath>

#include "tileflight/capture/sensors/imu.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/lidar_files.h"
#include "tileflight/data/dataset/sensor_files.h"

namespace tileflight::recording {
namespace fs = std::filesystem;
namespace {

using geometry::Vec3;
using OptionalFrame = std::optional<geometry::LocalFrame>;

std::string scan_name(std::size_t number) { return base::formatted("%06zu", number); }

std::vector<dataset::ScanPoint> to_scan_points(const std::vector<sensors::LidarPoint>& points) {
  std::vector<dataset::ScanPoint> result;
  result.reserve(points.size());
  for (const sensors::LidarPoint& p : points) result.push_back({p.position, p.intensity, p.time_s, p.ring});
  return result;
}

/// Index i of the first event at start + i * period_s that is not before `time_s`.
std::uint64_t first_index_from(double time_s, double start_s, double period_s) {
  return static_cast<std::uint64_t>(std::max(0.0, std::ceil((time_s - start_s) / period_s - 1e-6)));
}

/// The name used in the flight file.
std::string motion_name(sensors::ScanMotion motion) {
  if (motion == sensors::ScanMotion::kDistorted) return "distorted";
  return motion == sensors::ScanMotion::kCorrected ? "corrected" : "frozen";
}

}  // namespace

SensorRecorder::SensorRecorder(sensors::SensorSuite suite, flight_path::Path path, geometry::Trajectory frames)
    : suite_(std::move(suite)), path_(std::move(path)), frames_(std::move(frames)) {}

void SensorRecorder::record(const scene::Scene& scene, const OptionalFrame& frame, double from_s, double to_s,
                            const fs::path& folder) {
  if (suite_.magnetometer) sensors::magnetic_field_at(suite_.magnetic_field, frame);  // refuses before the work
  if (suite_.lidar) scan(scene, from_s, to_s, folder);
  if (suite_.range_finder) {
    const auto times = flight_path::make_sample_times("range finder", start_s(), end_s(), suite_.range_finder->rate_hz);
    const double period_s = 1.0 / times.rate_hz;
    const std::uint64_t first = first_index_from(from_s, times.start_s, period_s);
    const std::uint64_t last = std::isfinite(to_s) ? first_index_from(to_s, times.start_s, period_s) : times.count();
    const auto samples = sensors::simulate_range_finder(
        scene, [this](double t) { return path_.pose(t); }, times, first, last, *suite_.range_finder);
    ranges_.insert(ranges_.end(), samples.begin(), samples.end());
  }
}

/// Only complete scans are recorded.
void SensorRecorder::scan(const scene::Scene& scene, double from_s, double to_s, const fs::path& folder) {
  base::make_folder(folder / "lidar");
  const sensors::Lidar lidar(scene, *suite_.lidar, placed_);
  const double period_s = sensors::scan_period_s(suite_.lidar->pattern);
  for (std::uint64_t number = first_index_from(from_s, start_s(), period_s);; ++number) {
    const double scan_s = start_s() + static_cast<double>(number) * period_s;
    if (scan_s >= to_s - 1e-6 * period_s || scan_s + period_s > end_s() + 1e-6 * period_s) return;
    const sensors::LidarScan scan = lidar.scan(number, scan_s, [this](double t) { return path_.pose(t); });
    const fs::path name = folder / "lidar" / scan_name(number);
    if (suite_.kitti_scans)
      dataset::write_scan_bin(name.string() + ".bin", to_scan_points(scan.points));
    else
      dataset::write_scan_ply(name.string() + ".ply", to_scan_points(scan.points));
    scans_.poses.push_back({scan_s, scan.T_local_lidar});
  }
}

void SensorRecorder::write(const OptionalFrame& frame, double first_frame_s, const fs::path& folder) const {
  const double shift_s = first_frame_s - start_s();
  if (suite_.imu) write_imu(shift_s, folder);
  if (suite_.barometer) write_barometer(frame, shift_s, folder);
  if (suite_.magnetometer) write_magnetometer(frame, shift_s, folder);
  if (suite_.range_finder) {
    dataset::NumberTable table{{"t [s]", "range [m]"}, {}};
    for (const sensors::RangeSample& s : ranges_) table.rows.push_back({s.time_s + shift_s, s.range_m});
    dataset::write_number_table(folder / "range.csv", table);
  }
  if (suite_.lidar) write_scan_lists(shift_s, folder);
}

void SensorRecorder::write_imu(double shift_s, const fs::path& folder) const {
  const sensors::ImuOptions& options = *suite_.imu;
  sensors::ImuRecording recording = sensors::simulate_imu(sensors::motion_along(path_), start_s(), end_s(), options);
  dataset::NumberTable biases{{"t [s]", "gyroscope x [rad/s]", "gyroscope y [rad/s]", "gyroscope z [rad/s]",
                               "accelerometer x [m/s^2]", "accelerometer y [m/s^2]", "accelerometer z [m/s^2]"},
                              {}};
  for (std::size_t i = 0; i < recording.samples.size(); ++i) {
    geometry::ImuSample& sample = recording.samples[i];
    sample.time_s += shift_s;
    const Vec3 &g = recording.biases[i].gyroscope_rad_s, &a = recording.biases[i].accelerometer_m_s2;
    biases.rows.push_back({sample.time_s, g.x(), g.y(), g.z(), a.x(), a.y(), a.z()});
  }
  dataset::write_imu_csv(folder / "imu.csv", recording.samples);
  dataset::write_number_table(folder / "imu_bias.csv", biases);
  dataset::write_imu_yaml(folder / "imu.yaml",
                          {options.rate_hz, options.accelerometer_noise_density, options.accelerometer_random_walk,
                           options.gyroscope_noise_density, options.gyroscope_random_walk});
}

void SensorRecorder::write_barometer(const OptionalFrame& frame, double shift_s, const fs::path& folder) const {
  const auto height_m = sensors::height_above_sea(suite_, frame, frames_.poses.front().T_local_camera.translation);
  const auto samples = sensors::simulate_barometer([&](double t) { return height_m(path_.pose(t).translation); },
                                                   start_s(), end_s(), *suite_.barometer);
  dataset::NumberTable table{{"t [s]", "pressure [Pa]", "temperature [K]", "altitude [m]"}, {}};
  for (const sensors::BarometerSample& s : samples)
    table.rows.push_back({s.time_s + shift_s, s.pressure_pa, s.temperature_k, s.altitude_m});
  dataset::write_number_table(folder / "barometer.csv", table);
}

void SensorRecorder::write_magnetometer(const OptionalFrame& frame, double shift_s, const fs::path& folder) const {
  const auto field_at = sensors::magnetic_field_at(suite_.magnetic_field, frame);
  dataset::NumberTable table{{"t [s]", "x [uT]", "y [uT]", "z [uT]"}, {}};
  for (const sensors::MagnetometerSample& s : sensors::simulate_magnetometer(
           [this](double t) { return path_.pose(t); }, field_at, start_s(), end_s(), *suite_.magnetometer))
    table.rows.push_back({s.time_s + shift_s, s.field_ut.x(), s.field_ut.y(), s.field_ut.z()});
  dataset::write_number_table(folder / "magnetometer.csv", table);
}

void SensorRecorder::write_scan_lists(double shift_s, const fs::path& folder) const {
  base::make_folder(folder / "lidar");
  geometry::Trajectory poses = scans_;
  std::string times;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    poses.poses[i].time_s += shift_s;
    times += scan_name(i) + " " + base::fixed_text(poses.poses[i].time_s) + "\n";
  }
  base::write_file(folder / "lidar" / "times.txt", times);
  geometry::write_tum(folder / "lidar" / "poses.txt", poses);
}

std::map<std::string, std::string> SensorRecorder::description() const {
  std::map<std::string, std::string> lines;
  const auto add = [&lines](const std::string& sensor, double rate_hz, std::uint64_t seed) {
    lines["sensors." + sensor + ".rate_hz"] = base::fixed_text(rate_hz);
    lines["sensors." + sensor + ".seed"] = std::to_string(seed);
  };
  if (suite_.imu) add("imu", suite_.imu->rate_hz, suite_.imu->seed);
  if (suite_.gnss) add("gnss", suite_.gnss->rate_hz, suite_.gnss->seed);
  if (suite_.barometer) add("barometer", suite_.barometer->rate_hz, suite_.barometer->seed);
  if (suite_.magnetometer) add("magnetometer", suite_.magnetometer->rate_hz, suite_.magnetometer->seed);
  if (suite_.range_finder) add("range_finder", suite_.range_finder->rate_hz, suite_.range_finder->seed);
  if (suite_.lidar) {
    add("lidar", 1.0 / sensors::scan_period_s(suite_.lidar->pattern), suite_.lidar->seed);
    lines["sensors.lidar.motion"] = motion_name(suite_.lidar->motion);
    lines["sensors.lidar.scans"] = std::to_string(scans_.size());
  }
  return lines;
}

}  // namespace tileflight::recording
