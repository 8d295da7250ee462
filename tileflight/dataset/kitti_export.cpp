// KITTI odometry (Geiger, Lenz, Urtasun, CVPR 2012), as read by kitti_layout.cpp.
#include <variant>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/number_text.h"
#include "tileflight/base/text_fields.h"
#include "tileflight/dataset/export_dataset.h"
#include "tileflight/dataset/exports.h"
#include "tileflight/dataset/velodyne_export.h"

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

/// Four identical projection matrices, since there is only one camera.
std::string calib_text(const imaging::PinholeRadtan& pinhole) {
  Matrix34 projection = Matrix34::Zero();
  projection(0, 0) = pinhole.fx;
  projection(1, 1) = pinhole.fy;
  projection(0, 2) = pinhole.cx;
  projection(1, 2) = pinhole.cy;
  projection(2, 2) = 1.0;
  std::string text;
  for (const char* name : {"P0: ", "P1: ", "P2: ", "P3: "}) text += name + row_text(projection) + "\n";
  return text;
}

/// Camera poses in the first camera's frame.
std::string poses_text(const std::vector<geometry::SE3>& T_local_camera) {
  const geometry::SE3 T_first_local = T_local_camera.front().inverse();
  std::string text;
  for (const geometry::SE3& T : T_local_camera) text += row_text((T_first_local * T).matrix().topRows<3>()) + "\n";
  return text;
}

}  // namespace

void write_kitti(const Dataset& dataset, const fs::path& folder, std::vector<std::string>& notes,
                 const Progress& progress) {
  std::string calib = calib_text(require_pinhole(dataset));
  if (const auto T_cam_velo = write_velodyne(dataset, folder, notes))
    calib += "Tr: " + row_text(T_cam_velo->matrix().topRows<3>()) + "\n";
  base::write_file(folder / "calib.txt", calib);
  std::string times;
  for (const Frame& frame : dataset.frames)
    times += base::fixed_text(frame.time_s - dataset.frames.front().time_s) + "\n";
  base::write_file(folder / "times.txt", times);
  if (dataset.groundtruth) base::write_file(folder / "poses.txt", poses_text(find_frame_poses(dataset)));
  if (dataset.frames.front().time_s != 0.0) notes.push_back("times start at 0 with the first frame, as KITTI's do");
  write_png_frames(dataset, folder / "image_0", frame_stem, progress);
}

}  // namespace tileflight::dataset::exports
