#include "tileflight/data/dataset/export_dataset.h"

#include <cmath>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/data/dataset/exports.h"

namespace tileflight::dataset {

namespace {

namespace fs = std::filesystem;

struct Layout {
  std::string name;
  exports::LayoutWriter write;
};

const std::vector<Layout>& known_layouts() {
  static const std::vector<Layout> kLayouts{{"tum-mono", exports::write_tum_mono},
                                            {"euroc", exports::write_euroc},
                                            {"kitti", exports::write_kitti},
                                            {"colmap", exports::write_colmap_folder},
                                            {"vslamlab", exports::write_vslam_lab}};
  return kLayouts;
}

}  // namespace

const std::vector<std::string>& export_layouts() {
  static const std::vector<std::string> kNames = [] {
    std::vector<std::string> names;
    for (const Layout& layout : known_layouts()) names.push_back(layout.name);
    return names;
  }();
  return kNames;
}

ExportResult export_dataset(const Dataset& dataset, const std::string& layout, const fs::path& folder, bool replace,
                            const Progress& progress, std::vector<fs::path> inputs) {
  return export_rig(rig_of(dataset), layout, folder, replace, progress, std::move(inputs));
}

ExportResult export_rig(const Rig& rig, const std::string& layout, const fs::path& folder, bool replace,
                        const Progress& progress, std::vector<fs::path> inputs) {
  for (const RigCamera& camera : rig.cameras) inputs.push_back(camera.dataset.folder);
  for (const Layout& known : known_layouts()) {
    if (known.name != layout) continue;
    ExportResult result{rig.cameras.front().dataset.frames.size(), {}};
    // Other tools write the same layouts: only the marker identifies ours.
    const base::OutputFolder output{
        .folder = folder, .command = "export", .replace = replace, .inputs = std::move(inputs)};
    base::write_folder(output, [&](const fs::path& temporary) { known.write(rig, temporary, result.notes, progress); });
    return result;
  }
  throw InputError("layout '" + layout + "'",
                   "is not known; did you mean '" + base::nearest_key(layout, export_layouts()) + "'?");
}

std::vector<geometry::SE3> find_frame_poses(const Dataset& dataset) {
  constexpr double kSameTime_s = 1e-4;
  if (!dataset.groundtruth)
    throw InputError(dataset.folder.string(), "has no groundtruth.txt, which this layout needs");
  const std::vector<geometry::StampedPose>& poses = dataset.groundtruth->poses;
  std::vector<geometry::SE3> result;
  std::size_t k = 0;
  for (const Frame& frame : dataset.frames) {
    while (k < poses.size() && poses[k].time_s < frame.time_s - kSameTime_s) ++k;
    if (k == poses.size() || std::abs(poses[k].time_s - frame.time_s) > kSameTime_s)
      throw InputError(dataset.folder.string(), "groundtruth.txt has no pose at the time of frame " + frame.id);
    result.push_back(poses[k].T_local_camera);
  }
  return result;
}

}  // namespace tileflight::dataset
