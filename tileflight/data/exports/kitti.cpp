// KITTI odometry (Geiger, Lenz, Urtasun, CVPR 2012), as read by kitti_layout.cpp.
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <optional>
#include <string>
#include <tuple>
#include <variant>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/dataset/lidar_files.h"
#include "tileflight/data/exports/export_dataset.h"
#include "tileflight/data/exports/layout_writers.h"

namespace tileflight::exports {

namespace {

namespace fs = std::filesystem;

using Matrix34 = Eigen::Matrix<double, 3, 4>;

std::string row_text(const Matrix34& matrix) {
  std::string text;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      if (!text.empty()) text += ' ';
      base::append_number(text, matrix(row, column));
    }
  }
  return text;
}

imaging::PinholeRadtan require_pinhole(const dataset::Dataset& dataset) {
  const auto* pinhole = std::get_if<imaging::PinholeRadtan>(&dataset.calibration.camera.model());
  if (pinhole == nullptr || pinhole->d != std::array<double, 4>{})
    throw InputError(dataset.folder.string(),
                     "KITTI's images are pinhole images without distortion; render the flight with such a camera");
  return *pinhole;
}

/// P = K [I | t] of a camera whose frame is `baseline_m` to the right of the first one's.
std::string projection_text(const imaging::PinholeRadtan& pinhole, double baseline_m) {
  Matrix34 projection = Matrix34::Zero();
  projection(0, 0) = pinhole.fx;
  projection(1, 1) = pinhole.fy;
  projection(0, 2) = pinhole.cx;
  projection(1, 2) = pinhole.cy;
  projection(2, 2) = 1.0;
  if (baseline_m != 0.0) projection(0, 3) = -pinhole.fx * baseline_m;
  return row_text(projection);
}

/// Four projection matrices: KITTI's grey and its colour pair are one here, or its only camera.
std::string calib_text(const imaging::PinholeRadtan& pinhole, double baseline_m) {
  const std::string left = projection_text(pinhole, 0.0), right = projection_text(pinhole, baseline_m);
  return "P0: " + left + "\nP1: " + right + "\nP2: " + left + "\nP3: " + right + "\n";
}

/// Returns the distance from the first camera to the second, which is to its right. Throws InputError unless the pair
/// is rectified: one lens, the same direction, side by side.
double rectified_baseline_m(const dataset::Rig& rig) {
  constexpr double kRounding = 1e-6;
  const dataset::Dataset &left = rig.cameras[0].dataset, &right = rig.cameras[1].dataset;
  const imaging::PinholeRadtan one = require_pinhole(left), other = require_pinhole(right);
  const geometry::SE3 T_left_right = rig.cameras[0].T_body_camera.inverse() * rig.cameras[1].T_body_camera;
  const geometry::Vec3& t = T_left_right.translation;
  const auto numbers = [](const imaging::PinholeRadtan& m) { return std::array{m.fx, m.fy, m.cx, m.cy}; };
  const bool is_rectified = numbers(one) == numbers(other) && t.x() > 0.0 && t.tail<2>().norm() <= kRounding * t.x() &&
                            T_left_right.rotation.angularDistance(Eigen::Quaterniond::Identity()) <= kRounding &&
                            left.calibration.camera.width() == right.calibration.camera.width() &&
                            left.calibration.camera.height() == right.calibration.camera.height();
  if (!is_rectified)
    throw InputError(left.folder.string(), "KITTI's pairs are rectified, but " + rig.cameras[1].name +
                                               " does not stand to the right of " + rig.cameras[0].name +
                                               " with the same lens and direction; export one camera (--camera " +
                                               rig.cameras[0].name + ") or another layout");
  return t.x();
}

/// The right camera's images. Throws InputError unless there is one of each of the left camera's instants.
void write_right_images(const dataset::Rig& rig, const fs::path& folder, const Progress& progress) {
  const dataset::Dataset& right = rig.cameras[1].dataset;
  const std::size_t left_count = rig.cameras[0].dataset.frames.size();
  if (stereo_pairs(rig).size() != left_count || right.frames.size() != left_count)
    throw InputError(right.folder.string(), "KITTI's pairs are of one instant, but its times are not those of " +
                                                rig.cameras[0].name + "; export one camera (--camera)");
  write_png_frames(right, folder / "image_1", dataset::frame_id, progress);
}

