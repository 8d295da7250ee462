// Scans in the layout of KITTI odometry's velodyne/ (Geiger, Lenz, Urtasun, CVPR 2012): x forward, y left, z up,
// metres.
#include "tileflight/data/dataset/velodyne_export.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/export_dataset.h"
#include "tileflight/data/dataset/exports.h"
#include "tileflight/data/dataset/lidar_files.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::dataset::exports {

namespace {

namespace fs = std::filesystem;
using geometry::SE3;

/// Contents of the dataset's folder lidar/.
struct Scans {
  geometry::Trajectory T_local_lidar;  ///< lidar pose at the start of each scan
  std::vector<fs::path> files;
  double period_s = 0.1;
  bool distorted = false;  ///< points are in the lidar's frame at their own time, not at the scan's start
};

std::optional<Scans> find_scans(const Dataset& dataset) {
  const fs::path folder = dataset.folder / "lidar";
  if (!fs::is_regular_file(folder / "poses.txt")) return std::nullopt;
  Scans scans;
  scans.T_local_lidar = geometry::read_tum(folder / "poses.txt");
  if (scans.T_local_lidar.empty()) return std::nullopt;
  for (std::size_t i = 0; i < scans.T_local_lidar.size(); ++i) {
    const fs::path ply = folder / (frame_stem(i) + ".ply");
    scans.files.push_back(fs::exists(ply) ? ply : folder / (frame_stem(i) + ".bin"));
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

std::vector<ScanPoint> compensate_motion(const Scans& scans, std::size_t scan, const SE3& T_local_velo,
                                         const geometry::Trajectory& truth, const SE3& T_cam_velo) {
  std::vector<ScanPoint> points = read_scan(scans.files[scan]);
  const geometry::StampedPose& start = scans.T_local_lidar.poses[scan];
  const SE3 T_velo_local = T_local_velo.inverse();
  const SE3 T_velo_start = T_velo_local * start.T_local_camera;
  for (ScanPoint& point : points) {
    const SE3 T_velo_lidar = scans.distorted
                                 ? T_velo_local * (interpolate_camera(truth, start.time_s + point.time_s) * T_cam_velo)
                                 : T_velo_start;
    point.position = (T_velo_lidar * point.position.cast<double>()).cast<float>();
  }
  return points;
}

}  // namespace

std::optional<SE3> write_velodyne(const Dataset& dataset, const fs::path& folder, std::vector<std::string>& notes) {
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
    write_scan_bin(folder / "velodyne" / (frame_stem(i) + ".bin"),
                   scan ? compensate_motion(*scans, *scan, T_local_camera[i] * T_cam_velo, truth, T_cam_velo)
                        : std::vector<ScanPoint>());
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

}  // namespace tileflight::dataset::exports
