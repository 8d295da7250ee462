#include "tileflight/core/geometry/trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
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

constexpr std::string_view kCommas = ", \t", kBlanks = " \t";

/// Calls `take` with each line that is neither empty nor a comment, and its place (file and line).
void for_each_row(const std::filesystem::path& file, std::string_view text,
                  const std::function<void(std::string_view line, const std::string& where)>& take) {
  std::size_t number = 0;
  for (std::string_view rest = text; const auto line = base::take_line(rest);) {
    ++number;
    std::string_view content = *line;
    const std::string_view first = base::take_field(content, kCommas);
    if (first.empty() || first.starts_with('#')) continue;
    take(*line, file.string() + ", line " + std::to_string(number));
  }
}

double finite_number(std::string_view field, const std::string& where) {
  const auto value = base::parse_number<double>(field);
  if (!value || !std::isfinite(*value)) throw InputError(where, "'" + std::string(field) + "' is not a finite number");
  return *value;
}

/// Tells where a file of poses has its numbers.
struct PoseColumns {
  /// Columns of the time, of x, y and z, and of the quaternion's x, y, z and w.
  std::array<std::size_t, 8> of;
  bool are_named = false;                       ///< by a header
  std::optional<std::size_t> nanoseconds = {};  ///< column of the time's nanoseconds beside whole seconds, as ROS has
  bool time_is_in_seconds = true;
  double time_unit_s = 1.0;  ///< if times are in seconds, or in a unit that the heading states
  bool time_unit_is_stated = false;
  std::string_view separators = kBlanks;  ///< of rows

  std::size_t count() const { return std::max(*std::ranges::max_element(of), nanoseconds.value_or(0)) + 1; }
};

constexpr PoseColumns kTumColumns{.of = {0, 1, 2, 3, 4, 5, 6, 7}};
constexpr PoseColumns kEurocColumns{.of = {0, 1, 2, 3, 5, 6, 7, 4}, .time_is_in_seconds = false, .separators = kCommas};

/// Returns what a column holds by its heading, as an index of PoseColumns::of: "#timestamp [ns]" the time,
/// "p_RS_R_x [m]" x, "q_RS_w []" the quaternion's w. nullopt for anything else.
std::optional<std::size_t> meaning_of(std::string_view heading) {
  while (!heading.empty() && std::string_view(" #%").find(heading.front()) != std::string_view::npos)
    heading.remove_prefix(1);
  std::string name = base::to_lower(heading.substr(0, heading.find_first_of(" [(")));
  // "field.pose.orientation.x", as ROS writes: the names of the last two parts.
  if (const std::size_t last = name.rfind('.'); last != std::string::npos && last > 0) {
    const std::size_t before = name.rfind('.', last - 1);
    name = name.substr(before == std::string::npos ? 0 : before + 1);
    name.erase(std::remove(name.begin(), name.end(), '.'), name.end());
  }
  const bool is_t_with_unit = name == "t_s" || name == "t_ms" || name == "t_us" || name == "t_ns";
  if (name == "t" || name == "ts" || name == "stamp" || name.starts_with("time") || is_t_with_unit) return 0;
  if (name.empty()) return std::nullopt;
  const std::size_t axis = std::string_view("xyzw").find(name.back());
  if (axis == std::string_view::npos) return std::nullopt;
  if (name.starts_with("q") || name.starts_with("rot") || name.starts_with("ori")) return 4 + axis;
  if (axis == 3) return std::nullopt;
  const bool is_position = name.size() == 1 || name.starts_with("p") || (name.size() == 2 && name.front() == 't') ||
                           name.starts_with("t_") || name.starts_with("trans");
  return is_position ? std::optional(1 + axis) : std::nullopt;
}

/// Returns "sec" or "nsec" for the parts of ROS's times ("header.stamp.sec", "stamp_nanosec", "secs"); else nothing.
std::string part_of_time(std::string_view heading) {
  while (!heading.empty() && std::string_view(" #%").find(heading.front()) != std::string_view::npos)
    heading.remove_prefix(1);
  const std::string name = base::to_lower(base::trim(heading));
  const std::string last = name.substr(name.find_last_of("._") + 1);  // npos + 1: the whole
  if (last == "sec" || last == "secs") return name == last || name.find("stamp") != std::string::npos ? "sec" : "";
  return last == "nsec" || last == "nsecs" || last == "nanosec" || last == "nanosecs" ? "nsec" : "";
}