/// Camera poses in the first camera's frame.
std::string poses_text(const std::vector<geometry::SE3>& T_local_camera) {
  const geometry::SE3 T_first_local = T_local_camera.front().inverse();
  std::string text;
  for (const geometry::SE3& T : T_local_camera) text += row_text((T_first_local * T).matrix().topRows<3>()) + "\n";
  return text;
}

using geometry::SE3;

/// Contents of the dataset's folder lidar/.
struct Scans {
  geometry::Trajectory T_local_lidar;  ///< lidar pose at the start of each scan
  std::vector<fs::path> files;
  double period_s = 0.1;
  bool distorted = false;  ///< points are in the lidar's frame at their own time, not at the scan's start
};

std::optional<Scans> find_scans(const dataset::Dataset& dataset) {
  const fs::path folder = dataset.folder / "lidar";
  if (!fs::is_regular_file(folder / "poses.txt")) return std::nullopt;
  Scans scans;
  scans.T_local_lidar = geometry::read_tum(folder / "poses.txt");
  if (scans.T_local_lidar.empty()) return std::nullopt;
  for (std::size_t i = 0; i < scans.T_local_lidar.size(); ++i) {
    const fs::path ply = folder / (dataset::frame_id(i) + ".ply");
    scans.files.push_back(fs::exists(ply) ? ply : folder / (dataset::frame_id(i) + ".bin"));
  }
  const auto& poses = scans.T_local_lidar.poses;
  if (poses.size() > 1)
    scans.period_s = (poses.back().time_s - poses.front().time_s) / static_cast<double>(poses.size() - 1);
  const auto motion = dataset.metadata.find("sensors.lidar.motion");
  // Points without their own time (.bin) are assumed to be at the scan's start.
  scans.distorted =
      motion != dataset.metadata.end() && motion->second == "distorted" && scans.files.front().extension() == ".ply";
  return scans;
}

/// The camera's pose at any time, clamped to the first and last pose.
SE3 interpolate_camera(const geometry::Trajectory& truth, double time_s) {
  const double within_s = std::clamp(time_s, truth.poses.front().time_s, truth.poses.back().time_s);
  return *geometry::interpolate(truth, within_s);
}

/// Mounting of the lidar on the camera, from the true pose nearest to a scan's start (a simulated lidar starts with the
/// first frame).
SE3 estimate_mounting(const Scans& scans, const geometry::Trajectory& truth) {
  const geometry::StampedPose* best = nullptr;
  double best_s = INFINITY;
  for (const auto& [pose, scan] : geometry::associate(truth, scans.T_local_lidar, INFINITY)) {
    const geometry::StampedPose& start = scans.T_local_lidar.poses[scan];
    const double apart_s = std::abs(truth.poses[pose].time_s - start.time_s);
    if (apart_s < best_s) std::tie(best, best_s) = std::tuple(&start, apart_s);
  }
  return interpolate_camera(truth, best->time_s).inverse() * best->T_local_camera;
}

/// The scan whose middle is nearest to the time; nullopt if no scan is close enough. Of two that are equally near, the
/// later one: where scans begin with the frames, times lie just between two middles, and rounding would give some
/// frames the scan of the one before.
std::optional<std::size_t> find_scan(const Scans& scans, double time_s) {
  constexpr double kRounding_s = 1e-6;
  const auto apart_s = [&](const geometry::StampedPose& start) {
    return std::abs(start.time_s + 0.5 * scans.period_s - time_s);
  };
  const auto& starts = scans.T_local_lidar.poses;
  auto nearest = std::min_element(starts.begin(), starts.end(),
                                  [&](const auto& a, const auto& b) { return apart_s(a) < apart_s(b); });
  if (std::next(nearest) != starts.end() && apart_s(*std::next(nearest)) <= apart_s(*nearest) + kRounding_s) ++nearest;
  if (apart_s(*nearest) > 0.51 * scans.period_s) return std::nullopt;
  return static_cast<std::size_t>(nearest - starts.begin());
}

