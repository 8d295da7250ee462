// A sequence of VSLAM-LAB (https://github.com/VSLAM-LAB/VSLAM-LAB): rgb.csv "ts_rgb_0 (ns),path_rgb_0[,ts_depth_0
// (ns),path_depth_0][,ts_rgb_1 (ns),path_rgb_1]", calibration.yaml, groundtruth.csv "ts (ns),tx (m),ty (m),tz
// (m),qx,qy,qz,qw" of the body (as T_BS), imu_0.csv. From 2025-09 to 2025-12 the columns were ts_rgb0 (s), path_rgb0
// and ts, and the readings imu.csv.
#include <cmath>
#include <cstdint>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/nanoseconds.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/layouts.h"

namespace tileflight::dataset::layouts {

namespace {

namespace fs = std::filesystem;

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(" \t\"");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\"") - begin + 1);
}

/// The cells of a line, empty ones too.
std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  for (std::size_t comma = 0; comma != std::string_view::npos;) {
    comma = line.find(',');
    cells.push_back(trimmed(line.substr(0, comma)));
    if (comma != std::string_view::npos) line.remove_prefix(comma + 1);
  }
  return cells;
}

enum class TimeUnit { kNanoseconds, kSeconds, kNotSaid };

/// A table with a line of names, read row by row.
class CsvTable {
 public:
  explicit CsvTable(const fs::path& file) : file_(file.string()), text_(base::read_text(file)), rest_(text_) {
    if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
    const auto line = base::take_line(rest_);
    if (!line) throw InputError(file_, "is empty; expected a line of column names");
    for (const std::string_view cell : cells_of(*line)) names_.emplace_back(cell);
  }

  /// Column whose name, up to its unit, is one of these.
  std::optional<std::size_t> find(const std::vector<std::string>& names) const {
    for (std::size_t i = 0; i < names_.size(); ++i)
      for (const std::string& name : names)
        if (trimmed(std::string_view(names_[i]).substr(0, names_[i].find_first_of("(["))) == name) return i;
    return std::nullopt;
  }
  std::size_t require(const std::vector<std::string>& names) const {
    if (const auto column = find(names)) return *column;
    throw InputError(file_, "has no column \"" + names.front() + "\", only " + base::joined(names_));
  }
  TimeUnit unit_of(std::size_t column) const {
    const std::string& name = names_[column];
    if (name.find("(ns)") != std::string::npos || name.find("[ns]") != std::string::npos) return TimeUnit::kNanoseconds;
    const bool in_seconds = name.find("(s)") != std::string::npos || name.find("[s]") != std::string::npos;
    return in_seconds ? TimeUnit::kSeconds : TimeUnit::kNotSaid;
  }

  /// Takes the next row that is not empty; false at the end.
  bool next() {
    while (const auto line = base::take_line(rest_)) {
      ++number_;
      if (trimmed(*line).empty()) continue;
      cells_ = cells_of(*line);
      if (cells_.size() != names_.size())
        throw InputError(where(), "has " + std::to_string(cells_.size()) + " fields, but the first line names " +
                                      std::to_string(names_.size()));
      return true;
    }
    return false;
  }
  std::string_view cell(std::size_t column) const { return cells_[column]; }
  std::string where() const { return file_ + ": line " + std::to_string(number_); }
  double number(std::size_t column) const { return base::require_finite(where(), cell(column)); }
  /// Whole nanoseconds are kept exactly. A unit that the column's name does not state is seconds, unless the number
  /// would be a date after the year 5000.
  double time_s(std::size_t column) const {
    constexpr double kYear5000_s = 95'617'584'000.0;
    const TimeUnit unit = unit_of(column);
    const double value = number(column);
    if (unit == TimeUnit::kSeconds || (unit == TimeUnit::kNotSaid && std::abs(value) < kYear5000_s)) return value;
    if (const auto whole = base::parse_number<std::int64_t>(cell(column))) return geometry::to_seconds(*whole);
    return 1e-9 * value;
  }

 private:
  std::string file_;
  std::string text_;
  std::string_view rest_;
  std::vector<std::string> names_;
  std::vector<std::string_view> cells_;
  int number_ = 1;
};

const std::string kFirst = "rgb_0";

/// A column of a camera's: "ts_rgb_1" and, until 2025-12, "ts_rgb1".
std::vector<std::string> column_names(const std::string& what, const std::string& number) {
  return {what + "_" + number, what + number};
}

