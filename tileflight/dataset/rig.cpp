#include "tileflight/dataset/rig.h"

#include <algorithm>

#include "tileflight/base/input_error.h"
#include "tileflight/dataset/layouts.h"
#include "tileflight/imaging/calibration_files.h"

namespace tileflight::dataset {
namespace {

namespace fs = std::filesystem;

fs::path chain_file(const fs::path& folder) { return folder / "camchain.yaml"; }

/// The cameras that camchain.yaml of a rendered rig puts into folders; none for a camchain of another origin.
std::vector<imaging::ChainCamera> rendered_cameras(const fs::path& folder) {
  if (!fs::is_directory(folder / "images") || !fs::is_regular_file(chain_file(folder))) return {};
  std::vector<imaging::ChainCamera> cameras = imaging::read_camchain(chain_file(folder));
  const bool has_folders = std::ranges::none_of(cameras, [](const auto& camera) { return camera.folder.empty(); });
  return has_folders ? cameras : std::vector<imaging::ChainCamera>{};
}

Rig read_rendered_rig(const fs::path& folder, const CameraChoice& choice) {
  Rig rig;
  for (const imaging::ChainCamera& camera : rendered_cameras(folder)) {
    const fs::path own = layouts::file_within(folder, camera.folder.string(), chain_file(folder).string());
    rig.cameras.push_back(
        {camera.name, camera.T_body_cam, camera.timeshift_cam_imu_s, read_dataset(own.lexically_normal(), choice)});
  }
  return rig;
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

std::vector<std::string> rig_camera_names(const fs::path& folder) {
  std::vector<std::string> names;
  for (const imaging::ChainCamera& camera : rendered_cameras(folder)) names.push_back(camera.name);
  if (!names.empty() || fs::is_directory(folder / "images")) return names;
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
    const geometry::SE3 T_body_camera =
        layouts::is_kitti(folder) ? layouts::kitti_mount(folder, name) : dataset.calibration.T_cam_imu.inverse();
    rig.cameras.push_back({name, T_body_camera, 0.0, std::move(dataset)});
  }
  return rig;
}

std::vector<RigInstant> rig_instants(const Rig& rig, double tolerance_s) {
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
