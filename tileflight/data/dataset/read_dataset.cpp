#include <algorithm>
#include <filesystem>
#include <utility>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/lens_profile.h"
#include "tileflight/data/dataset/dataset_metadata.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/dataset/layouts.h"
#include "tileflight/data/dataset/rig.h"

namespace tileflight::dataset {

namespace {

namespace fs = std::filesystem;

void check_image_size(const Dataset& dataset) {
  const imaging::GrayImage image = imaging::read_gray(dataset.frames.front().image);
  const imaging::Camera& camera = dataset.calibration.camera;
  if (image.width == camera.width() && image.height == camera.height()) return;
  throw InputError(dataset.folder.string(), "the calibration is for images of " +
                                                size_text(camera.width(), camera.height()) + ", but " +
                                                dataset.frames.front().image.filename().string() + " has " +
                                                size_text(image.width, image.height));
}

/// The first of the names that is a file in the folder; empty if none is.
fs::path first_file(const fs::path& folder, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (fs::is_regular_file(folder / name)) return folder / name;
  return {};
}

imaging::Calibration read_camera(const fs::path& folder) {
  const fs::path file = first_file(folder, {"camera.yaml", "camera.txt"});
  if (!file.empty()) return imaging::read_calibration(file);
  throw InputError(
      folder.string(),
      "has no camera calibration: add camera.yaml (Kalibr) or camera.txt (DSO), or name a file (--camera)");
}

/// The folder of the chosen camera of a rig; `camera` is then left with what remains to be chosen.
fs::path choose_camera(const fs::path& folder, CameraChoice& camera) {
  if (camera.name.empty() && (camera.calibration.empty() || fs::exists(camera.calibration))) return folder;
  const std::vector<std::string> names = rig_camera_names(folder);
  if (camera.name.empty()) {
    if (std::ranges::find(names, camera.calibration.string()) == names.end()) {
      if (names.empty() || camera.calibration.has_extension() || camera.calibration.has_parent_path()) return folder;
      throw InputError(folder.string(), "has no camera " + camera.calibration.string() + ", only " +
                                            base::joined(names) + "; and there is no such calibration file");
    }
    camera.name = camera.calibration.string();
    camera.calibration.clear();
  }
  if (std::ranges::find(names, camera.name) == names.end())
    throw InputError(folder.string(), "has no camera " + camera.name + ", only " + base::joined(names));
  if (!fs::is_directory(folder / "images")) return folder;
  const bool is_first = camera.name == names.front();
  const std::string name = std::exchange(camera.name, "");
  return is_first ? folder : folder / "cameras" / name;
}

/// Returns the folder with the body's sensors: for a camera's folder within a rig the rig's, else the folder itself.
fs::path folder_of_body(const fs::path& folder) {
  const fs::path rig = fs::absolute(folder / ".").lexically_normal().parent_path().parent_path().parent_path();
  const bool is_part =
      fs::absolute(folder / ".").lexically_normal().parent_path().parent_path().filename() == "cameras";
  return is_part && fs::is_regular_file(rig / "camchain.yaml") ? rig : folder;
}

}  // namespace

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

ScaledCalibration read_scaled_calibration(const std::filesystem::path& file, const std::string& camera_id, int width,
                                          int height, std::vector<std::string>& notes) {
  if (camera_id.empty()) {
    if (const auto profile = imaging::read_if_lens_profile(file)) {
      const imaging::Camera& own = profile->camera;
      const bool is_own_size = own.width() == width && own.height() == height;
      const imaging::Calibration calibration = imaging::calibration_for_size(*profile, width, height);
      notes.insert(notes.end(), calibration.notes.begin(), calibration.notes.end());
      return {calibration, is_own_size ? "" : size_text(own.width(), own.height())};
    }
  }
  return scaled_calibration(file.string(), imaging::read_calibration(file, camera_id), width, height, notes);
}

ScaledCalibration scaled_calibration(const std::string& name, imaging::Calibration calibration, int width, int height,
                                     std::vector<std::string>& notes) {
  const imaging::Camera camera = calibration.camera;
  notes.insert(notes.end(), calibration.notes.begin(), calibration.notes.end());
  if (camera.width() == width && camera.height() == height) return {calibration, {}};
  const std::string own_size = size_text(camera.width(), camera.height());
  const std::string sizes = "is for images of " + own_size + ", the frames have " + size_text(width, height);
  try {
    // The readout time of the whole image stays the same.
    calibration.line_delay_s *= static_cast<double>(camera.height()) / height;
    calibration.camera = camera.scaled_to(width, height);
  } catch (const InputError&) {
    const bool is_turned = camera.width() == height && camera.height() == width;
    throw InputError(name,
                     sizes + ": the aspect ratio differs, so calibrate at the video's size" +
                         (is_turned ? ", or correct the calibration, if its width and height are exchanged" : ""));
  }
  notes.push_back(name + ": " + sizes + "; the calibration is scaled to them");
  return {calibration, own_size};
}

std::string unstated_mount_text(const std::string& where) {
  return where +
         ": no calibration states where the camera is on the inertial unit; T_cam_imu is assumed to be the identity "
         "(the "
         "unit's x right, y down, z forward in the image, at the camera): add T_cam_imu to the camera's section";
}

namespace layouts {

imaging::Calibration read_chosen_camera(const CameraChoice& camera, Dataset& dataset) {
  const imaging::GrayImage image = imaging::read_gray(dataset.frames.front().image);
  return read_scaled_calibration(camera.calibration, camera.camera_id, image.width, image.height, dataset.warnings)
      .calibration;
}

std::vector<Frame> existing_frames(std::vector<Frame> named, const fs::path& file, std::vector<std::string>& warnings) {
  const std::size_t count = named.size();
  std::erase_if(named, [](const Frame& frame) { return !fs::is_regular_file(frame.image); });
  if (named.empty()) throw InputError(file.string(), "none of its frames has an image");
  if (named.size() < count)
    warnings.push_back(file.string() + ": " + std::to_string(count - named.size()) + " of " + std::to_string(count) +
                       " frames have no image and are skipped");
  require_increasing_times(named, file);
  return named;
}

fs::path file_within(const fs::path& folder, std::string_view name, const std::string& where) {
  const fs::path inside = fs::path(name).lexically_normal();
  if (inside.empty() || inside.is_absolute() || *inside.begin() == "..")
    throw InputError(where, "\"" + std::string(name) + "\" is not a file within the dataset's folder");
  return folder / inside;
}

Dataset read_images_folder(const fs::path& folder, const CameraChoice& camera) {
  Dataset dataset;
  dataset.folder = folder;
  if (camera.calibration.empty()) dataset.calibration = read_camera(folder);
  dataset.warnings = dataset.calibration.notes;
  const std::vector<fs::path> images = list_images(folder / "images");
  const fs::path times = folder / "times.txt";
  if (fs::is_regular_file(times)) {
    dataset.frames = read_timed_frames(images, times, dataset.warnings);
  } else {
    dataset.frames = make_uniform_frames(images, kDefaultFramePeriod_s);
    note_order_by_numbers(images, dataset.warnings);
    dataset.warnings.push_back(folder.string() + ": no times.txt; frames are assumed to be 1/30 s apart");
  }
  if (!camera.calibration.empty()) dataset.calibration = read_chosen_camera(camera, dataset);
  dataset.pcalib = first_file(folder, {"pcalib.txt"});
  dataset.vignette = first_file(folder, {"vignette.png"});
  if (const fs::path file = first_file(folder, {"groundtruth.txt"}); !file.empty())
    dataset.groundtruth = geometry::read_tum(file);
  const fs::path body = folder_of_body(folder);
  if (const fs::path file = first_file(body, {"gps.csv"}); !file.empty()) dataset.gps = read_gps_csv(file);
  dataset.imu = first_file(body, {"imu.csv"});
  dataset.imu_noise = first_file(body, {"imu.yaml"});
  if (fs::is_directory(folder / "depth"))
    for (Frame& frame : dataset.frames) frame.depth = first_file(folder / "depth", {(frame.id + ".exr").c_str()});
  if (const fs::path file = first_file(folder, {"dataset.yaml"}); !file.empty()) dataset.metadata = read_metadata(file);
  return dataset;
}

}  // namespace layouts

bool has_foreign_layout(const fs::path& folder) {
  return !fs::is_directory(folder / "images") && (layouts::is_vslam_lab(folder) || layouts::is_kitti(folder) ||
                                                  layouts::is_euroc(folder) || layouts::is_tum_rgbd(folder));
}

Dataset read_dataset(const fs::path& folder_or_rig, const CameraChoice& choice) {
  if (!fs::is_directory(folder_or_rig)) throw InputError(folder_or_rig.string(), "no such dataset folder");
  CameraChoice camera = choice;
  const fs::path folder = choose_camera(folder_or_rig, camera);
  Dataset dataset;
  if (fs::is_directory(folder / "images")) {
    dataset = layouts::read_images_folder(folder, camera);
  } else if (layouts::is_vslam_lab(folder)) {
    dataset = layouts::read_vslam_lab(folder, camera);
  } else if (layouts::is_kitti(folder)) {
    dataset = layouts::read_kitti(folder, camera);
  } else if (layouts::is_euroc(folder)) {
    dataset = layouts::read_euroc(folder, camera);
  } else if (layouts::is_tum_rgbd(folder)) {
    dataset = layouts::read_tum_rgbd(folder, camera);
  } else {
    throw InputError(folder.string(),
                     "is not a dataset folder: expected images/ (DSO), image_0/ (KITTI), mav0/cam0/ (EuRoC), rgb.csv "
                     "(VSLAM-LAB) or rgb.txt (TUM RGB-D) in it");
  }
  check_image_size(dataset);
  if (!dataset.imu.empty() && dataset.calibration.assumes_T_cam_imu)
    dataset.warnings.push_back(unstated_mount_text(folder.string()));
  return dataset;
}

}  // namespace tileflight::dataset
