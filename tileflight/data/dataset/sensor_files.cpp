#include "tileflight/data/dataset/sensor_files.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "tileflight/core/base/file_kind.h"
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

/// Where the numbers of a reading stand in a line.
struct ImuColumns {
  std::size_t time = 0;
  std::array<std::size_t, kValues> values{1, 2, 3, 4, 5, 6};  ///< angular rate x, y, z, then specific force x, y, z
  double rate_unit_rad_s = 1.0, force_unit_m_s2 = 1.0;
  std::size_t count = kValues + 1;  ///< columns of a line
  bool has_names = false;           ///< a header named them
  bool has_commas = false;          ///< the header has; then a field may be empty, as `rostopic echo -p` writes
  bool in_seconds = false;
};

/// A name of a header: "gyro_x [deg/s]" is {"gyrox", "deg/s"}.
struct ColumnName {
  std::string plain;  ///< lower case, letters and digits
  std::string unit;   ///< in brackets; empty: none is stated
};

ColumnName parse_column_name(std::string_view text) {
  const std::size_t bracket = std::min(text.find_first_of("[("), text.size());
  ColumnName name;
  for (const char c : base::to_lower(text.substr(0, bracket)))
    if (base::is_digit(c) || (c >= 'a' && c <= 'z')) name.plain += c;
  if (bracket < text.size()) {
    const std::string_view unit = text.substr(bracket + 1);
    name.unit = base::trim(unit.substr(0, unit.find_first_of("])")));
  }
  return name;
}

bool is_time_name(const std::string& plain) {
  constexpr std::array kNames{"t", "ts", "time", "timestamp", "timens", "timestampns", "times", "timestamps", "stamp"};
  return std::ranges::find(kNames, plain) != kNames.end();
}

/// The place in ImuColumns::values of a name such as "w_RS_S_x", "ax", "gyro_y" or "linear_acceleration.z".
std::optional<std::size_t> reading_of(const std::string& plain) {
  if (plain.size() < 2 || plain.back() < 'x' || plain.back() > 'z') return std::nullopt;
  const auto axis = static_cast<std::size_t>(plain.back() - 'x');
  const std::string_view stem = std::string_view(plain).substr(0, plain.size() - 1);
  const auto has = [stem](std::string_view part) { return stem.find(part) != std::string_view::npos; };
  if (has("user")) return std::nullopt;  // a phone's acceleration without gravity
  if (stem == "w" || stem == "wrss" || stem == "g" || has("gyr") || has("omega") || has("angular") ||
      has("rotationrate"))
    return axis;
  if (stem == "a" || stem == "arss" || has("acc") || has("specificforce")) return 3 + axis;
  return std::nullopt;
}

/// The factor of a unit to rad/s, or to m/s^2 for the accelerometer. An empty unit is 1.
double imu_unit(const std::string& where, const std::string& unit, bool is_force) {
  struct Unit {
    std::string_view name;
    double factor;
  };
  constexpr double kDegree = std::numbers::pi / 180.0, kGravity_m_s2 = 9.80665;
  constexpr std::array<Unit, 12> kRates{{{"", 1},
                                         {"rad s^-1", 1},
                                         {"rad/s", 1},
                                         {"rad/sec", 1},
                                         {"rad s-1", 1},
                                         {"rps", 1},
                                         {"deg s^-1", kDegree},
                                         {"deg/s", kDegree},
                                         {"deg/sec", kDegree},
                                         {"dps", kDegree},
                                         {"\xC2\xB0/s", kDegree},
                                         {"deg s-1", kDegree}}};
  constexpr std::array<Unit, 8> kForces{{{"", 1},
                                         {"m s^-2", 1},
                                         {"m/s^2", 1},
                                         {"m/s2", 1},
                                         {"m s-2", 1},
                                         {"m/s\xC2\xB2", 1},
                                         {"g", kGravity_m_s2},
                                         {"mg", 1e-3 * kGravity_m_s2}}};
  const std::span<const Unit> units = is_force ? std::span<const Unit>(kForces) : std::span<const Unit>(kRates);
  const std::string lower = base::to_lower(unit);
  const auto found = std::ranges::find(units, lower, &Unit::name);
  if (found != units.end()) return found->factor;
  throw InputError(where, "the unit \"" + unit + "\" of its header is unknown: use " +
                              (is_force ? "m/s^2, g or mg" : "rad/s or deg/s"));
}

/// The names of a first line; empty if it is a reading.
std::vector<std::string_view> names_of(std::string_view line) {
  if (line.starts_with('#')) line.remove_prefix(1);
  const bool has_commas = line.find(',') != std::string_view::npos;
  std::vector<std::string_view> names = base::split_fields(line, has_commas ? "," : ";\t ");
  for (std::string_view& name : names) name = base::trim(name);
  if (!names.empty() && base::parse_number<double>(names.front())) names.clear();
  return names;
}

