#include "tileflight/slam/external_systems/handed_dataset.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/imaging/rectify.h"
#include "tileflight/data/dataset/rig.h"
#include "tileflight/data/exports/export_dataset.h"
#include "tileflight/slam/external_systems/lens_support.h"

namespace tileflight::external_systems {
namespace fs = std::filesystem;
namespace {

/// An adapter's word for this program's own layout.
constexpr const char* kOwnLayout = "tileflight";

/// Returns where the layouts that read_dataset() knows keep an input; the first is this program's own. Empty: see
/// has_input().
std::vector<const char*> places_of(Input input) {
  switch (input) {
    case Input::kImages:
    case Input::kStereo:
      return {};
    case Input::kDepth:
      return {"depth", "depth_0"};
    case Input::kImu:
      return {"imu.csv", "mav0/imu0/data.csv", "imu0/data.csv", "imu_0.csv"};
    case Input::kLidar:
      return {"lidar", "velodyne"};
  }
  return {};
}

bool has_input(const dataset::Dataset& dataset, Input input) {
  if (input == Input::kStereo) return dataset::rig_camera_names(dataset.folder).size() > 1;
  const auto places = places_of(input);
  return places.empty() ||
         std::ranges::any_of(places, [&](const char* place) { return fs::exists(dataset.folder / place); });
}

std::string description(Input input) {
  switch (input) {
    case Input::kImages:
      return "images";
    case Input::kStereo:
      return "a second camera";
    case Input::kDepth:
      return "depth images";
    case Input::kImu:
      return "an inertial unit";
    case Input::kLidar:
      return "lidar scans";
  }
  return "";
}

bool knows_lens(const Adapter& adapter, const imaging::Camera& camera) {
  const std::string lens = lens_name(camera);
  return std::ranges::any_of(adapter.lenses, [&](const std::string& known) {
    // A plain pinhole is a pinhole-radtan without distortion.
    return known == "any" || known == lens || (lens == "pinhole" && known == "pinhole-radtan");
  });
}

bool takes(const Adapter& adapter, Input input) { return std::ranges::count(adapter.inputs, input) > 0; }

bool lies_in_own_layout(const dataset::Dataset& dataset) { return fs::exists(dataset.folder / "images"); }

/// Returns why the cameras cannot be handed to a system that takes several: the other ones are handed over as they are,
/// or not at all.
std::string why_cameras_cannot_be_handed(const Adapter& adapter, const dataset::Dataset& dataset) {
  for (const dataset::RigCamera& camera : dataset::read_rig(dataset.folder).cameras) {
    const imaging::Camera& lens = camera.dataset.calibration.camera;
    if (!knows_lens(adapter, lens))
      return "does not know the lens " + lens_name(lens) + ", and the images of several cameras are not rectified";
  }
  if (adapter.layout == kOwnLayout && !lies_in_own_layout(dataset))
    return "takes several cameras in this program's own layout only; `tileflight ingest` makes such a dataset";
  return "";
}

/// Other sensors' files of a dataset in this program's layout, which exports read beside the images.
void copy_other_sensors(const fs::path& from, const fs::path& to) {
  constexpr std::array kFiles{"imu.csv", "imu.yaml", "imu_bias.csv", "gps.csv", "attitude.csv", "lidar"};
  for (const char* name : kFiles) {
    if (fs::exists(from / name) && !fs::exists(to / name))
      fs::copy(from / name, to / name, fs::copy_options::recursive);
  }
}

/// Writes the dataset in this program's layout, with its images rectified to a pinhole if one is given.
void write_own_layout(const dataset::Dataset& dataset, const imaging::Camera* pinhole, const fs::path& folder,
                      const Progress& progress) {
  imaging::Calibration calibration = dataset.calibration;
  std::optional<imaging::Rectifier> rectify;
  if (pinhole != nullptr) {
    rectify.emplace(dataset.calibration.camera, *pinhole);
    calibration.camera = *pinhole;
    calibration.line_delay_s = 0.0;  // a rectified image's rows are not the sensor's
  }
  dataset::DatasetWriter writer(folder, calibration, {.command = "odometry", .inputs = {dataset.folder}, .png = true});
  for (std::size_t i = 0; i < dataset.frames.size(); ++i) {
    const dataset::Frame& frame = dataset.frames[i];
    const imaging::RgbImage image = imaging::read_rgb(frame.image);
    writer.add_frame(i, frame.time_s, frame.exposure_ms, rectify ? (*rectify)(image) : image);
    report_progress(progress, static_cast<std::int64_t>(i + 1), static_cast<std::int64_t>(dataset.frames.size()),
                    "preparing images");
  }
  if (dataset.groundtruth) writer.set_groundtruth(*dataset.groundtruth);
  if (!dataset.gps.empty()) writer.set_gps(dataset.gps);
  for (const auto& [key, value] : dataset.metadata) writer.describe(key, value);
  writer.finish();
  copy_other_sensors(dataset.folder, folder);
}

/// "Tr: 12 numbers" of KITTI's calib.txt: from the lidar to the camera.
std::optional<geometry::SE3> read_lidar_pose(const fs::path& calib_txt) {
  if (!fs::exists(calib_txt)) return std::nullopt;
  std::istringstream file(base::read_text(calib_txt));
  for (std::string line; std::getline(file, line);) {
    std::istringstream fields(line);
    std::string name;
    fields >> name;
    if (name != "Tr:") continue;
    Eigen::Matrix<double, 3, 4, Eigen::RowMajor> T;
    for (int i = 0; i < 12; ++i) fields >> T.data()[i];
    if (!fields) throw InputError(calib_txt.string(), "'Tr:' must have 12 numbers");
    geometry::SE3 result;
    result.rotation = Eigen::Quaterniond(geometry::Mat3(T.leftCols<3>())).normalized();
    result.translation = T.col(3);
    return result;
  }
  return std::nullopt;
}

void describe_rectification(const Adapter& adapter, const imaging::Calibration& native, const imaging::Camera& pinhole,
                            HandedDataset& handed) {
  handed.rectified = true;
  handed.visible_share = visible_share(native.camera, pinhole);
  handed.notes.push_back("the images were rectified: " + adapter.title + " does not know the lens " +
                         lens_name(native.camera));
  if (native.line_delay_s != 0.0)
    handed.notes.emplace_back("the rolling shutter was not corrected: rectified images have no time for each row");
}

}  // namespace

std::string why_not_applicable(const Adapter& adapter, const dataset::Dataset& dataset) {
  for (const Input input : adapter.inputs) {
    if (has_input(dataset, input)) continue;
    const auto places = places_of(input);
    return "needs " + description(input) + ", and the dataset has " +
           (places.empty() ? "none" : std::string("no ") + places.front());
  }
  if (takes(adapter, Input::kStereo)) {
    if (const std::string why = why_cameras_cannot_be_handed(adapter, dataset); !why.empty()) return why;
  }
  if (takes(adapter, Input::kDepth) && !knows_lens(adapter, dataset.calibration.camera))
    return "does not know the lens " + lens_name(dataset.calibration.camera) + ", and depth images are not rectified";
  return "";
}

HandedDataset hand_over(const Adapter& adapter, const dataset::Dataset& dataset, const fs::path& scratch,
                        const Progress& progress) {
  HandedDataset handed{.folder = dataset.folder, .calibration = dataset.calibration, .notes = {}};
  dataset::Dataset source = dataset;
  const bool rectifies = !knows_lens(adapter, dataset.calibration.camera);
  const bool wants_own_layout = adapter.layout == kOwnLayout && !lies_in_own_layout(dataset);
  if (rectifies || wants_own_layout) {
    handed.folder = scratch / (rectifies ? "rectified" : "dataset");
    std::optional<imaging::Camera> pinhole;
    if (rectifies) pinhole = rectified_pinhole(dataset.calibration.camera);
    write_own_layout(dataset, pinhole ? &*pinhole : nullptr, handed.folder, progress);
    source = dataset::read_dataset(handed.folder);
    handed.calibration = source.calibration;
    if (rectifies) describe_rectification(adapter, dataset.calibration, *pinhole, handed);
  }
  if (adapter.layout == kOwnLayout) return handed;
  handed.folder = scratch / adapter.layout;
  // Several cameras are neither rectified nor rewritten (why_not_applicable), so that they are those of the folder.
  const dataset::Rig cameras =
      takes(adapter, Input::kStereo) ? dataset::read_rig(dataset.folder) : dataset::rig_of(source);
  const exports::ExportResult result = exports::export_rig(cameras, adapter.layout, handed.folder, false, progress);
  handed.notes.insert(handed.notes.end(), result.notes.begin(), result.notes.end());
  if (adapter.layout == "kitti") handed.T_cam_lidar = read_lidar_pose(handed.folder / "calib.txt");
  return handed;
}

}  // namespace tileflight::external_systems
