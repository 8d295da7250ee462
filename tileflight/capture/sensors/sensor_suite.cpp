#include "tileflight/capture/sensors/sensor_suite.h"

#include <string>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/sensors/magnetometer.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::sensors {
namespace {

using base::StrictSection;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

void read_number(StrictSection& section, const std::string& key, double& value) {
  value = section.number(key).value_or(value);
}

void read_integer(StrictSection& section, const std::string& key, int& value) {
  value = section.integer(key).value_or(value);
}

void read_vector(StrictSection& section, const std::string& key, Vec3& value) {
  if (const auto numbers = section.numbers(key, 3, 3)) value = Vec3(numbers->data());
}

/// Reads a matrix row by row.
void read_matrix(StrictSection& section, const std::string& key, Mat3& value) {
  if (const auto numbers = section.numbers(key, 9, 9)) value = Mat3(numbers->data()).transpose();
}

void read_seed(StrictSection& section, std::uint64_t& seed) {
  if (const auto value = section.integer("seed")) {
    if (*value < 0) throw section.error("seed", "must not be negative");
    seed = static_cast<std::uint64_t>(*value);
  }
}

/// Reads the remaining keys and checks the options; errors name the section's position.
template <class Options>
Options finish_and_check(StrictSection& section, const Options& options) {
  section.require_all_keys_used();
  try {
    check(options);
  } catch (const InputError& error) {
    throw InputError(section.file().string(), error.what());
  }
  return options;
}

void read_rate(StrictSection& section, double& rate_hz) {
  read_number(section, "rate_hz", rate_hz);
  if (!(rate_hz > 0.0 && rate_hz <= 1e5)) throw section.error("rate_hz", "must lie between 0 and 100000");
}

ImuOptions read_imu(StrictSection section, std::uint64_t seed, const SE3& T_camera_imu) {
  ImuOptions o = imu_preset(section.choice("preset", {"adis16448", "bmi160", "perfect"}).value_or("adis16448"));
  o.seed = seed;
  o.T_camera_imu = T_camera_imu;
  read_seed(section, o.seed);
  read_rate(section, o.rate_hz);
  read_number(section, "accelerometer_noise_density", o.accelerometer_noise_density);
  read_number(section, "accelerometer_random_walk", o.accelerometer_random_walk);
  read_number(section, "gyroscope_noise_density", o.gyroscope_noise_density);
  read_number(section, "gyroscope_random_walk", o.gyroscope_random_walk);
  read_vector(section, "accelerometer_bias", o.accelerometer_bias);
  read_vector(section, "gyroscope_bias", o.gyroscope_bias);
  read_matrix(section, "accelerometer_scale_misalignment", o.accelerometer_scale_misalignment);
  read_matrix(section, "gyroscope_scale_misalignment", o.gyroscope_scale_misalignment);
  read_number(section, "accelerometer_range_m_s2", o.accelerometer_range_m_s2);
  read_number(section, "gyroscope_range_rad_s", o.gyroscope_range_rad_s);
  read_number(section, "gravity_m_s2", o.gravity_m_s2);
  return finish_and_check(section, o);
}

GnssOptions read_gnss(StrictSection section, std::uint64_t seed) {
  GnssOptions o{.seed = seed};
  read_seed(section, o.seed);
  read_rate(section, o.rate_hz);
  for (const auto& [key, value] : {std::pair{"horizontal_sigma_m", &o.horizontal_sigma_m},
                                   {"vertical_sigma_m", &o.vertical_sigma_m},
                                   {"horizontal_bias_sigma_m", &o.horizontal_bias_sigma_m},
                                   {"vertical_bias_sigma_m", &o.vertical_bias_sigma_m}}) {
    read_number(section, key, *value);
    if (*value < 0.0) throw section.error(key, "must not be negative");
  }
  read_number(section, "bias_time_s", o.bias_time_s);
  if (o.bias_time_s <= 0.0) throw section.error("bias_time_s", "must be more than 0");
  read_number(section, "lag_s", o.lag_s);
  section.require_all_keys_used();
  return o;
}

AttitudeOptions read_attitude(StrictSection section, std::uint64_t seed) {
  AttitudeOptions o{.seed = seed};
  read_seed(section, o.seed);
  read_rate(section, o.rate_hz);
  read_number(section, "noise_deg", o.noise_deg);
  read_number(section, "tilt_bias_sigma_deg", o.tilt_bias_sigma_deg);
  read_number(section, "yaw_bias_sigma_deg", o.yaw_bias_sigma_deg);
  read_number(section, "bias_time_s", o.bias_time_s);
  return finish_and_check(section, o);
}

BarometerOptions read_barometer(StrictSection section, std::uint64_t seed, double& origin_above_sea_m) {
  BarometerOptions o{.seed = seed};
  read_seed(section, o.seed);
  read_rate(section, o.rate_hz);
  read_number(section, "sea_level_pressure_pa", o.atmosphere.sea_level_pressure_pa);
  read_number(section, "sea_level_temperature_k", o.atmosphere.sea_level_temperature_k);
  read_number(section, "noise_pa", o.noise_pa);
  read_number(section, "drift_pa", o.drift_pa);
  read_number(section, "drift_time_s", o.drift_time_s);
  read_number(section, "origin_above_sea_m", origin_above_sea_m);
  return finish_and_check(section, o);
}

/// The field is given completely or not at all.
void read_magnetic_field(StrictSection& section, MagneticField& field) {
  const auto declination = section.number("declination_deg"), inclination = section.number("inclination_deg");
  const auto strength = section.number("strength_ut");
  const int angles = (declination ? 1 : 0) + (inclination ? 1 : 0) + (strength ? 1 : 0);
  if (angles == 3) field.fixed_field_ut = magnetic_field_from_angles_ut(*declination, *inclination, *strength);
  if (angles == 1 || angles == 2)
    throw section.error("strength_ut", "declination_deg and inclination_deg go together; give all three or none");
  read_number(section, "year", field.year);
  if (!(field.year >= 2025.0 && field.year <= 2030.0)) throw section.error("year", "must lie between 2025 and 2030");
}

MagnetometerOptions read_magnetometer(StrictSection section, std::uint64_t seed, const SE3& T_camera_imu,
                                      MagneticField& field) {
  MagnetometerOptions o{.seed = seed, .T_camera_sensor = T_camera_imu};
  read_seed(section, o.seed);
  read_rate(section, o.rate_hz);
  read_number(section, "noise_ut", o.noise_ut);
  read_vector(section, "hard_iron_ut", o.hard_iron_ut);
  read_matrix(section, "soft_iron", o.soft_iron);
  read_magnetic_field(section, field);
  return finish_and_check(section, o);
}

RangeFinderOptions read_range_finder(StrictSection section, std::uint64_t seed) {
  RangeFinderOptions o{.seed = seed};
  read_seed(section, o.seed);
  read_rate(section, o.rate_hz);
  o.direction_is_local = section.choice("frame", {"local", "camera"}).value_or("local") == "local";
  if (!o.direction_is_local) o.direction = Vec3::UnitZ();
  read_vector(section, "direction", o.direction);
  read_vector(section, "position", o.position_camera);
  read_number(section, "beam_width_deg", o.beam_width_deg);
  read_integer(section, "rays", o.rays);
  read_number(section, "min_range_m", o.min_range_m);
  read_number(section, "max_range_m", o.max_range_m);
  read_number(section, "noise_m", o.noise_m);
  read_number(section, "noise_share", o.noise_share);
  return finish_and_check(section, o);
}

/// One value of `elevations_deg` per channel; or `channels` values, evenly from the lowest to the highest.
void read_elevations(StrictSection& section, std::vector<double>& elevations_deg) {
  if (const auto list = section.numbers("elevations_deg", 1, 4096)) elevations_deg = *list;
  const auto channels = section.integer("channels");
  const auto ends = section.numbers("elevation_range_deg", 2, 2);
  if (channels.has_value() != ends.has_value())
    throw section.error("channels", "and 'elevation_range_deg' go together");
  if (!channels) return;
  if (*channels < 2 || *channels > 4096) throw section.error("channels", "must be 2 to 4096");
  elevations_deg.clear();
  for (int i = 0; i < *channels; ++i)
    elevations_deg.push_back((*ends)[0] + ((*ends)[1] - (*ends)[0]) * i / (*channels - 1));
}

void read_pattern_keys(StrictSection& section, SpinningPattern& p) {
  read_integer(section, "columns", p.columns);
  read_elevations(section, p.elevations_deg);
  read_number(section, "channel_delay_s", p.channel_delay_s);
  if (const auto azimuth = section.numbers("azimuth_range_deg", 2, 2)) {
    p.azimuth_from_deg = (*azimuth)[0];
    p.azimuth_to_deg = (*azimuth)[1];
  }
}

void read_pattern_keys(StrictSection& section, RosettePattern& p) {
  read_number(section, "points_per_second", p.points_per_second);
  read_number(section, "fov_deg", p.fov_deg);
  if (const auto speeds = section.numbers("prism_rpm", 2, 2)) {
    p.first_prism_rpm = (*speeds)[0];
    p.second_prism_rpm = (*speeds)[1];
  }
}

void read_pattern_keys(StrictSection& section, RasterPattern& p) {
  read_integer(section, "columns", p.columns);
  read_integer(section, "rows", p.rows);
  read_number(section, "horizontal_fov_deg", p.horizontal_fov_deg);
  read_number(section, "vertical_fov_deg", p.vertical_fov_deg);
}

void read_pattern(StrictSection& section, LidarPattern& pattern) {
  const auto kind = section.choice("pattern", {"spinning", "rosette", "raster"});
  if (kind == "spinning" && !std::holds_alternative<SpinningPattern>(pattern)) pattern = SpinningPattern{};
  if (kind == "rosette" && !std::holds_alternative<RosettePattern>(pattern)) pattern = RosettePattern{};
  if (kind == "raster" && !std::holds_alternative<RasterPattern>(pattern)) pattern = RasterPattern{};
  std::visit(
      [&section](auto& p) {
        read_number(section, "rate_hz", p.rate_hz);
        read_pattern_keys(section, p);
      },
      pattern);
}

/// Kalibr's convention: maps lidar coordinates to the camera's; 16 numbers, row by row.
void read_mount(StrictSection& section, SE3& T_camera_lidar) {
  const auto numbers = section.numbers("T_cam_lidar", 16, 16);
  if (!numbers) return;
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> m(numbers->data());
  const Mat3 rotation = m.topLeftCorner<3, 3>();
  if (!(rotation.transpose() * rotation).isIdentity(1e-3) || rotation.determinant() < 0.0)
    throw section.error("T_cam_lidar", "is not a rigid motion");
  T_camera_lidar = SE3(rotation, m.topRightCorner<3, 1>());
}

ScanMotion read_motion(StrictSection& section) {
  const std::string word = section.choice("motion", {"distorted", "corrected", "frozen"}).value_or("distorted");
  if (word == "corrected") return ScanMotion::kCorrected;
  return word == "frozen" ? ScanMotion::kFrozen : ScanMotion::kDistorted;
}

LidarOptions read_lidar(StrictSection section, std::uint64_t seed, bool& kitti_scans) {
  const auto preset = section.choice("preset", {"vlp-16", "os1-64", "hdl-64e", "livox-mid-40"});
  LidarOptions o = preset ? lidar_preset(*preset) : LidarOptions{};
  o.seed = seed;
  read_seed(section, o.seed);
  read_pattern(section, o.pattern);
  read_mount(section, o.T_camera_lidar);
  o.motion = read_motion(section);
  read_number(section, "min_range_m", o.min_range_m);
  read_number(section, "max_range_m", o.max_range_m);
  read_number(section, "range_sigma_m", o.range_sigma_m);
  read_number(section, "range_sigma_share", o.range_sigma_share);
  read_number(section, "divergence_rad", o.divergence_rad);
  read_number(section, "albedo_gain", o.albedo_gain);
  o.intensity_falls_with_range = section.boolean("intensity_falls_with_range").value_or(o.intensity_falls_with_range);
  read_number(section, "intensity_reference_m", o.intensity_reference_m);
  read_number(section, "white_range_m", o.white_range_m);
  read_number(section, "signal_spread", o.signal_spread);
  read_number(section, "max_incidence_deg", o.max_incidence_deg);
  read_number(section, "dropout_share", o.dropout_share);
  kitti_scans = section.choice("format", {"ply", "kitti"}).value_or("ply") == "kitti";
  return finish_and_check(section, o);
}

}  // namespace

