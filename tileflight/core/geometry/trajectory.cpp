#include "tileflight/core/geometry/trajectory.h"

#include <algorithm>
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

/// Parses one line of TUM text, eight numbers. `where`: file and line.
StampedPose parse_pose(std::string_view line, const std::string& where) {
  const auto fields = base::split_fields(line);
  if (fields.size() != 8) {
    throw InputError(where, "expected 8 numbers (timestamp tx ty tz qx qy qz qw), found " +
                                std::to_string(fields.size()) + " fields");
  }
  std::array<double, 8> v{};
  for (std::size_t i = 0; i < v.size(); ++i) {
    const auto value = base::parse_number<double>(fields[i]);
    if (!value || !std::isfinite(*value)) {
      throw InputError(where, "'" + std::string(fields[i]) + "' is not a finite number");
    }
    v[i] = *value;
  }
  const Eigen::Quaterniond rotation(v[7], v[4], v[5], v[6]);
  if (rotation.norm() < 1e-6) throw InputError(where, "the quaternion has length 0");
  return {v[0], SE3(rotation, Vec3(v[1], v[2], v[3]))};
}

/// The first pose that is not before that time.
auto pose_from(const std::vector<StampedPose>& poses, double time_s) {
  return std::lower_bound(poses.begin(), poses.end(), time_s,
                          [](const StampedPose& pose, double t) { return pose.time_s < t; });
}

/// Index of the pose nearest in time, the earlier one on ties. `trajectory` must not be empty.
std::size_t nearest_in_time(const Trajectory& trajectory, double time_s) {
  const auto& poses = trajectory.poses;
  const auto after = pose_from(poses, time_s);
  if (after == poses.begin()) return 0;
  const auto before = after - 1;
  if (after == poses.end() || time_s - before->time_s <= after->time_s - time_s) {
    return static_cast<std::size_t>(before - poses.begin());
  }
  return static_cast<std::size_t>(after - poses.begin());
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

Trajectory read_tum(const std::filesystem::path& file) {
  const std::string text = base::read_text(file);
  Trajectory trajectory;
  std::size_t line_number = 0;
  for (std::string_view rest = text; const auto line = base::take_line(rest);) {
    ++line_number;
    std::string_view content = *line;
    const std::string_view first = base::take_field(content);
    if (first.empty() || first.starts_with('#')) continue;
    const std::string where = file.string() + ", line " + std::to_string(line_number);
    const StampedPose pose = parse_pose(*line, where);
    if (!trajectory.empty() && pose.time_s <= trajectory.poses.back().time_s) {
      if (pose.time_s == trajectory.poses.back().time_s) continue;
      throw InputError(where, "the time is before the previous one: sort the file by time");
    }
    trajectory.poses.push_back(pose);
  }
  return trajectory;
}

void write_tum(const std::filesystem::path& file, const Trajectory& trajectory) {
  std::string text = "# timestamp tx ty tz qx qy qz qw\n";
  for (const StampedPose& pose : trajectory.poses) {
    const Vec3& t = pose.T_local_camera.translation;
    const Eigen::Quaterniond& q = pose.T_local_camera.rotation;
    base::append_number(text, pose.time_s);
    for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
      text += ' ';
      base::append_number(text, value);
    }
    text += '\n';
  }
  base::write_file(file, text);
}

double path_length_m(const Trajectory& trajectory) {
  double length_m = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    length_m +=
        (trajectory.poses[i].T_local_camera.translation - trajectory.poses[i - 1].T_local_camera.translation).norm();
  }
  return length_m;
}

std::optional<SE3> interpolate(const Trajectory& trajectory, double time_s) {
  const auto& poses = trajectory.poses;
  const auto after = pose_from(poses, time_s);
  if (after == poses.end()) return std::nullopt;
  if (after->time_s == time_s) return after->T_local_camera;
  if (after == poses.begin()) return std::nullopt;
  const auto before = after - 1;
  const double share = (time_s - before->time_s) / (after->time_s - before->time_s);
  const SE3& a = before->T_local_camera;
  const SE3& b = after->T_local_camera;
  return SE3(a.rotation.slerp(share, b.rotation), a.translation + share * (b.translation - a.translation));
}

std::vector<std::pair<std::size_t, std::size_t>> associate(const Trajectory& a, const Trajectory& b,
                                                           double max_difference_s) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  if (b.empty()) return pairs;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double time_s = a.poses[i].time_s;
    const std::size_t j = nearest_in_time(b, time_s);
    // Only mutual nearest neighbours, so that no index is used twice.
    const bool mutual = nearest_in_time(a, b.poses[j].time_s) == i;
    if (mutual && std::abs(b.poses[j].time_s - time_s) <= max_difference_s) pairs.emplace_back(i, j);
  }
  return pairs;
}

Trajectory transformed(const Sim3& T_target_source, const Trajectory& trajectory) {
  Trajectory result;
  result.poses.reserve(trajectory.size());
  for (const StampedPose& pose : trajectory.poses) {
    result.poses.push_back({pose.time_s, T_target_source * pose.T_local_camera});
  }
  return result;
}

}  // namespace tileflight::geometry
