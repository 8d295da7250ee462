// KITTI odometry (Geiger, Lenz, Urtasun, CVPR 2012), as read by kitti_layout.cpp.
#include <array>
#include <variant>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/dataset/export_dataset.h"
#include "tileflight/data/dataset/exports.h"
#include "tileflight/data/dataset/velodyne_export.h"

namespace tileflight::dataset::exports {

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

imaging::PinholeRadtan require_pinhole(const Dataset& dataset) {
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

/// How far the second camera is to the right of the first. Throws InputError unless the pair is rectified: one lens,
/// the same direction, side by side.
double rectified_baseline_m(const Rig& rig) {
  constexpr double kRounding = 1e-6;
  const Dataset &left = rig.cameras[0].dataset, &right = rig.cameras[1].dataset;
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
void write_right_images(const Rig& rig, const fs::path& folder, const Progress& progress) {
  const Dataset& right = rig.cameras[1].dataset;
  const std::size_t left_count = rig.cameras[0].dataset.frames.size();
  if (stereo_pairs(rig).size() != left_count || right.frames.size() != left_count)
    throw InputError(right.folder.string(), "KITTI's pairs are of one instant, but its times are not those of " +
                                                rig.cameras[0].name + "; export one camera (--camera)");
  write_png_frames(right, folder / "image_1", frame_stem, progress);
}

/// Camera poses in the first camera's frame.
std::string poses_text(const std::vector<geometry::SE3>& T_local_camera) {
  const geometry::SE3 T_first_local = T_local_camera.front().inverse();
  std::string text;
  for (const geometry::SE3& T : T_local_camera) text += row_text((T_first_local * T).matrix().topRows<3>()) + "\n";
  return text;
}

}  // namespace

void write_kitti(const Rig& rig, const fs::path& folder, std::vector<std::string>& notes, const Progress& progress) {
  const Dataset& dataset = rig.cameras.front().dataset;
  const bool is_pair = rig.cameras.size() > 1;
  const imaging::PinholeRadtan pinhole = require_pinhole(dataset);
  std::string calib = calib_text(pinhole, is_pair ? rectified_baseline_m(rig) : 0.0);
  note_cameras_left_out(rig, 2, notes);
  if (const auto T_cam_velo = write_velodyne(dataset, folder, notes))
    calib += "Tr: " + row_text(T_cam_velo->matrix().topRows<3>()) + "\n";
  base::write_file(folder / "calib.txt", calib);
  std::string times;
  for (const Frame& frame : dataset.frames)
    times += base::fixed_text(frame.time_s - dataset.frames.front().time_s) + "\n";
  base::write_file(folder / "times.txt", times);
  if (dataset.groundtruth) base::write_file(folder / "poses.txt", poses_text(find_frame_poses(dataset)));
  if (dataset.frames.front().time_s != 0.0) notes.push_back("times start at 0 with the first frame, as KITTI's do");
  if (is_pair) write_right_images(rig, folder, progress);
  write_png_frames(dataset, folder / "image_0", frame_stem, progress);
}

}  // namespace tileflight::dataset::exports