std::string name_list(const std::vector<std::string_view>& names) {
  std::string text;
  for (const std::string_view name : names) text += (text.empty() ? "" : ", ") + std::string(name.substr(0, 60));
  return text;
}

/// Reads the header. A first line with '#' that names no reading is a comment: the columns are EuRoC's.
ImuColumns read_imu_header(const std::string& where, std::string_view line, std::vector<std::string>& notes) {
  const std::vector<std::string_view> names = names_of(line);
  std::array<std::optional<std::size_t>, kValues> found;
  std::optional<std::size_t> time;
  ImuColumns columns;
  std::vector<std::string_view> unused;
  bool states_units = true;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const ColumnName name = parse_column_name(names[i]);
    const std::optional<std::size_t> reading = reading_of(name.plain);
    if (!reading && is_time_name(name.plain) && !time) {
      time = i;
      columns.in_seconds = name.unit == "s" || name.unit == "sec";
      continue;
    }
    if (!reading) {
      unused.push_back(names[i]);
      continue;
    }
    if (found[*reading])
      throw InputError(where, "its header names the same reading twice: " + std::string(names[*found[*reading]]) +
                                  " and " + std::string(names[i]) + "; keep one column");
    found[*reading] = i;
    (*reading < 3 ? columns.rate_unit_rad_s : columns.force_unit_m_s2) = imu_unit(where, name.unit, *reading >= 3);
    states_units = states_units && !name.unit.empty();
  }
  const auto readings = std::ranges::count_if(found, [](const auto& column) { return column.has_value(); });
  if (readings == 0 && (names.empty() || line.starts_with('#'))) return {};
  if (readings != kValues || !time)
    throw InputError(
        where,
        "its header must name a time, three angular rates and three specific forces (t,gx,gy,gz,ax,ay,az), "
        "but it names " +
            name_list(names));
  columns.time = *time;
  for (std::size_t i = 0; i < kValues; ++i) columns.values[i] = *found[i];
  columns.count = names.size();
  columns.has_names = true;
  columns.has_commas = line.find(',') != std::string_view::npos;
  if (!states_units)
    notes.push_back(where + ": its header states no units; radians a second and metres a second squared are assumed");
  if (!unused.empty()) notes.push_back(where + ": columns that are not used: " + name_list(unused));
  return columns;
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
                                  const ImuColumns& columns) {
  if (fields.size() != columns.count)
    throw InputError(where, columns.has_names
                                ? "has " + std::to_string(fields.size()) + " fields, but the header names " +
                                      std::to_string(columns.count)
                                : "expected a time and 6 numbers, found " + std::to_string(fields.size()) + " fields");
  const double time_s = parse_time_s(where, fields[columns.time], columns.in_seconds);
  geometry::Vec3 rate, force;
  for (int i = 0; i < 3; ++i) {
    rate[i] =
        columns.rate_unit_rad_s * base::require_finite(where, fields[columns.values[static_cast<std::size_t>(i)]]);
    force[i] =
        columns.force_unit_m_s2 * base::require_finite(where, fields[columns.values[static_cast<std::size_t>(i) + 3]]);
  }
  return {time_s, rate, force};
}

/// The fields between commas, also those without text.
std::vector<std::string_view> comma_fields(std::string_view line) {
  std::vector<std::string_view> fields;
  for (std::size_t comma = line.find(','); comma != std::string_view::npos; comma = line.find(',')) {
    fields.push_back(base::trim(line.substr(0, comma)));
    line.remove_prefix(comma + 1);
  }
  fields.push_back(base::trim(line));
  return fields;
}

/// Without names, an accelerometer in the first columns is known by gravity.
void refuse_exchanged_columns(const std::string& where, const std::vector<geometry::ImuSample>& readings) {
  if (readings.empty()) return;
  double rate = 0.0, force = 0.0;
  for (const geometry::ImuSample& reading : readings) {
    rate += reading.angular_rate_rad_s.norm() / static_cast<double>(readings.size());
    force += reading.specific_force_m_s2.norm() / static_cast<double>(readings.size());
  }
  constexpr double kLeastGravity_m_s2 = 8.0, kMostGravity_m_s2 = 12.0, kMostRate_rad_s = 4.0;
  if (rate < kLeastGravity_m_s2 || rate > kMostGravity_m_s2 || force > kMostRate_rad_s) return;
  throw InputError(where,
                   "has no header, so its columns are read as time, gyroscope, accelerometer; but the first three "
                   "numbers have the length of gravity (" +
                       base::rounded_text(rate, 2) + " on average, the others " + base::rounded_text(force, 2) +
                       "): name the columns in a first line, as t,ax,ay,az,gx,gy,gz");
}

}  // namespace

