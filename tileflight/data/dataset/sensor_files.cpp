#include "tileflight/data/dataset/sensor_files.h"

#include <array>
#include <cassert>
#include <cmath>
#include <string>
#include <string_view>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/nanoseconds.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::dataset {

namespace {

std::vector<double> parse_row(const std::string& where, const std::vector<std::string_view>& fields,
                              std::size_t columns) {
  if (fields.size() != columns)
    throw InputError(where, "has " + std::to_string(fields.size()) + " numbers, but the header has " +
                                std::to_string(columns) + " columns");
  std::vector<double> row;
  for (const std::string_view field : fields) {
    const auto value = base::parse_number<double>(field);
    if (!value) throw InputError(where, "\"" + std::string(field) + "\" is not a number");
    row.push_back(*value);
  }
  return row;
}

}  // namespace

NumberTable read_number_table(const std::filesystem::path& file) {
  const std::string text = base::read_text(file);
  std::string_view rest = text;
  NumberTable table;
  for (int number = 1; const auto line = base::take_line(rest); ++number) {
    const std::vector<std::string_view> fields = base::split_fields(*line, ",");
    if (fields.empty()) continue;
    if (table.columns.empty())
      table.columns.assign(fields.begin(), fields.end());
    else
      table.rows.push_back(parse_row(file.string() + ": line " + std::to_string(number), fields, table.columns.size()));
  }
  if (table.columns.empty()) throw InputError(file.string(), "is empty; expected a header line of column names");
  return table;
}

void write_number_table(const std::filesystem::path& file, const NumberTable& table) {
  std::string text;
  for (const std::string& column : table.columns) text += (text.empty() ? "" : ",") + column;
  text += '\n';
  for (const std::vector<double>& row : table.rows) {
    assert(row.size() == table.columns.size());
    for (std::size_t i = 0; i < row.size(); ++i) text += (i == 0 ? "" : ",") + base::fixed_text(row[i]);
    text += '\n';
  }
  base::write_file(file, text);
}

namespace {

const std::vector<std::string> kColumns = {"t", "qx", "qy", "qz", "qw", "tilt_sigma_deg", "yaw_sigma_deg"};

CameraAttitude parse_attitude(const std::vector<double>& row, const std::string& where) {
  for (const double value : row)
    if (!std::isfinite(value)) throw InputError(where, "a number is not finite");
  const Eigen::Quaterniond q(row[4], row[1], row[2], row[3]);
  constexpr double kUnit = 0.01;
  if (!(std::abs(q.norm() - 1.0) < kUnit)) throw InputError(where, "the quaternion does not have length 1");
  if (!(row[5] > 0.0 && row[6] > 0.0)) throw InputError(where, "a standard deviation must be above zero");
  return {row[0], q.normalized(), row[5], row[6]};
}

}  // namespace

std::vector<CameraAttitude> read_attitude_csv(const std::filesystem::path& file) {
  const NumberTable table = read_number_table(file);
  if (table.columns != kColumns)
    throw InputError(file.string(), "expected the columns t,qx,qy,qz,qw,tilt_sigma_deg,yaw_sigma_deg");
  std::vector<CameraAttitude> attitudes;
  for (std::size_t i = 0; i < table.rows.size(); ++i) {
    const std::string where = file.string() + ": row " + std::to_string(i + 1);
    attitudes.push_back(parse_attitude(table.rows[i], where));
    if (i > 0 && !(attitudes[i].time_s > attitudes[i - 1].time_s))
      throw InputError(where, "the time is not after the one before it");
  }
  return attitudes;
}

void write_attitude_csv(const std::filesystem::path& file, const std::vector<CameraAttitude>& attitudes) {
  NumberTable table{kColumns, {}};
  for (const CameraAttitude& a : attitudes) {
    const Eigen::Quaterniond& q = a.R_enu_camera;
    table.rows.push_back({a.time_s, q.x(), q.y(), q.z(), q.w(), a.tilt_sigma_deg, a.yaw_sigma_deg});
  }
  write_number_table(file, table);
}

