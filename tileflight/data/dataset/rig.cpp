#include "tileflight/data/dataset/rig.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/layouts.h"

namespace tileflight::dataset {
namespace {

namespace fs = std::filesystem;

bool is_plain_name(const std::string& name) {
  constexpr std::size_t kLongest = 64;
  const auto is_plain = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '_'; };
  return !name.empty() && name.size() <= kLongest && std::ranges::all_of(name, is_plain);
}

/// Folds case and '-' as the least careful of folders and topics do.
std::string folded(std::string name) {
  std::ranges::transform(name, name.begin(),
                         [](unsigned char c) { return c == '-' ? '_' : static_cast<char>(std::tolower(c)); });
  return name;
}

/// Frames of the messages (dataset_messages.cpp), and those that ROS reserves (REP 105).
bool is_other_frame(const std::string& name) {
  constexpr std::array kFrames{"map", "odom", "base_link", "base_footprint", "imu", "lidar", "earth"};
  return std::ranges::find(kFrames, folded(name)) != kFrames.end();
}

fs::path chain_file(const fs::path& folder) { return folder / "camchain.yaml"; }

/// The cameras that camchain.yaml of a rendered rig puts into folders; none for a camchain of another origin.
std::vector<imaging::ChainCamera> rendered_cameras(const fs::path& folder) {
  if (!fs::is_directory(folder / "images") || !fs::is_regular_file(chain_file(folder))) return {};
  std::vector<imaging::ChainCamera> cameras = imaging::read_camchain(chain_file(folder));
  const bool has_folders = std::ranges::none_of(cameras, [](const auto& camera) { return camera.folder.empty(); });
  if (!has_folders) return {};
  std::vector<std::string> names;
  for (const imaging::ChainCamera& camera : cameras) names.push_back(camera.name);
  if (const auto fault = fault_of_camera_names(names)) throw InputError(chain_file(folder).string(), *fault);
  return cameras;
}

/// Returns the tolerance that the first camera's dataset.yaml states, else the default.
double sync_tolerance_of(const Rig& rig) {
  const auto& about = rig.cameras.front().dataset.metadata;
  const auto said = about.find("synchronisation.tolerance_s");
  const auto tolerance_s = said == about.end() ? std::nullopt : base::parse_number<double>(said->second);
  return tolerance_s && std::isfinite(*tolerance_s) && *tolerance_s > 0.0 ? *tolerance_s : Rig{}.sync_tolerance_s;
}

Rig read_rendered_rig(const fs::path& folder, const CameraChoice& choice) {
  Rig rig;
  for (const imaging::ChainCamera& camera : rendered_cameras(folder)) {
    const fs::path own = layouts::file_within(folder, camera.folder.string(), chain_file(folder).string());
    rig.cameras.push_back(
        {camera.name, camera.T_body_cam, camera.timeshift_cam_imu_s, read_dataset(own.lexically_normal(), choice)});
  }
  rig.sync_tolerance_s = sync_tolerance_of(rig);
  Dataset& first = rig.cameras.front().dataset;
  if (const auto faults = first.metadata.find("synchronisation.faults"); faults != first.metadata.end())
    first.warnings.push_back(folder.string() + ": " + faults->second);
  return rig;
}

/// Pose on the body of a camera in another program's layout.
geometry::SE3 mount_in_layout(const fs::path& folder, const std::string& name, const Dataset& dataset) {
  if (layouts::is_vslam_lab(folder)) return layouts::vslam_lab_mount(folder, name);
  if (layouts::is_kitti(folder)) return layouts::kitti_mount(folder, name);
  return dataset.calibration.T_cam_imu.inverse();
}

struct StampedFrame {
  double time_s = 0.0;
  std::size_t camera = 0, frame = 0;
};

std::vector<StampedFrame> frames_in_order(const Rig& rig) {
  std::vector<StampedFrame> all;
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const std::vector<Frame>& frames = rig.cameras[c].dataset.frames;
    for (std::size_t i = 0; i < frames.size(); ++i)
      all.push_back({frames[i].time_s + rig.cameras[c].timeshift_s, c, i});
  }
  std::ranges::stable_sort(all, {}, &StampedFrame::time_s);
  return all;
}

}  // namespace

std::optional<std::string> fault_of_camera_names(const std::vector<std::string>& names) {
  std::vector<std::string> known;
  for (const std::string& name : names) {
    if (!is_plain_name(name))
      return "a camera's name is that of a folder, of up to 64 letters, digits, '-' and '_', not \"" + name + "\"";
    if (is_other_frame(name))
      return "no camera can be called '" + name + "': that frame is another one in exports and viewers";
    if (std::ranges::find(known, folded(name)) != known.end()) return "two cameras are called '" + name + "'";
    known.push_back(folded(name));
  }
  return std::nullopt;
}

std::vector<std::string> rig_camera_names(const fs::path& folder) {
  std::vector<std::string> names;
  for (const imaging::ChainCamera& camera : rendered_cameras(folder)) names.push_back(camera.name);
  if (!names.empty() || fs::is_directory(folder / "images")) return names;
  if (layouts::is_vslam_lab(folder)) return layouts::vslam_lab_cameras(folder);
  if (layouts::is_kitti(folder)) return layouts::kitti_cameras(folder);
  return layouts::is_euroc(folder) ? layouts::euroc_cameras(folder) : std::vector<std::string>{};
}

Rig rig_of(Dataset dataset) {
  Rig rig;
  rig.cameras.push_back({{}, {}, 0.0, std::move(dataset)});
  return rig;
}

Rig read_rig(const fs::path& folder, const CameraChoice& choice) {
  const std::vector<std::string> names = rig_camera_names(folder);
  const bool is_name = !choice.calibration.empty() && !fs::exists(choice.calibration);
  if (names.size() < 2 || !choice.name.empty() || is_name) return rig_of(read_dataset(folder, choice));
  if (!choice.calibration.empty())
    throw InputError(choice.calibration.string(), "cannot replace the calibrations of several cameras");
  if (fs::is_directory(folder / "images")) return read_rendered_rig(folder, choice);
  Rig rig;
  for (const std::string& name : names) {
    Dataset dataset = read_dataset(folder, {.calibration = {}, .camera_id = {}, .name = name});
    const geometry::SE3 T_body_camera = mount_in_layout(folder, name, dataset);
    rig.cameras.push_back({name, T_body_camera, 0.0, std::move(dataset)});
  }
  return rig;
}

std::vector<RigInstant> rig_instants(const Rig& rig, std::optional<double> tolerance) {
  const double tolerance_s = tolerance.value_or(rig.sync_tolerance_s);
  std::vector<RigInstant> instants;
  for (const StampedFrame& frame : frames_in_order(rig)) {
    const bool is_new = instants.empty() || frame.time_s - instants.back().time_s > tolerance_s ||
                        instants.back().frames[frame.camera].has_value();
    if (is_new) instants.push_back({frame.time_s, std::vector<std::optional<std::size_t>>(rig.cameras.size())});
    instants.back().frames[frame.camera] = frame.frame;
  }
  return instants;
}

}  // namespace tileflight::dataset