std::vector<dataset::ScanPoint> compensate_motion(const Scans& scans, std::size_t scan, const SE3& T_local_velo,
                                                  const geometry::Trajectory& truth, const SE3& T_cam_velo) {
  std::vector<dataset::ScanPoint> points = dataset::read_scan(scans.files[scan]);
  const geometry::StampedPose& start = scans.T_local_lidar.poses[scan];
  const SE3 T_velo_local = T_local_velo.inverse();
  const SE3 T_velo_start = T_velo_local * start.T_local_camera;
  for (dataset::ScanPoint& point : points) {
    const SE3 T_velo_lidar = scans.distorted
                                 ? T_velo_local * (interpolate_camera(truth, start.time_s + point.time_s) * T_cam_velo)
                                 : T_velo_start;
    point.position = (T_velo_lidar * point.position.cast<double>()).cast<float>();
  }
  return points;
}

/// Writes a lidar's scans in KITTI odometry's layout: folder/velodyne/000000.bin for each frame, with the points of the
/// scan whose middle is nearest in time, transformed to the lidar's pose at the frame's time (KITTI's scans are motion
/// compensated in the same way). A frame without a near scan has an empty file (with a note). Returns T_cam_velo, which
/// maps a scan's points into the frame's camera ("Tr" of calib.txt); nullopt, and no files, if the dataset has no scans
/// or no true poses (with a note). Throws InputError.
std::optional<SE3> write_velodyne(const dataset::Dataset& dataset, const fs::path& folder,
                                  std::vector<std::string>& notes) {
  const std::optional<Scans> scans = find_scans(dataset);
  if (!scans) return std::nullopt;
  if (!dataset.groundtruth || dataset.groundtruth->empty()) {
    notes.push_back("the lidar scans are left out: without groundtruth.txt they cannot be moved to the frame times");
    return std::nullopt;
  }
  std::error_code error;
  fs::create_directories(folder / "velodyne", error);
  if (error) throw InputError((folder / "velodyne").string(), "cannot be created: " + error.message());
  const geometry::Trajectory& truth = *dataset.groundtruth;
  const SE3 T_cam_velo = estimate_mounting(*scans, truth);
  const std::vector<SE3> T_local_camera = find_frame_poses(dataset);
  std::size_t empty = 0, repeated = 0;
  std::optional<std::size_t> before;
  for (std::size_t i = 0; i < dataset.frames.size(); ++i) {
    const std::optional<std::size_t> scan = find_scan(*scans, dataset.frames[i].time_s);
    empty += scan ? 0 : 1;
    repeated += scan && scan == before ? 1 : 0;
    before = scan;
    dataset::write_scan_bin(folder / "velodyne" / (dataset::frame_id(i) + ".bin"),
                            scan ? compensate_motion(*scans, *scan, T_local_camera[i] * T_cam_velo, truth, T_cam_velo)
                                 : std::vector<dataset::ScanPoint>());
  }
  if (empty > 0)
    notes.push_back(std::to_string(empty) + " of " + std::to_string(dataset.frames.size()) +
                    " frames have an empty scan: there are no lidar data at their times");
  if (repeated > 0)
    notes.push_back(std::to_string(repeated) + " of " + std::to_string(dataset.frames.size()) +
                    " frames have the scan of the frame before, moved by the true motion, from which a lidar odometry "
                    "profits: give the lidar the frames' rate");
  return T_cam_velo;
}

}  // namespace

void write_kitti(const dataset::Rig& rig, const fs::path& folder, std::vector<std::string>& notes,
                 const Progress& progress) {
  const dataset::Dataset& dataset = rig.cameras.front().dataset;
  const bool is_pair = rig.cameras.size() > 1;
  const imaging::PinholeRadtan pinhole = require_pinhole(dataset);
  std::string calib = calib_text(pinhole, is_pair ? rectified_baseline_m(rig) : 0.0);
  note_cameras_left_out(rig, 2, notes);
  if (const auto T_cam_velo = write_velodyne(dataset, folder, notes))
    calib += "Tr: " + row_text(T_cam_velo->matrix().topRows<3>()) + "\n";
  base::write_file(folder / "calib.txt", calib);
  std::string times;
  for (const dataset::Frame& frame : dataset.frames)
    times += base::fixed_text(frame.time_s - dataset.frames.front().time_s) + "\n";
  base::write_file(folder / "times.txt", times);
  if (dataset.groundtruth) base::write_file(folder / "poses.txt", poses_text(find_frame_poses(dataset)));
  if (dataset.frames.front().time_s != 0.0) notes.push_back("times start at 0 with the first frame, as KITTI's do");
  if (is_pair) write_right_images(rig, folder, progress);
  write_png_frames(dataset, folder / "image_0", dataset::frame_id, progress);
}

}  // namespace tileflight::exports