SensorSuite read_sensor_suite(StrictSection section, std::uint64_t seed, const SE3& T_camera_imu) {
  SensorSuite suite;
  if (auto s = section.section("imu")) suite.imu = read_imu(*s, seed, T_camera_imu);
  if (auto s = section.section("gnss")) suite.gnss = read_gnss(*s, seed);
  if (auto s = section.section("attitude")) suite.attitude = read_attitude(*s, seed);
  if (auto s = section.section("barometer")) suite.barometer = read_barometer(*s, seed, suite.origin_above_sea_m);
  if (auto s = section.section("magnetometer"))
    suite.magnetometer = read_magnetometer(*s, seed, T_camera_imu, suite.magnetic_field);
  if (auto s = section.section("range_finder")) suite.range_finder = read_range_finder(*s, seed);
  if (auto s = section.section("lidar")) suite.lidar = read_lidar(*s, seed, suite.kitti_scans);
  section.require_all_keys_used();
  return suite;
}

SensorSuite read_sensor_suite(const std::filesystem::path& flight_file, std::uint64_t seed, const SE3& T_camera_imu) {
  StrictSection flight = StrictSection::load(flight_file);
  const auto section = flight.section("sensors");
  const auto file = flight.path("sensors_file");
  if (section && file) throw flight.error("sensors_file", "and 'sensors' are both given; keep one of the two");
  if (file) return read_sensor_suite(StrictSection::load(*file), seed, T_camera_imu);
  return section ? read_sensor_suite(*section, seed, T_camera_imu) : SensorSuite{};
}

std::function<double(const Vec3&)> height_above_sea(const SensorSuite& suite,
                                                    const std::optional<geometry::LocalFrame>& frame,
                                                    const Vec3& near) {
  if (!frame) return [above_m = suite.origin_above_sea_m](const Vec3& position) { return position.z() + above_m; };
  const geometry::Geodetic at = frame->geodetic_from_local(near);
  const double undulation_m = geometry::ellipsoidal_from_orthometric(at.latitude_deg, at.longitude_deg, {0.0}).m;
  return [frame = *frame, undulation_m](const Vec3& position) {
    return frame.geodetic_from_local(position).height.m - undulation_m;
  };
}

std::function<Vec3(const Vec3&)> magnetic_field_at(const MagneticField& field,
                                                   const std::optional<geometry::LocalFrame>& frame) {
  if (field.fixed_field_ut) return [fixed = *field.fixed_field_ut](const Vec3&) { return fixed; };
  if (!frame)
    throw InputError("magnetometer",
                     "the place is not georeferenced: give declination_deg, inclination_deg and strength_ut");
  return
      [frame = *frame, year = field.year](const Vec3& position) { return geomagnetic_field_ut(frame, position, year); };
}

}  // namespace tileflight::sensors
