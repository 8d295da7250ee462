#include <array>
#include <map>
#include <numbers>

#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/inertial_logs.h"

namespace tileflight::flight_logs {
namespace {

using geometry::Mat3;
using geometry::Vec3;

constexpr double kGravity_m_s2 = 9.80665;
constexpr std::string_view kBlackbox = "H Product:Blackbox";

bool is_gcsv(std::string_view head) {
  head = base::strip_byte_order_mark(head);
  return head.starts_with("GYROFLOW IMU LOG") || head.starts_with("CAMERA IMU LOG");
}

bool is_blackbox_csv(std::string_view head) {
  head = base::trim(base::strip_byte_order_mark(head));
  const std::string_view line = head.substr(0, head.find('\n'));
  const bool names_product =
      line.find("Product") != std::string_view::npos && line.find("Blackbox") != std::string_view::npos;
  return (names_product && !head.starts_with('H')) || line.find("loopIteration") != std::string_view::npos;
}

/// The rows of the matrix that an orientation such as "YxZ" stands for: the axis of the unit, negative in lower case,
/// that points along each of Gyroflow's axes: up, left, back (docs.gyroflow.xyz, "IMU orientation").
Mat3 orientation_matrix(std::string_view word, const std::string& where) {
  Mat3 matrix = Mat3::Zero();
  for (std::size_t row = 0; row < 3 && word.size() == 3; ++row) {
    const char axis = word[row];
    if (axis >= 'X' && axis <= 'Z') matrix(static_cast<int>(row), axis - 'X') = 1.0;
    if (axis >= 'x' && axis <= 'z') matrix(static_cast<int>(row), axis - 'x') = -1.0;
  }
  const bool is_orientation = (matrix * matrix.transpose()).isIdentity();
  if (!is_orientation)
    throw InputError(where, "its orientation '" + std::string(word.substr(0, 20)) +
                                "' does not name each of the axes x, y, z once, as YxZ does");
  if (matrix.determinant() < 0.0)
    throw InputError(where, "its orientation '" + std::string(word) +
                                "' mirrors the axes, which no mounting does: correct the line 'orientation'");
  return matrix;
}

/// Gyroflow's axes up, left, back in those of the camera: x right, y down, z forward.
Mat3 camera_from_gyroflow() {
  Mat3 matrix;
  matrix << 0, -1, 0, -1, 0, 0, 0, 0, -1;
  return matrix;
}

/// The lines before the table: a key, and the rest of the line as its value.
using Header = std::map<std::string, std::string, std::less<>>;

double scale_of(const Header& header, std::string_view key, const std::string& where) {
  const auto found = header.find(key);
  if (found == header.end()) throw InputError(where, "has no line '" + std::string(key) + "'");
  const auto scale = base::parse_finite_number(found->second);
  if (!scale || *scale == 0.0)
    throw InputError(where, std::string(key) + " '" + found->second.substr(0, 40) + "' is no scale");
  return *scale;
}

}  // namespace

std::vector<std::string_view> split_at_commas(std::string_view line) {
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t comma = line.find(',');
    std::string_view field = base::trim(line.substr(0, comma));
    if (field.size() >= 2 && field.front() == '"' && field.back() == '"') field = field.substr(1, field.size() - 2);
    fields.push_back(field);
    if (comma == std::string_view::npos) return fields;
    line.remove_prefix(comma + 1);
  }
}

bool is_inertial_log(std::string_view head) {
  return is_gcsv(head) || head.starts_with(kBlackbox) || is_blackbox_csv(head);
}

InertialLog read_inertial_log(const std::filesystem::path& file) {
  const std::string head = base::read_head(file);
  if (head.starts_with(kBlackbox)) return parse_blackbox(base::read_raw(file, base::kMaxLogBytes), file.string());
  const std::string text = base::read_text(file, base::kMaxLogBytes);
  return is_gcsv(head) ? parse_gcsv(text, file.string()) : parse_blackbox_csv(text, file.string());
}

InertialLog parse_gcsv(std::string_view text, const std::string& where) {
  constexpr std::array<std::string_view, 7> kColumns{"t", "gx", "gy", "gz", "ax", "ay", "az"};
  text = base::strip_byte_order_mark(text);
  Header header;
  int number = 0;
  bool is_in_table = false;
  double time_scale = 0.0, rate_scale = 0.0, force_scale = 0.0, last_s = 0.0;
  Mat3 axes = Mat3::Identity();
  InertialLog log;
  std::size_t out_of_order = 0;
  while (const auto line = base::take_line(text)) {
    ++number;
    const std::string place = where + ":" + std::to_string(number);
    const std::vector<std::string_view> fields = split_at_commas(*line);
    if (fields.size() == 1 && fields[0].empty()) continue;
    if (!is_in_table && fields[0] != "t" && fields[0] != "time") {
      const std::size_t comma = line->find(',');
      if (comma != std::string_view::npos)
        header.emplace(base::trim(line->substr(0, comma)), base::trim(line->substr(comma + 1)));
      continue;
    }
    if (!is_in_table) {
      is_in_table = true;
      if (fields.size() < kColumns.size())
        throw InputError(place, "has no accelerometer: an inertial unit's readings need ax, ay, az beside gx, gy, gz");
      for (std::size_t i = 1; i < kColumns.size(); ++i)
        if (fields[i] != kColumns[i])
          throw InputError(place,
                           "its columns are not t,gx,gy,gz,ax,ay,az but start " + std::string(line->substr(0, 60)));
      time_scale = scale_of(header, "tscale", where);
      rate_scale = scale_of(header, "gscale", where);
      force_scale = kGravity_m_s2 * scale_of(header, "ascale", where);
      if (const auto word = header.find("orientation"); word != header.end()) {
        axes = camera_from_gyroflow() * orientation_matrix(word->second, where);
        log.notes.push_back(where + ": by its orientation " + word->second +
                            " the readings are in the camera's axes, so T_cam_imu turns nothing");
      } else {
        log.notes.push_back(where + ": states no orientation: the readings are in the unit's own axes");
      }
      continue;
    }
    if (fields.size() < kColumns.size())
      throw InputError(place, "has " + std::to_string(fields.size()) + " fields instead of 7; is it cut off?");
    std::array<double, 7> values{};
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = base::require_finite(place, fields[i]);
    const geometry::ImuSample reading{values[0] * time_scale, axes * Vec3(values[1], values[2], values[3]) * rate_scale,
                                      axes * Vec3(values[4], values[5], values[6]) * force_scale};
    if (!log.readings.empty() && !(reading.time_s > last_s)) {
      ++out_of_order;
      continue;
    }
    last_s = reading.time_s;
    log.readings.push_back(reading);
  }
  if (!is_in_table) throw InputError(where, "has no table: the line t,gx,gy,gz,ax,ay,az is missing");
  if (log.readings.size() < 2) throw InputError(where, "holds fewer than two readings");
  if (out_of_order > 0)
    log.notes.push_back(where + ": " + std::to_string(out_of_order) +
                        " readings left out: their times do not increase");
  return log;
}

}  // namespace tileflight::flight_logs
