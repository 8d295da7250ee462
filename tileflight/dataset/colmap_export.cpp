#include "tileflight/dataset/colmap.h"
#include "tileflight/dataset/export_dataset.h"
#include "tileflight/dataset/exports.h"

namespace tileflight::dataset::exports {

namespace fs = std::filesystem;

/// A COLMAP project with known poses; `colmap point_triangulator` can continue from it.
void write_colmap_folder(const Dataset& dataset, const fs::path& folder, std::vector<std::string>& notes,
                         const Progress& progress) {
  require_colmap_lens(dataset.calibration.camera);
  const std::vector<geometry::SE3> poses = find_frame_poses(dataset);
  ColmapModel model;
  model.camera = dataset.calibration.camera;
  for (std::size_t i = 0; i < poses.size(); ++i)
    model.images.push_back({frame_stem(i) + dataset.frames[i].image.extension().string(), poses[i]});
  fs::create_directories(folder / "sparse" / "0");
  write_colmap(folder / "sparse" / "0", model);
  notes.push_back("the model has poses but no points; run `colmap point_triangulator` to add them");
  copy_frames(dataset, folder / "images", frame_stem, progress);
}

}  // namespace tileflight::dataset::exports