/// Returns the columns that a heading line names; nullopt if it does not name each of the eight once.
std::optional<PoseColumns> columns_named_by(std::string_view line, const PoseColumns& usual) {
  while (line.starts_with(' ') || line.starts_with('#')) line.remove_prefix(1);
  const bool has_commas = line.find(',') != std::string_view::npos;
  std::vector<std::string> headings;
  for (const std::string_view field : base::split_fields(line, has_commas ? "," : kBlanks)) {
    const bool is_unit = !has_commas && !headings.empty() && (field.starts_with('[') || field.starts_with('('));
    if (is_unit) {
      headings.back() += field;
    } else {
      headings.emplace_back(field);
    }
  }
  PoseColumns columns = usual;
  columns.are_named = true;
  std::array<int, 8> found{};
  std::optional<std::size_t> seconds;
  for (std::size_t i = 0; i < headings.size(); ++i) {
    const std::string part = part_of_time(headings[i]);
    if (part == "sec") seconds = i;
    if (part == "nsec") columns.nanoseconds = i;
    if (!part.empty()) continue;
    const std::optional<std::size_t> meaning = meaning_of(headings[i]);
    if (!meaning) continue;
    columns.of[*meaning] = i;
    ++found[*meaning];
  }
  if (const auto whole = seconds ? seconds : columns.nanoseconds; whole && found[0] == 0) {
    columns.of[0] = *whole;
    ++found[0];
  }
  if (std::ranges::any_of(found, [](int times) { return times != 1; })) return std::nullopt;
  if (!seconds || columns.of[0] != *seconds) columns.nanoseconds.reset();
  if (columns.of[0] == seconds) {
    columns.time_unit_is_stated = columns.time_is_in_seconds = true;
    return columns;
  }
  const std::string time = base::to_lower(base::trim(headings[columns.of[0]]));
  const auto states = [&](const char* in_brackets, const char* ending) {
    return time.find(std::string("[") + in_brackets + "]") != std::string::npos ||
           time.find(std::string("(") + in_brackets + ")") != std::string::npos || time.ends_with(ending);
  };
  if (states("ns", "_ns") || states("nsec", "_nsec") || states("nanosec", "_nanosec")) {
    columns.time_unit_is_stated = true;
    columns.time_is_in_seconds = false;
    return columns;
  }
  const auto in_unit = [&](double unit_s, std::initializer_list<const char*> names) {
    for (const char* const name : names) {
      if (!states(name, (std::string("_") + name).c_str())) continue;
      columns.time_unit_is_stated = columns.time_is_in_seconds = true;
      columns.time_unit_s = unit_s;
    }
  };
  in_unit(1.0, {"s", "sec", "seconds"});
  in_unit(1e-3, {"ms", "msec", "milliseconds"});
  in_unit(1e-6, {"us", "usec", "microseconds", "\xC2\xB5s"});
  return columns;
}

/// Tells whether a line's first field is a word, as in a heading without '#'.
bool begins_with_word(std::string_view line) {
  const std::string_view first = base::take_field(line, kCommas);
  return !first.empty() && !base::parse_number<double>(first);
}

/// The columns of a file, and the line of words that names them, which is no row.
struct FileColumns {
  PoseColumns columns;
  std::string_view heading;
  bool is_heading_unknown = false;
};

/// Finds the columns of a file: those that the last heading before its numbers names, else `usual`.
FileColumns find_columns(std::string_view text, const PoseColumns& usual) {
  FileColumns found{usual, {}};
  while (const auto line = base::take_line(text)) {
    const std::string_view content = base::trim(*line);
    const bool is_comment = content.starts_with('#');
    if (content.empty()) continue;
    if (!is_comment && !begins_with_word(content)) break;
    const auto named = columns_named_by(content, usual);
    if (named) found.columns = *named;
    if (is_comment) continue;
    found.heading = *line;
    found.is_heading_unknown = !named;
    break;
  }
  return found;
}

