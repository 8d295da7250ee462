// The layout of the TUM monoVO sequences (Engel, Usenko, Cremers 2016), as read by DSO.
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/exports.h"

namespace tileflight::dataset::exports {

namespace fs = std::filesystem;

void write_tum_mono(const Rig& rig, const fs::path& folder, std::vector<std::string>& notes, const Progress& progress) {
  const Dataset& dataset = rig.cameras.front().dataset;
  note_cameras_left_out(rig, 1, notes);
  if (!imaging::has_dso_model(dataset.calibration.camera))
    throw InputError(dataset.folder.string(),
                     "DSO's camera.txt cannot describe this lens; use a pinhole, fov, radtan or equidistant camera");
  imaging::write_dso_camera(folder / "camera.txt", dataset.calibration);
  std::string times;
  for (std::size_t i = 0; i < dataset.frames.size(); ++i) {
    const Frame& frame = dataset.frames[i];
    times += frame_stem(i) + " " + base::fixed_text(frame.time_s) + " " + base::fixed_text(frame.exposure_ms) + "\n";
  }
  base::write_file(folder / "times.txt", times);
  if (!dataset.pcalib.empty()) base::write_file(folder / "pcalib.txt", base::read_text(dataset.pcalib));
  if (!dataset.vignette.empty()) base::write_file(folder / "vignette.png", base::read_text(dataset.vignette));
  if (dataset.groundtruth) geometry::write_tum(folder / "groundtruthSync.txt", *dataset.groundtruth);
  if (dataset.calibration.line_delay_s != 0.0)
    notes.push_back("DSO's camera.txt cannot store the rolling shutter; it is left out");
  copy_frames(dataset, folder / "images", frame_stem, progress);
}

}  // namespace tileflight::dataset::exports
