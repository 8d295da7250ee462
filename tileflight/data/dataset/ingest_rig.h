#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tileflight/data/dataset/ingest.h"
#include "tileflight/data/dataset/synchronisation.h"

namespace tileflight::dataset {

/// A camera of a rig that was flown, and what it took.
struct IngestedCamera {
  std::string name;                              ///< as fault_of_camera_names allows
  std::filesystem::path video_or_images;         ///< as IngestOptions::video_or_images
  std::map<std::string, ImageTime> image_times;  ///< as IngestOptions::image_times
  imaging::Calibration calibration;
  geometry::SE3 T_body_camera;
  double timeshift_s = 0.0;  ///< time on the body's clock = time of a frame + this
};

/// Inputs of a real flight of several cameras.
struct RigIngestOptions {
  /// What is not of one camera. `calibration` names the file for messages; the excerpt and the log are on the body's
  /// clock, `groundtruth` are poses of the first camera on that camera's clock. With excerpt.every, every n-th frame of
  /// the first camera is taken, and of each other camera those nearest to them.
  IngestOptions common;
  std::vector<IngestedCamera> cameras;  ///< at least one
  double sync_tolerance_s = 1e-3;       ///< frames of different cameras that differ by no more are of one instant
};

/// Result of ingest_rig(), by camera.
struct RigIngestResult {
  std::vector<IngestResult> cameras;
  Synchronisation synchronisation;
};

/// Writes the flight as the dataset folder of a rig (rig.h), as `render` writes one, atomically: the first camera's
/// files in the folder itself, those of each other one in cameras/NAME, and camchain.yaml. What is wrong with the times
/// of the cameras is in the result, and in dataset.yaml. Throws InputError as ingest(), and for names that no camera
/// can have or cameras that never run together.
RigIngestResult ingest_rig(const RigIngestOptions& options, const std::filesystem::path& dataset_folder,
                           const Progress& progress = {});

}  // namespace tileflight::dataset
