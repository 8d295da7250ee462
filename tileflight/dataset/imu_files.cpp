#include "tileflight/dataset/imu_files.h"

#include <array>
#include <cmath>
#include <string>
#include <string_view>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/strict_section.h"
#include "tileflight/base/text_fields.h"

namespace tileflight::dataset {

namespace {

constexpr std::string_view kHeader =
    "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],a_RS_S_x [m s^-2],a_RS_S_y [m "
    "s^-2],a_RS_S_z [m s^-2]";
constexpr std::size_t kValues = 6;

ImuReading parse_reading(const std::string& where, const std::vector<std::string_view>& fields) {
  if (fields.size() != kValues + 1)
    throw InputError(where, "expected a time and 6 numbers, found " + std::to_string(fields.size()) + " fields");
  const auto time_ns = base::parse_number<std::int64_t>(fields[0]);
  if (!time_ns) throw InputError(where, "\"" + std::string(fields[0]) + "\" is not a time in whole nanoseconds");
  std::array<double, kValues> v{};
  for (std::size_t i = 0; i < kValues; ++i) {
    const auto value = base::parse_number<double>(fields[i + 1]);
    if (!value || !std::isfinite(*value))
      throw InputError(where, "\"" + std::string(fields[i + 1]) + "\" is not a finite number");
    v[i] = *value;
  }
  return {1e-9 * static_cast<double>(*time_ns), {v[0], v[1], v[2]}, {v[3], v[4], v[5]}};
}

double required(base::StrictSection& section, const std::string& key) {
  const std::optional<double> value = section.number(key);
  if (!value) throw section.error(key, "is missing");
  if (*value < 0.0) throw section.error(key, "must not be negative");
  return *value;
}

}  // namespace

std::vector<ImuReading> read_imu_csv(const std::filesystem::path& file) {
  const std::string text = base::read_text(file);
  std::string_view rest = text;
  std::vector<ImuReading> readings;
  for (int number = 1; const auto line = base::take_line(rest); ++number) {
    const std::vector<std::string_view> fields = base::split_fields(*line, ", \t");
    if (fields.empty() || fields.front().starts_with('#')) continue;
    const std::string where = file.string() + ": line " + std::to_string(number);
    readings.push_back(parse_reading(where, fields));
    if (readings.size() > 1 && !(readings.back().time_s > readings[readings.size() - 2].time_s))
      throw InputError(where, "the time is not after the one before it");
  }
  return readings;
}

void write_imu_csv(const std::filesystem::path& file, const std::vector<ImuReading>& readings) {
  std::string text = std::string(kHeader) + "\n";
  for (const ImuReading& reading : readings) {
    base::append_number(text, static_cast<std::int64_t>(std::llround(1e9 * reading.time_s)));
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

ImuCalibration read_imu_yaml(const std::filesystem::path& file) {
  base::StrictSection section = base::StrictSection::load(file);
  ImuCalibration calibration;
  calibration.update_rate_hz = required(section, "update_rate");
  calibration.accelerometer_noise_density = required(section, "accelerometer_noise_density");
  calibration.accelerometer_random_walk = required(section, "accelerometer_random_walk");
  calibration.gyroscope_noise_density = required(section, "gyroscope_noise_density");
  calibration.gyroscope_random_walk = required(section, "gyroscope_random_walk");
  return calibration;
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

}  // namespace tileflight::dataset
