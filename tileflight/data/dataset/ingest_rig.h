#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tileflight/data/dataset/ingest.h"

namespace tileflight::dataset {

/// Times at which a camera of a rig took its images.
struct CameraTimes {
  std::string name;
  std::vector<double> times_s;  ///< on the body's clock, increasing; not empty
};

/// Synchronisation of a camera's images with those of the rig's first camera.
struct CameraSynchronisation {
  std::string name;
  std::size_t frames = 0;
  std::size_t pairs = 0;      ///< images of the slower camera that may have a partner, since the other one runs, too
  std::size_t matched = 0;    ///< those of them with a partner within the tolerance
  double largest_skew_s = 0;  ///< between the two images of a matched pair
  double offset_s = 0;        ///< median over `pairs` of how much later this camera's nearest image is
  std::size_t missing = 0;    ///< images that it should have taken while it ran, and did not
  double starts_late_s = 0;   ///< after the camera that starts first; 0 within a period and a half
  double stops_early_s = 0;   ///< before the camera that stops last; 0 within a period and a half
};

/// Synchronisation of all cameras, in their order; the first one is matched with itself.
struct Synchronisation {
  std::vector<CameraSynchronisation> cameras;
  double tolerance_s = 0;
  std::vector<std::string> faults;  ///< one line each: what is wrong, and what can be done
};

/// Checks the times of a rig's images. A camera is not synchronised with the first if fewer than half of the pairs
/// match, or if it begins and ends later (or earlier) by the same time with as many images: an offset of whole frames,
/// which no pair shows. An image is missing where another camera of the same rate has one and this camera has none. If
/// no other camera has its rate, an image is missing where its own times have a gap of more than a period and a half.
/// Throws InputError(name, cause) if a camera never runs together with the first.
Synchronisation check_synchronisation(const std::vector<CameraTimes>& cameras, double tolerance_s);

/// Input of one camera of a rig that was flown.
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
  /// Options that the cameras share. `calibration` names the file for messages; the excerpt and the log are on the
  /// body's clock, `groundtruth` are poses of the first camera on that camera's clock. With excerpt.every, every n-th
  /// frame of the first camera is taken, and from each other camera those nearest to them.
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
/// files in the folder itself, those of each other one in cameras/NAME, and camchain.yaml. The result and dataset.yaml
/// state what is wrong with the times of the cameras. Throws InputError as ingest(), and for names that no camera can
/// have or cameras that never run together.
RigIngestResult ingest_rig(const RigIngestOptions& options, const std::filesystem::path& dataset_folder,
                           const Progress& progress = {});

}  // namespace tileflight::dataset
