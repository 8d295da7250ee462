// KITTI odometry (Geiger, Lenz, Urtasun, CVPR 2012): images rectified to one pinhole; calib.txt has the projection
// matrices P0..P3 as 12 numbers a line, of the left and right camera in grey (image_0, image_1) and of those in colour
// (image_2, image_3); poses.txt has camera-to-world 3x4 matrices, 12 numbers a frame.
#include <algorithm>
#include <array>
#include <cmath>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/dataset/layouts.h"

namespace tileflight::dataset::layouts {

namespace {

namespace fs = std::filesystem;
using Row12 = std::array<double, 12>;

fs::path image_folder(const fs::path& folder, const std::string& camera = "") {
  if (!camera.empty()) return folder / camera;
  for (const char* name : {"image_0", "image_l", "image_2"})
    if (fs::is_directory(folder / name)) return folder / name;
  return {};
}

/// Number of a camera in calib.txt by its folder.
std::size_t number_of(const std::string& camera) {
  if (camera == "image_1" || camera == "image_r") return 1;
  if (camera == "image_2") return 2;
  return camera == "image_3" ? 3 : 0;
}

/// A line of 12 numbers, with or without a label.
struct KittiRow {
  std::string label;  ///< "P0:"; empty: none
  Row12 numbers{};
};

std::vector<KittiRow> read_rows(const fs::path& file) {
  const std::string text = base::read_text(file);
  std::string_view rest = text;
  std::vector<KittiRow> rows;
  for (int number = 1; const auto line = base::take_line(rest); ++number) {
    std::vector<std::string_view> fields = base::split_fields(*line);
    KittiRow row;
    if (!fields.empty() && fields.front().ends_with(':')) {
      row.label = fields.front();
      fields.erase(fields.begin());
    }
    if (fields.empty()) continue;
    const std::string where = file.string() + ": line " + std::to_string(number);
    if (fields.size() != 12) throw InputError(where, "expected 12 numbers, found " + std::to_string(fields.size()));
    for (std::size_t i = 0; i < row.numbers.size(); ++i) row.numbers[i] = base::require_finite(where, fields[i]);
    rows.push_back(std::move(row));
  }
  if (rows.empty()) throw InputError(file.string(), "is empty");
  return rows;
}

/// The projection matrix of a camera, P0 to P3: by its label, or the line in this order.
Row12 read_projection(const fs::path& file, const std::string& camera) {
  const std::size_t number = number_of(camera);
  const std::string label = "P" + std::to_string(number);
  const std::vector<KittiRow> rows = read_rows(file);
  const auto labelled = std::ranges::find(rows, label + ":", &KittiRow::label);
  const bool has_label = labelled != rows.end();
  if (!has_label && (rows.size() <= number || !rows[number].label.empty()))
    throw InputError(file.string(), "has no " + label + ", for " + camera);
  const Row12& p = has_label ? labelled->numbers : rows[number].numbers;
  if (!(p[0] > 0.0 && p[5] > 0.0))
    throw InputError(file.string(), "the focal lengths of " + label + " must be above 0");
  return p;
}

imaging::Calibration read_calib(const fs::path& file, const std::string& camera, const fs::path& first_image) {
  const Row12 p0 = read_projection(file, camera);
  const imaging::GrayImage image = imaging::read_gray(first_image);  // calib.txt has no image size
  imaging::Calibration calibration;
  calibration.camera =
      imaging::Camera(imaging::PinholeRadtan{p0[0], p0[5], p0[2], p0[6], {}}, image.width, image.height);
  return calibration;
}

/// Returns the poses of the left camera.
geometry::Trajectory read_poses(const fs::path& file, const std::vector<Frame>& frames) {
  const std::vector<KittiRow> rows = read_rows(file);
  if (rows.size() != frames.size())
    throw InputError(file.string(),
                     "has " + std::to_string(rows.size()) + " poses for " + std::to_string(frames.size()) + " images");
  geometry::Trajectory trajectory;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> m(rows[i].numbers.data());
    trajectory.poses.push_back({frames[i].time_s, geometry::SE3(geometry::Mat3(m.leftCols<3>()), m.col(3))});
  }
  return trajectory;
}

}  // namespace

bool is_kitti(const fs::path& folder) { return !image_folder(folder).empty(); }

std::vector<std::string> kitti_cameras(const fs::path& folder) {
  const std::string first = image_folder(folder).filename().string();
  const std::string second = first == "image_0" ? "image_1" : first == "image_2" ? "image_3" : "image_r";
  return fs::is_directory(folder / second) ? std::vector{first, second} : std::vector<std::string>{};
}

/// P = K [I | t], where t maps the first camera's frame to this one's (Geiger et al., IJRR 2013, equation 5).
geometry::SE3 kitti_mount(const fs::path& folder, const std::string& camera) {
  const Row12 p = read_projection(folder / "calib.txt", camera);
  const geometry::Vec3 t((p[3] - p[2] * p[11]) / p[0], (p[7] - p[6] * p[11]) / p[5], p[11]);
  return {Eigen::Quaterniond::Identity(), -t};
}

Dataset read_kitti(const fs::path& folder, const CameraChoice& camera) {
  Dataset dataset;
  dataset.folder = folder;
  const fs::path image_path = image_folder(folder, camera.name);
  const std::string name = image_path.filename().string();
  const std::vector<fs::path> images = list_images(image_path);
  if (fs::is_regular_file(folder / "times.txt")) {
    dataset.frames = read_timed_frames(images, folder / "times.txt", dataset.warnings);
  } else {
    constexpr double kKittiPeriod_s = 0.1;
    dataset.frames = make_uniform_frames(images, kKittiPeriod_s);
    dataset.warnings.push_back(folder.string() + ": no times.txt; frames are assumed to be 0.1 s apart");
  }
  dataset.calibration = camera.calibration.empty() ? read_calib(folder / "calib.txt", name, images.front())
                                                   : read_chosen_camera(camera, dataset);
  if (fs::is_regular_file(folder / "poses.txt")) dataset.groundtruth = read_poses(folder / "poses.txt", dataset.frames);
  if (number_of(name) > 0 && dataset.groundtruth) {  // the poses are those of the first camera
    for (geometry::StampedPose& pose : dataset.groundtruth->poses)
      pose.T_local_camera = pose.T_local_camera * kitti_mount(folder, name);
  }
  return dataset;
}

}  // namespace tileflight::dataset::layouts
