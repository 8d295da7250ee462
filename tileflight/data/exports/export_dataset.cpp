#include "tileflight/data/exports/export_dataset.h"

#include <cmath>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/exports/layout_writers.h"

namespace tileflight::exports {

namespace {

namespace fs = std::filesystem;

/// The layout of the TUM monoVO sequences (Engel, Usenko, Cremers 2016), as read by DSO.
void write_tum_mono(const dataset::Rig& rig, const fs::path& folder, std::vector<std::string>& notes,
                    const Progress& progress) {
  const dataset::Dataset& dataset = rig.cameras.front().dataset;
  note_cameras_left_out(rig, 1, notes);
  if (!imaging::has_dso_model(dataset.calibration.camera))
    throw InputError(dataset.folder.string(),
                     "DSO's camera.txt cannot describe this lens; use a pinhole, fov, radtan or equidistant camera");
  imaging::write_dso_camera(folder / "camera.txt", dataset.calibration);
  std::string times;
  for (std::size_t i = 0; i < dataset.frames.size(); ++i) {
    const dataset::Frame& frame = dataset.frames[i];
    times +=
        dataset::frame_id(i) + " " + base::fixed_text(frame.time_s) + " " + base::fixed_text(frame.exposure_ms) + "\n";
  }
  base::write_file(folder / "times.txt", times);
  if (!dataset.pcalib.empty()) base::write_file(folder / "pcalib.txt", base::read_raw(dataset.pcalib));
  if (!dataset.vignette.empty()) base::write_file(folder / "vignette.png", base::read_raw(dataset.vignette));
  if (dataset.groundtruth) geometry::write_tum(folder / "groundtruthSync.txt", *dataset.groundtruth);
  if (dataset.calibration.line_delay_s != 0.0)
    notes.push_back("DSO's camera.txt cannot store the rolling shutter; it is left out");
  copy_frames(dataset, folder / "images", dataset::frame_id, progress);
}

struct Layout {
  std::string name;
  LayoutWriter write;
  std::vector<std::string> held;  ///< what it holds besides images, calibration and poses, for note_data_left_out()
};

const std::vector<Layout>& known_layouts() {
  static const std::vector<Layout> kLayouts{{"tum-mono", write_tum_mono, {}},
                                            {"euroc", write_euroc, {"imu.csv", "imu_bias.csv"}},
                                            {"kitti", write_kitti, {"lidar"}},
                                            {"colmap", write_colmap_folder, {}},
                                            {"vslamlab", write_vslam_lab, {"imu.csv", "depth"}}};
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

ExportResult export_dataset(const dataset::Dataset& dataset, const std::string& layout, const fs::path& folder,
                            bool replace, const Progress& progress, std::vector<fs::path> inputs) {
  return export_rig(dataset::rig_of(dataset), layout, folder, replace, progress, std::move(inputs));
}

ExportResult export_rig(const dataset::Rig& rig, const std::string& layout, const fs::path& folder, bool replace,
                        const Progress& progress, std::vector<fs::path> inputs) {
  for (const dataset::RigCamera& camera : rig.cameras) inputs.push_back(camera.dataset.folder);
  for (const Layout& known : known_layouts()) {
    if (known.name != layout) continue;
    ExportResult result{rig.cameras.front().dataset.frames.size(), {}};
    note_reading_warnings(rig, result.notes);
    note_data_left_out(rig, known.held, result.notes);
    // Other tools write the same layouts: only the marker identifies ours.
    const base::OutputFolder output{
        .folder = folder, .command = "export", .replace = replace, .inputs = std::move(inputs)};
    base::write_folder(output, [&](const fs::path& temporary) { known.write(rig, temporary, result.notes, progress); });
    return result;
  }
  throw InputError("layout '" + layout + "'",
                   "is not known; did you mean '" + base::nearest_key(layout, export_layouts()) + "'?");
}

std::vector<geometry::SE3> find_frame_poses(const dataset::Dataset& dataset) {
  constexpr double kSameTime_s = 1e-4;
  if (!dataset.groundtruth)
    throw InputError(dataset.folder.string(), "has no groundtruth.txt, which this layout needs");
  const std::vector<geometry::StampedPose>& poses = dataset.groundtruth->poses;
  std::vector<geometry::SE3> result;
  std::size_t k = 0;
  for (const dataset::Frame& frame : dataset.frames) {
    while (k < poses.size() && poses[k].time_s < frame.time_s - kSameTime_s) ++k;
    if (k == poses.size() || std::abs(poses[k].time_s - frame.time_s) > kSameTime_s)
      throw InputError(dataset.folder.string(), "groundtruth.txt has no pose at the time of frame " + frame.id);
    result.push_back(poses[k].T_local_camera);
  }
  return result;
}

}  // namespace tileflight::exports