std::vector<geometry::ImuSample> read_imu_csv(const std::filesystem::path& file, std::vector<std::string>& notes) {
  const std::string text = base::read_text(file);
  if (const auto refusal = base::refusal_of_kind(std::string_view(text).substr(0, base::kHeadBytes),
                                                 "a table of an inertial unit's readings"))
    throw InputError(file.string(), *refusal);
  std::string_view rest = text;
  const ImuColumns columns = read_imu_header(file.string(), base::take_line(rest).value_or(""), notes);
  std::vector<geometry::ImuSample> readings;
  rest = text;
  for (int number = 1; const auto line = base::take_line(rest); ++number) {
    const std::vector<std::string_view> all = base::split_fields(*line, ",; \t");
    if (all.empty() || all.front().starts_with('#') || (number == 1 && columns.has_names)) continue;
    const std::string where = file.string() + ": line " + std::to_string(number);
    const bool has_empty_fields = columns.has_commas && all.size() != columns.count;
    readings.push_back(parse_reading(where, has_empty_fields ? comma_fields(*line) : all, columns));
    if (readings.size() > 1 && !(readings.back().time_s > readings[readings.size() - 2].time_s))
      throw InputError(where, "the time is not after the one before it");
  }
  if (!columns.has_names) refuse_exchanged_columns(file.string(), readings);
  return readings;
}

std::vector<geometry::ImuSample> read_imu_csv(const std::filesystem::path& file) {
  std::vector<std::string> notes;
  return read_imu_csv(file, notes);
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

namespace {

/// The section with the noise: of VSLAM-LAB's first IMU, under "imu0" (Kalibr's results, OpenVINS), under basalt's
/// "value0", else the file itself.
YAML::Node noise_section(const YAML::Node& root) {
  if (!root.IsMap()) return root;
  if (const YAML::Node imus = root["imus"]; imus && imus.IsSequence() && imus.size() > 0) return imus[0];
  for (const char* name : {"imu0", "value0"})
    if (const YAML::Node section = root[name]; section && section.IsMap()) return section;
  return root;
}

/// A number, or the largest of basalt's three by axis.
double noise_number(const YAML::Node& node, const std::string& name, const std::string& file) {
  const std::vector<double> axes = node.IsSequence() ? imaging::yaml_numbers(node, name, file)
                                                     : std::vector{imaging::yaml_scalar<double>(node, name, file)};
  const bool valid =
      !axes.empty() && std::ranges::all_of(axes, [](double axis) { return std::isfinite(axis) && axis >= 0.0; });
  if (!valid) throw InputError(file, "\"" + name + "\" must be 0 or more");
  return std::ranges::max(axes);
}

}  // namespace

ImuCalibration read_imu_noise(const std::filesystem::path& file) {
  const YAML::Node root = imaging::load_calibration_yaml(file);
  const YAML::Node imu = noise_section(root);
  if (!imu.IsMap()) throw InputError(file.string(), "does not describe an inertial unit");
  if (imu["acc_n"] && !imu["accelerometer_noise_density"])
    throw InputError(
        file.string(),
        "has VINS's \"acc_n\", \"gyr_n\", which are deviations of single readings: divide them by the root of "
        "the readings a second, and name them accelerometer_noise_density, gyroscope_noise_density, "
        "accelerometer_random_walk, gyroscope_random_walk beside update_rate (Kalibr's imu.yaml)");
  const auto value = [&](std::initializer_list<const char*> names) {
    for (const char* name : names) {
      const YAML::Node node = imu[name];
      if (!node) continue;
      return noise_number(node, name, file.string());
    }
    throw InputError(file.string(), "has no \"" + std::string(*names.begin()) + "\" of the inertial unit");
  };
  // Names of Kalibr or EuRoC, of VSLAM-LAB, of VSLAM-LAB before 2025-12 (ORB-SLAM3's), and of basalt.
  return {
      .update_rate_hz = value({"update_rate", "rate_hz", "fps", "IMU.Frequency", "imu_update_rate"}),
      .accelerometer_noise_density =
          value({"accelerometer_noise_density", "sigma_a_c", "IMU.NoiseAcc", "accel_noise_std"}),
      .accelerometer_random_walk = value({"accelerometer_random_walk", "sigma_aw_c", "IMU.AccWalk", "accel_bias_std"}),
      .gyroscope_noise_density = value({"gyroscope_noise_density", "sigma_g_c", "IMU.NoiseGyro", "gyro_noise_std"}),
      .gyroscope_random_walk = value({"gyroscope_random_walk", "sigma_gw_c", "IMU.GyroWalk", "gyro_bias_std"})};
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
    if (row.line == 1 && !base::parse_number<double>(row.fields.front())) {
      if (row.fields != base::split_fields(kGpsHeader, ","))
        throw InputError(row.where, "its header must name the columns " + std::string(kGpsHeader));
      return;
    }
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
