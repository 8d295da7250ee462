#include "tileflight/core/geometry/trajectory_files.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/nanoseconds.h"

namespace tileflight::geometry {
namespace {

constexpr std::string_view kCsvSeparators = ", \t";

/// Calls `take` with each line that is neither empty nor a comment, and its place (file and line).
void for_each_row(const std::filesystem::path& file, const std::string& text,
                  const std::function<void(std::string_view line, const std::string& where)>& take) {
  std::size_t number = 0;
  for (std::string_view rest = text; const auto line = base::take_line(rest);) {
    ++number;
    std::string_view content = *line;
    const std::string_view first = base::take_field(content, kCsvSeparators);
    if (first.empty() || first.starts_with('#')) continue;
    take(*line, file.string() + ", line " + std::to_string(number));
  }
}

double finite_number(std::string_view field, const std::string& where) {
  const auto value = base::parse_number<double>(field);
  if (!value || !std::isfinite(*value)) throw InputError(where, "'" + std::string(field) + "' is not a finite number");
  return *value;
}

/// The columns of an EuRoC file, as its header names them.
struct EurocColumns {
  bool has_w_last = false;
  bool has_seconds = false;
};

/// A header's name without its unit: "q_RS_w" of " q_RS_w []".
std::string_view column_name(std::string_view column) {
  while (column.starts_with(' ') || column.starts_with('#')) column.remove_prefix(1);
  return column.substr(0, column.find_first_of(" [("));
}

EurocColumns read_header(std::string_view line) {
  const std::vector<std::string_view> columns = base::split_fields(line, ",");
  if (columns.size() < 8) return {};
  const std::string time = base::to_lower(columns[0]);
  EurocColumns result{.has_seconds = time.find("[s]") != std::string::npos || time.find("(s)") != std::string::npos};
  std::string order;  // the last letters of the quaternion's columns
  for (std::size_t i = 4; i < 8; ++i) {
    const std::string name = base::to_lower(column_name(columns[i]));
    if (name.starts_with('q')) order += name.back();
  }
  result.has_w_last = order == "xyzw";
  return result;
}

/// Whether the first line that is not empty is a header: a comment, or words.
bool is_header(std::string_view line) {
  std::string_view rest = line;
  const std::string_view first = base::take_field(rest, kCsvSeparators);
  return first.starts_with('#') || !base::parse_number<double>(first);
}

std::string_view first_line(std::string_view text) {
  while (const auto line = base::take_line(text)) {
    if (line->find_first_not_of(" \t") != std::string_view::npos) return *line;
  }
  return {};
}

double euroc_time_s(std::string_view field, bool has_seconds, const std::string& where) {
  if (has_seconds) return finite_number(field, where);
  const auto time_ns = base::parse_number<std::int64_t>(field);
  if (!time_ns) throw InputError(where, "'" + std::string(field) + "' is not a time in whole nanoseconds");
  return to_seconds(*time_ns);
}

StampedPose parse_euroc_pose(std::string_view line, const EurocColumns& columns, const std::string& where) {
  const std::vector<std::string_view> fields = base::split_fields(line, kCsvSeparators);
  if (fields.size() < 8) {
    throw InputError(where, "expected a time in nanoseconds and 7 numbers (x, y, z, qw, qx, qy, qz), found " +
                                std::to_string(fields.size()) + " fields");
  }
  std::array<double, 8> v{};
  for (std::size_t i = 1; i < v.size(); ++i) v[i] = finite_number(fields[i], where);
  const Eigen::Quaterniond rotation =
      columns.has_w_last ? Eigen::Quaterniond(v[7], v[4], v[5], v[6]) : Eigen::Quaterniond(v[4], v[5], v[6], v[7]);
  if (rotation.norm() < 1e-6) throw InputError(where, "the quaternion has length 0");
  return {euroc_time_s(fields[0], columns.has_seconds, where), SE3(rotation, Vec3(v[1], v[2], v[3]))};
}

StampedPose parse_kitti_pose(std::string_view line, std::size_t index, const std::string& where) {
  const std::vector<std::string_view> fields = base::split_fields(line);
  if (fields.size() != 12) {
    throw InputError(
        where, "expected 12 numbers (the upper 3x4 of a matrix), found " + std::to_string(fields.size()) + " fields");
  }
  Eigen::Matrix<double, 3, 4> T;
  for (int i = 0; i < 12; ++i) T(i / 4, i % 4) = finite_number(fields[static_cast<std::size_t>(i)], where);
  // Files have some six digits; a mirrored or scaled frame is far from that.
  constexpr double kRounded = 1e-3;
  const Mat3 R = T.leftCols<3>();
  if (!((R * R.transpose() - Mat3::Identity()).norm() < kRounded) || R.determinant() < 0.0)
    throw InputError(where, "the first three columns of the matrix are not a rotation");
  return {static_cast<double>(index), SE3(R, T.col(3))};
}

Trajectory read_kitti(const std::filesystem::path& file, const std::string& text) {
  Trajectory trajectory;
  for_each_row(file, text, [&](std::string_view line, const std::string& where) {
    trajectory.poses.push_back(parse_kitti_pose(line, trajectory.size(), where));
  });
  return trajectory;
}

Trajectory read_euroc(const std::filesystem::path& file, const std::string& text) {
  const std::string_view first = first_line(text);
  const bool has_header = is_header(first);
  const EurocColumns columns = has_header ? read_header(first) : EurocColumns{};
  bool is_first_row = has_header && !first.starts_with('#');  // a header of plain words is a row, too
  Trajectory trajectory;
  for_each_row(file, text, [&](std::string_view line, const std::string& where) {
    if (std::exchange(is_first_row, false)) return;
    const StampedPose pose = parse_euroc_pose(line, columns, where);
    if (!trajectory.empty() && pose.time_s <= trajectory.poses.back().time_s) {
      if (pose.time_s == trajectory.poses.back().time_s) return;
      throw InputError(where, "the time is before the previous one: sort the file by time");
    }
    trajectory.poses.push_back(pose);
  });
  return trajectory;
}

/// From the first line of numbers.
TrajectoryFormat format_of(const std::filesystem::path& file, const std::string& text) {
  std::string_view row;
  std::string place;
  for_each_row(file, text, [&](std::string_view line, const std::string& where) {
    if (!row.empty()) return;
    row = line;
    place = where;
  });
  if (row.empty()) throw InputError(file.string(), "holds no poses");
  if (row.find(',') != std::string_view::npos) return TrajectoryFormat::kEuroc;
  const std::size_t fields = base::split_fields(row).size();
  if (fields == 12) return TrajectoryFormat::kKitti;
  if (fields == 8) return TrajectoryFormat::kTum;
  throw InputError(place,
                   "is a trajectory of no known format: expected TUM (8 numbers), KITTI (12 numbers) or EuRoC "
                   "(8 and more, with commas), found " +
                       std::to_string(fields) + " fields");
}

}  // namespace

Trajectory read_euroc_poses(const std::filesystem::path& file) { return read_euroc(file, base::read_text(file)); }

TrajectoryFile read_trajectory(const std::filesystem::path& file) {
  const std::string text = base::read_text(file);
  const TrajectoryFormat format = format_of(file, text);
  Trajectory trajectory = format == TrajectoryFormat::kTum     ? read_tum(file)
                          : format == TrajectoryFormat::kEuroc ? read_euroc(file, text)
                                                               : read_kitti(file, text);
  if (trajectory.empty()) throw InputError(file.string(), "holds no poses");
  return {std::move(trajectory), format};
}

}  // namespace tileflight::geometry
