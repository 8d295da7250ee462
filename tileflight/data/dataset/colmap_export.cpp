#include "tileflight/data/dataset/colmap.h"
#include "tileflight/data/dataset/export_dataset.h"
#include "tileflight/data/dataset/exports.h"

namespace tileflight::dataset::exports {

namespace {

namespace fs = std::filesystem;

ColmapModel single_model(const Dataset& dataset) {
  const std::vector<geometry::SE3> poses = find_frame_poses(dataset);
  ColmapModel model;
  model.camera = dataset.calibration.camera;
  for (std::size_t i = 0; i < poses.size(); ++i)
    model.images.push_back({frame_stem(i) + dataset.frames[i].image.extension().string(), poses[i]});
  return model;
}

/// Images of one instant have the same name in their cameras' folders (https://colmap.github.io/rigs.html).
ColmapModel rig_model(const Rig& rig, const std::vector<RigInstant>& instants) {
  ColmapModel model;
  std::vector<std::vector<geometry::SE3>> poses;
  for (const RigCamera& camera : rig.cameras) {
    require_colmap_lens(camera.dataset.calibration.camera);
    poses.push_back(find_frame_poses(camera.dataset));
    if (poses.size() > 1)
      model.others.push_back(
          {camera.dataset.calibration.camera, camera.T_body_camera.inverse() * rig.cameras.front().T_body_camera});
  }
  model.camera = rig.cameras.front().dataset.calibration.camera;
  for (std::size_t k = 0; k < instants.size(); ++k) {
    std::vector<std::size_t>& together = model.instants.emplace_back();
    for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
      const std::optional<std::size_t>& frame = instants[k].frames[c];
      if (!frame) continue;
      const std::string ending = rig.cameras[c].dataset.frames[*frame].image.extension().string();
      together.push_back(model.images.size());
      model.images.push_back({rig.cameras[c].name + "/" + frame_stem(k) + ending, poses[c][*frame], c});
    }
  }
  return model;
}

/// Number of the instant of each of a camera's frames.
std::vector<std::size_t> instants_of(std::size_t camera, const std::vector<RigInstant>& instants) {
  std::vector<std::size_t> numbers;
  for (std::size_t k = 0; k < instants.size(); ++k) {
    if (instants[k].frames[camera]) numbers.push_back(k);
  }
  return numbers;
}

}  // namespace

/// A COLMAP project with known poses; `colmap point_triangulator` can continue from it.
void write_colmap_folder(const Rig& rig, const fs::path& folder, std::vector<std::string>& notes,
                         const Progress& progress) {
  const Dataset& first = rig.cameras.front().dataset;
  require_colmap_lens(first.calibration.camera);
  const bool is_single = rig.cameras.size() == 1;
  const std::vector<RigInstant> instants = is_single ? std::vector<RigInstant>{} : rig_instants(rig);
  const ColmapModel model = is_single ? single_model(first) : rig_model(rig, instants);
  fs::create_directories(folder / "sparse" / "0");
  write_colmap(folder / "sparse" / "0", model);
  notes.push_back("the model has poses but no points; run `colmap point_triangulator` to add them");
  if (is_single) return copy_frames(first, folder / "images", frame_stem, progress);
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const std::vector<std::size_t> numbers = instants_of(c, instants);
    copy_frames(
        rig.cameras[c].dataset, folder / "images" / rig.cameras[c].name,
        [&](std::size_t i) { return frame_stem(numbers[i]); }, progress);
  }
}

}  // namespace tileflight::dataset::exports