double pose_time_s(std::string_view field, bool is_in_seconds, const std::string& where) {
  if (is_in_seconds) return finite_number(field, where);
  const auto time_ns = base::parse_number<std::int64_t>(field);
  if (!time_ns) throw InputError(where, "'" + std::string(field) + "' is not a time in whole nanoseconds");
  return to_seconds(*time_ns);
}

/// Parses a row of poses; nullopt where the file says that it has no pose at this time (seven times "nan").
std::optional<StampedPose> parse_pose(std::string_view line, const PoseColumns& columns, const std::string& where) {
  const std::vector<std::string_view> fields = base::split_fields(line, columns.separators);
  const bool is_tum = !columns.are_named && columns.time_is_in_seconds;
  if (fields.size() < columns.count() || (is_tum && fields.size() != columns.of.size())) {
    throw InputError(where,
                     (is_tum              ? "expected 8 numbers (timestamp tx ty tz qx qy qz qw)"
                      : columns.are_named ? "expected " + std::to_string(columns.count()) + " fields as in its heading"
                                          : "expected a time in nanoseconds and 7 numbers (x, y, z, qw, qx, qy, qz)") +
                         ", found " + std::to_string(fields.size()) + " fields");
  }
  const auto is_nan = [&](std::size_t column) { return base::to_lower(fields[column]) == "nan"; };
  if (std::all_of(columns.of.begin() + 1, columns.of.end(), is_nan)) return std::nullopt;
  double time_s = pose_time_s(fields[columns.of[0]], columns.time_is_in_seconds, where) * columns.time_unit_s;
  if (columns.nanoseconds) time_s += 1e-9 * finite_number(fields[*columns.nanoseconds], where);
  std::array<double, 8> v{};
  for (std::size_t i = 1; i < v.size(); ++i) v[i] = finite_number(fields[columns.of[i]], where);
  const Eigen::Quaterniond rotation(v[7], v[4], v[5], v[6]);
  // Files have three digits and more; other numbers in its place are no rotation.
  constexpr double kRounded = 0.02;
  if (rotation.norm() < 1e-6) throw InputError(where, "the quaternion has length 0");
  if (std::abs(rotation.norm() - 1.0) > kRounded) {
    throw InputError(where, "the quaternion (" + std::to_string(v[4]) + ", " + std::to_string(v[5]) + ", " +
                                std::to_string(v[6]) + ", " + std::to_string(v[7]) + ") has length " +
                                std::to_string(rotation.norm()) +
                                ", not 1: these columns hold something else, e.g. angles or covariances");
  }
  return StampedPose{time_s, SE3(rotation, Vec3(v[1], v[2], v[3]))};
}

/// Tells whether times are in seconds although EuRoC's columns are usual: the heading states no unit, and a time has
/// a point.
bool has_fractional_times(const std::filesystem::path& file, std::string_view text, const FileColumns& found) {
  if (!found.columns.are_named || found.columns.time_unit_is_stated) return false;
  bool has_point = false;
  for_each_row(file, text, [&](std::string_view line, const std::string&) {
    if (has_point || line.data() == found.heading.data()) return;
    const std::vector<std::string_view> fields = base::split_fields(line, found.columns.separators);
    const std::size_t time = found.columns.of[0];
    has_point = time < fields.size() && fields[time].find('.') != std::string_view::npos;
  });
  return has_point;
}

