// The layout of the TUM monoVO sequences (Engel, Usenko, Cremers 2016), which DSO reads.
#include "tileflight/dataset/exports.h"
#include "tileflight/dataset/number_text.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::dataset::exports {

namespace fs = std::filesystem;

void write_tum_mono(const Dataset& dataset, const fs::path& folder, std::vector<std::string>& notes,
                    const Progress& progress) {
  if (!imaging::has_dso_name(dataset.calibration.camera))
    throw InputError(dataset.folder.string(),
                     "DSO's camera.txt has no name for this lens; use a pinhole, fov, radtan or equidistant camera");
  imaging::write_dso_camera(folder / "camera.txt", dataset.calibration);
  std::string times;
  for (std::size_t i = 0; i < dataset.frames.size(); ++i) {
    const Frame& frame = dataset.frames[i];
    times += numbered(i) + " " + fixed_text(frame.time_s) + " " + fixed_text(frame.exposure_ms) + "\n";
  }
  geometry::write_file(folder / "times.txt", times);
  if (!dataset.pcalib.empty()) geometry::write_file(folder / "pcalib.txt", geometry::read_text(dataset.pcalib));
  if (!dataset.vignette.empty()) geometry::write_file(folder / "vignette.png", geometry::read_text(dataset.vignette));
  if (dataset.groundtruth) geometry::write_tum(folder / "groundtruthSync.txt", *dataset.groundtruth);
  if (dataset.calibration.line_delay_s != 0.0) notes.push_back("DSO's camera.txt has no place for the rolling shutter");
  copy_frames(dataset, folder / "images", numbered, progress);
}

}  // namespace tileflight::dataset::exports