/// Images of one camera: "rgb_1". Rows may have none of it.
std::vector<Frame> listed_frames(const fs::path& folder, const std::string& camera,
                                 std::vector<std::string>& warnings) {
  const fs::path file = folder / "rgb.csv";
  CsvTable table(file);
  const std::string number = camera.substr(camera.find('_') + 1);
  const std::size_t time = table.require(column_names("ts_rgb", number));
  const std::size_t path = table.require(column_names("path_rgb", number));
  const auto depth = table.find(column_names("path_depth", number));
  std::vector<Frame> frames;
  while (table.next()) {
    if (camera != kFirst && table.cell(path).empty()) continue;
    Frame frame{.image = file_within(folder, table.cell(path), table.where()), .time_s = table.time_s(time)};
    frame.id = frame.image.stem().string();
    if (depth && !table.cell(*depth).empty()) {
      frame.depth = file_within(folder, table.cell(*depth), table.where());
      if (!fs::is_regular_file(frame.depth)) frame.depth.clear();
    }
    frames.push_back(std::move(frame));
  }
  return existing_frames(std::move(frames), file, warnings);
}

/// Poses of the camera, from those of the body.
std::optional<geometry::Trajectory> listed_poses(const fs::path& file, const geometry::SE3& T_body_cam) {
  if (!fs::is_regular_file(file)) return std::nullopt;
  CsvTable table(file);
  const std::size_t time = table.require({"ts", "timestamp"});
  const std::array<std::size_t, 7> columns{table.require({"tx"}), table.require({"ty"}), table.require({"tz"}),
                                           table.require({"qw"}), table.require({"qx"}), table.require({"qy"}),
                                           table.require({"qz"})};
  geometry::Trajectory trajectory;
  while (table.next()) {
    std::array<double, 7> v{};
    for (std::size_t i = 0; i < v.size(); ++i) v[i] = table.number(columns[i]);
    const Eigen::Quaterniond rotation(v[3], v[4], v[5], v[6]);
    if (rotation.norm() < 0.5) throw InputError(table.where(), "is not a position and a unit quaternion");
    const geometry::SE3 T_local_body(rotation, {v[0], v[1], v[2]});
    const double time_s = table.time_s(time);
    if (!trajectory.empty() && !(time_s > trajectory.poses.back().time_s))
      throw InputError(table.where(), "the time is not after the one before it");
    trajectory.poses.push_back({time_s, T_local_body * T_body_cam});
  }
  return trajectory;
}

}  // namespace

bool is_vslam_lab(const fs::path& folder) { return fs::is_regular_file(folder / "rgb.csv"); }

std::vector<std::string> vslam_lab_cameras(const fs::path& folder) {
  const CsvTable table(folder / "rgb.csv");
  std::vector<std::string> names;
  for (std::string number = "0"; table.find(column_names("path_rgb", number)); number = std::to_string(names.size()))
    names.push_back("rgb_" + number);
  return names.size() > 1 ? names : std::vector<std::string>{};
}

geometry::SE3 vslam_lab_mount(const fs::path& folder, const std::string& camera) {
  return imaging::read_vslam_lab_camera(folder / "calibration.yaml", camera).T_body_cam;
}

Dataset read_vslam_lab(const fs::path& folder, const CameraChoice& camera) {
  Dataset dataset;
  dataset.folder = folder;
  const std::string& name = camera.name.empty() ? kFirst : camera.name;
  dataset.frames = listed_frames(folder, name, dataset.warnings);
  const fs::path calibration_file = folder / "calibration.yaml";
  imaging::VslamLabCamera own;
  if (fs::is_regular_file(calibration_file)) {
    try {
      own = imaging::read_vslam_lab_camera(calibration_file, name);
      dataset.imu_noise = calibration_file;
    } catch (const InputError& error) {
      if (camera.calibration.empty()) throw;
      dataset.warnings.emplace_back(error.what());  // a chosen camera replaces a lens that is not known
    }
  } else if (camera.calibration.empty()) {
    throw InputError(folder.string(), "has no calibration.yaml; name a calibration (--camera)");
  }
  dataset.calibration = own.calibration;
  if (!camera.calibration.empty()) {
    dataset.calibration = read_chosen_camera(camera, dataset);
    if (dataset.calibration.T_cam_imu.matrix().isIdentity(0.0)) {
      dataset.calibration.T_cam_imu = own.calibration.T_cam_imu;
      dataset.calibration.assumes_T_cam_imu &= own.calibration.assumes_T_cam_imu;
    }
  }
  if (own.depth_units_per_m > 0.0) dataset.depth_units_per_m = own.depth_units_per_m;
  dataset.groundtruth = listed_poses(folder / "groundtruth.csv", own.T_body_cam);
  for (const char* name : {"imu_0.csv", "imu.csv"})
    if (dataset.imu.empty() && fs::is_regular_file(folder / name)) dataset.imu = folder / name;
  if (dataset.imu.empty()) dataset.imu_noise.clear();
  return dataset;
}

}  // namespace tileflight::dataset::layouts
