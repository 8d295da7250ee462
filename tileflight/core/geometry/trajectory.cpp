#include "tileflight/core/geometry/trajectory.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::geometry {
namespace {

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