/// Reads the rows of a file of poses with times. `usual`: the columns of a file without a heading.
Trajectory read_poses(const std::filesystem::path& file, std::string_view text, const PoseColumns& usual) {
  FileColumns found = find_columns(text, usual);
  if (has_fractional_times(file, text, found)) found.columns.time_is_in_seconds = true;
  Trajectory trajectory;
  std::size_t rows = 0;
  for_each_row(file, text, [&](std::string_view line, const std::string& where) {
    if (line.data() == found.heading.data()) return;
    if (found.is_heading_unknown) {
      throw InputError(file.string(), "its heading '" + std::string(base::trim(found.heading).substr(0, 200)) +
                                          "' must name one column each for time, x, y, z, qx, qy, qz and qw");
    }
    const std::optional<StampedPose> pose = parse_pose(line, found.columns, where);
    if (!pose) return;
    ++rows;
    if (!trajectory.empty() && pose->time_s <= trajectory.poses.back().time_s) {
      if (pose->time_s == trajectory.poses.back().time_s) return;
      throw InputError(where, "the time is before the previous one: sort the file by time");
    }
    trajectory.poses.push_back(*pose);
  });
  constexpr double kUsualShare = 0.1;
  if (static_cast<double>(rows - trajectory.size()) > std::max(2.0, kUsualShare * static_cast<double>(rows))) {
    throw InputError(file.string(), std::to_string(rows - trajectory.size()) + " of " + std::to_string(rows) +
                                        " poses have the time of the one before: the times were written with too few "
                                        "digits; export them with more");
  }
  if (!trajectory.empty() && found.columns.time_is_in_seconds && !found.columns.time_unit_is_stated) {
    // ORB-SLAM3 writes TUM's columns with nanoseconds.
    const double unit_s = base::guess_time_unit(trajectory.poses.front().time_s).seconds;
    for (StampedPose& pose : trajectory.poses) pose.time_s *= unit_s;
  }
  return trajectory;
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

Trajectory read_kitti(const std::filesystem::path& file, std::string_view text) {
  Trajectory trajectory;
  for_each_row(file, text, [&](std::string_view line, const std::string& where) {
    trajectory.poses.push_back(parse_kitti_pose(line, trajectory.size(), where));
  });
  return trajectory;
}

/// Tells the format by the first row: by its heading, by commas, or by the number of its fields.
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
  if (find_columns(text, kTumColumns).columns.are_named) return TrajectoryFormat::kTum;
  const std::size_t fields = base::split_fields(row).size();
  if (fields == 12) return TrajectoryFormat::kKitti;
  if (fields == 8) return TrajectoryFormat::kTum;
  throw InputError(place,
                   "is a trajectory of no known format: expected TUM (8 numbers), KITTI (12 numbers) or EuRoC "
                   "(8 and more, with commas), found " +
                       std::to_string(fields) + " fields");
}

/// Tells whether the numbers of a row are separated by blanks and have decimal commas: "1,5 0,25 -3".
bool has_decimal_commas(std::string_view row) {
  if (row.find('.') != std::string_view::npos || row.find(',') == std::string_view::npos) return false;
  const std::vector<std::string_view> fields = base::split_fields(row);
  return fields.size() >= 8 && std::ranges::all_of(fields, [](std::string_view field) {
           return !field.ends_with(',') && base::parse_decimal_number(field).has_value();
         });
}

/// Returns the text with commas between the fields and points in the numbers, where its first row has semicolons
/// between them, and with points where it has decimal commas; else as it is.
std::string with_usual_separators(std::string text) {
  std::string_view row;
  for (std::string_view rest = text; const auto line = base::take_line(rest);) {
    const std::string_view first = line->substr(0, line->find(';'));
    if (line->starts_with('#') || base::trim(*line).empty() || begins_with_word(first)) continue;
    row = *line;
    break;
  }
  if (row.find(';') != std::string_view::npos) {
    std::ranges::replace(text, ',', '.');
    std::ranges::replace(text, ';', ',');
  } else if (has_decimal_commas(row)) {
    std::ranges::replace(text, ',', '.');
  }
  return text;
}

std::string read_trajectory_text(const std::filesystem::path& file) {
  return with_usual_separators(base::read_text(file));
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

Trajectory read_euroc_poses(const std::filesystem::path& file) {
  return read_poses(file, read_trajectory_text(file), kEurocColumns);
}

TrajectoryFile read_trajectory(const std::filesystem::path& file) {
  const std::string text = read_trajectory_text(file);
  const TrajectoryFormat format = format_of(file, text);
  Trajectory trajectory = format == TrajectoryFormat::kTum     ? read_poses(file, text, kTumColumns)
                          : format == TrajectoryFormat::kEuroc ? read_poses(file, text, kEurocColumns)
                                                               : read_kitti(file, text);
  if (trajectory.empty()) throw InputError(file.string(), "holds no poses");
  return {std::move(trajectory), format};
}

Trajectory read_tum(const std::filesystem::path& file) {
  return read_poses(file, read_trajectory_text(file), kTumColumns);
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
