#include "tileflight/survey/inertial_readings.h"

#include <nlohmann/json.hpp>

#include "tileflight/base/input_error.h"
#include "tileflight/base/text_fields.h"
#include "tileflight/dataset/imu_files.h"
#include "tileflight/geometry/angles.h"
#include "tileflight/inertial/imu_check.h"

namespace tileflight::survey {
namespace {

using nlohmann::json;

json axes_json(const geometry::Vec3& v) { return {v.x(), v.y(), v.z()}; }

inertial::ImuNoise read_noise(const dataset::Dataset& data, std::vector<std::string>& warnings) {
  if (data.imu_noise.empty()) {
    warnings.push_back("the inertial unit's noise is not stated (imu.yaml); that of an ADIS16448 is assumed");
    return {};
  }
  const dataset::ImuCalibration noise = dataset::read_imu_noise(data.imu_noise);
  return {.accelerometer_noise_density = noise.accelerometer_noise_density,
          .accelerometer_random_walk = noise.accelerometer_random_walk,
          .gyroscope_noise_density = noise.gyroscope_noise_density,
          .gyroscope_random_walk = noise.gyroscope_random_walk};
}

}  // namespace

OdometryMode parse_odometry_mode(const std::string& where, const std::string& word) {
  if (word == "mono") return OdometryMode::kMono;
  if (word == "inertial") return OdometryMode::kInertial;
  if (word == "stereo" || word == "stereo-inertial")
    throw InputError(where, "\"" + word + "\" does not exist yet: the odometry takes one camera; use mono or inertial");
  throw InputError(where, "\"" + word + "\" is no mode; use mono or inertial");
}

std::string to_string(OdometryMode mode) { return mode == OdometryMode::kMono ? "mono" : "inertial"; }

inertial::InertialInput read_inertial_input(const dataset::Dataset& data, double gravity_m_s2,
                                            std::vector<std::string>& warnings) {
  if (data.imu.empty())
    throw InputError(data.folder.string(),
                     "has no readings of an inertial unit (imu.csv), which --mode inertial needs; use --mode mono");
  inertial::InertialInput input;
  input.where = data.imu.string();
  for (const dataset::ImuReading& reading : dataset::read_imu_csv(data.imu))
    input.samples.push_back({reading.time_s, reading.angular_rate_rad_s, reading.specific_force_m_s2});
  input.model.noise = read_noise(data, warnings);
  input.model.T_imu_camera = data.calibration.T_cam_imu.inverse();
  input.model.gravity_m_s2 = gravity_m_s2;
  inertial::check_readings(input.samples, input.model.noise, input.where);
  return input;
}

json inertial_json(const inertial::InertialAlignment& a) {
  json result = {{"reason", a.reason}, {"covered_share", a.covered_share}};
  if (!a.metric) return result;
  result["scale"] = a.mean_scale;
  result["sigma_log_scale"] = a.sigma_log_scale;
  result["sigma_up_deg"] = a.sigma_up_rad / geometry::kRadiansPerDegree;
  result["time_offset_s"] = a.time_offset_s;
  result["sigma_time_offset_s"] = a.sigma_time_offset_s;
  result["mounting_correction_deg"] = a.mounting_correction_rad / geometry::kRadiansPerDegree;
  result["residual_ratio"] = a.residual_ratio;
  result["gyroscope_bias_rad_s"] = axes_json(a.bias.front().gyroscope_rad_s);
  result["accelerometer_bias_m_s2"] = axes_json(a.bias.front().accelerometer_m_s2);
  return result;
}

std::string inertial_csv(const inertial::InertialAlignment& a, const geometry::Trajectory& keyframes) {
  std::string table =
      "time_s,scale,vx,vy,vz,gyroscope_bias_x,gyroscope_bias_y,gyroscope_bias_z,accelerometer_bias_x,"
      "accelerometer_bias_y,accelerometer_bias_z\n";
  for (std::size_t k = 0; k < a.scale.size(); ++k) {
    base::append_number(table, keyframes.poses[k].time_s);
    table += ',';
    base::append_number(table, a.scale[k]);
    for (const geometry::Vec3& v : {a.velocity_m_s[k], a.bias[k].gyroscope_rad_s, a.bias[k].accelerometer_m_s2}) {
      for (int axis = 0; axis < 3; ++axis) {
        table += ',';
        base::append_number(table, v[axis]);
      }
    }
    table += '\n';
  }
  return table;
}

}  // namespace tileflight::survey