namespace {

constexpr std::string_view kHeader =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m "
    "s^-2],a_RS_S_z [m s^-2]";
constexpr std::size_t kValues = 6;

/// Whether a first line holds names.
bool is_imu_header(std::string_view line) { return line.starts_with("ts") || line.starts_with("timestamp"); }

bool is_in_seconds(std::string_view header) {
  const std::string_view time = header.substr(0, header.find(','));
  return time.find("(s)") != std::string_view::npos || time.find("[s]") != std::string_view::npos;
}

double parse_time_s(const std::string& where, std::string_view field, bool in_seconds) {
  if (in_seconds) {
    const auto time_s = base::parse_number<double>(field);
    if (time_s && std::isfinite(*time_s)) return *time_s;
    throw InputError(where, "\"" + std::string(field) + "\" is not a time in seconds");
  }
  const auto time_ns = base::parse_number<std::int64_t>(field);
  if (!time_ns) throw InputError(where, "\"" + std::string(field) + "\" is not a time in whole nanoseconds");
  return geometry::to_seconds(*time_ns);
}

geometry::ImuSample parse_reading(const std::string& where, const std::vector<std::string_view>& fields,
                                  bool in_seconds) {
  if (fields.size() != kValues + 1)
    throw InputError(where, "expected a time and 6 numbers, found " + std::to_string(fields.size()) + " fields");
  const double time_s = parse_time_s(where, fields[0], in_seconds);
  std::array<double, kValues> v{};
  for (std::size_t i = 0; i < kValues; ++i) v[i] = base::require_finite(where, fields[i + 1]);
  return {time_s, {v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
}

}  // namespace

std::vector<geometry::ImuSample> read_imu_csv(const std::filesystem::path& file) {
  const std::string text = base::read_text(file);
  std::string_view rest = text;
  const std::string_view first = base::take_line(rest).value_or("");
  const bool has_header = is_imu_header(first), in_seconds = has_header && is_in_seconds(first);
  std::vector<geometry::ImuSample> readings;
  base::for_each_row(text, file.string(), ", \t", [&](const base::TextRow& row) {
    if (row.line == 1 && has_header) return;
    readings.push_back(parse_reading(row.where, row.fields, in_seconds));
    if (readings.size() > 1 && !(readings.back().time_s > readings[readings.size() - 2].time_s))
      throw InputError(row.where, "the time is not after the one before it");
  });
  return readings;
}

void write_imu_csv(const std::filesystem::path& file, const std::vector<geometry::ImuSample>& readings) {
  std::string text = std::string(kHeader) + "\n";
  for (const geometry::ImuSample& reading : readings) {
    base::append_number(text, geometry::to_nanoseconds(reading.time_s));
    for (const geometry::Vec3& vector : {reading.angular_rate_rad_s, reading.specific_force_m_s2}) {
      for (int axis = 0; axis < 3; ++axis) {
        text += ',';
        base::append_number(text, vector[axis]);
      }
    }
    text += '\n';
  }
  base::write_file(file, text);
}

ImuCalibration read_imu_noise(const std::filesystem::path& file) {
  const YAML::Node root = imaging::load_calibration_yaml(file);
  const YAML::Node imus = root.IsMap() ? root["imus"] : YAML::Node();
  const YAML::Node imu = imus && imus.IsSequence() && imus.size() > 0 ? imus[0] : root;
  if (!imu.IsMap()) throw InputError(file.string(), "does not describe an inertial unit");
  const auto value = [&](std::initializer_list<const char*> names) {
    for (const char* name : names) {
      const YAML::Node node = imu[name];
      if (!node) continue;
      const auto number = imaging::yaml_scalar<double>(node, name, file.string());
      if (!std::isfinite(number) || number < 0.0)
        throw InputError(file.string(), "\"" + std::string(name) + "\" must be 0 or more");
      return number;
    }
    throw InputError(file.string(), "has no \"" + std::string(*names.begin()) + "\" of the inertial unit");
  };
  // Names of Kalibr or EuRoC, of VSLAM-LAB, and of VSLAM-LAB before 2025-12 (ORB-SLAM3's).
  return {.update_rate_hz = value({"update_rate", "rate_hz", "fps", "IMU.Frequency"}),
          .accelerometer_noise_density = value({"accelerometer_noise_density", "sigma_a_c", "IMU.NoiseAcc"}),
          .accelerometer_random_walk = value({"accelerometer_random_walk", "sigma_aw_c", "IMU.AccWalk"}),
          .gyroscope_noise_density = value({"gyroscope_noise_density", "sigma_g_c", "IMU.NoiseGyro"}),
          .gyroscope_random_walk = value({"gyroscope_random_walk", "sigma_gw_c", "IMU.GyroWalk"})};
}

void write_imu_yaml(const std::filesystem::path& file, const ImuCalibration& calibration) {
  std::string text = "rostopic: /imu0\n";
  const auto line = [&text](const std::string& key, double value) {
    text += key + ": ";
    base::append_number(text, value);
    text += '\n';
  };
  line("update_rate", calibration.update_rate_hz);
  line("accelerometer_noise_density", calibration.accelerometer_noise_density);
  line("accelerometer_random_walk", calibration.accelerometer_random_walk);
  line("gyroscope_noise_density", calibration.gyroscope_noise_density);
  line("gyroscope_random_walk", calibration.gyroscope_random_walk);
  base::write_file(file, text);
}

namespace {

constexpr std::string_view kGpsHeader = "t,lat,lon,height,horizontal_sigma,vertical_sigma";
constexpr std::size_t kGpsColumns = 6;

GpsFix parse_fix(const std::string& where, const std::vector<std::string_view>& fields) {
  if (fields.size() != kGpsColumns)
    throw InputError(where,
                     "expected 6 numbers (" + std::string(kGpsHeader) + "), found " + std::to_string(fields.size()));
  std::array<double, kGpsColumns> v{};
  for (std::size_t i = 0; i < kGpsColumns; ++i) v[i] = base::require_finite(where, fields[i]);
  if (std::abs(v[1]) > 90.0 || std::abs(v[2]) > 360.0) throw InputError(where, "latitude or longitude is out of range");
  if (v[4] < 0.0 || v[5] < 0.0) throw InputError(where, "a standard deviation is negative");
  return {v[0], {v[1], v[2], {v[3]}}, v[4], v[5]};
}

}  // namespace

std::vector<GpsFix> read_gps_csv(const std::filesystem::path& file) {
  std::vector<GpsFix> fixes;
  base::for_each_row(base::read_text(file), file.string(), ", \t", [&](const base::TextRow& row) {
    if (row.line == 1 && !base::parse_number<double>(row.fields.front())) return;  // the header
    fixes.push_back(parse_fix(row.where, row.fields));
    if (fixes.size() > 1 && !(fixes.back().time_s > fixes[fixes.size() - 2].time_s))
      throw InputError(row.where, "the time is not after the one before it");
  });
  return fixes;
}

void write_gps_csv(const std::filesystem::path& file, const std::vector<GpsFix>& fixes) {
  std::string text = std::string(kGpsHeader) + "\n";
  for (const GpsFix& fix : fixes) {
    text += base::fixed_text(fix.time_s) + "," + base::fixed_text(fix.position.latitude_deg) + "," +
            base::fixed_text(fix.position.longitude_deg) + "," + base::fixed_text(fix.position.height.m) + "," +
            base::fixed_text(fix.horizontal_sigma_m) + "," + base::fixed_text(fix.vertical_sigma_m) + "\n";
  }
  base::write_file(file, text);
}

}  // namespace tileflight::dataset
