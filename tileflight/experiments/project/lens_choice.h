#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/experiments/project/choice.h"
#include "tileflight/experiments/project/excerpt.h"
#include "tileflight/experiments/project/recording.h"
#include "tileflight/slam/self_calibration/self_calibration.h"

namespace tileflight::project {

/// Holds what a user says of the lens; all of it may be missing.
struct LensHints {
  std::filesystem::path camera;    ///< calibration or lens profile
  std::filesystem::path profiles;  ///< folder of lens profiles
  std::optional<double> fov_deg;   ///< horizontal field of view
};

/// Holds the lens that was chosen for a recording.
struct LensChoice {
  imaging::Calibration calibration;  ///< for images of the recording's size
  Choice choice;                     ///< real.ingest.camera; its value is set by the caller
  /// Estimation from the images begins with this, if the lens is a guess (estimate_from_images()).
  std::optional<self_calibration::LensGuess> guess;
  std::vector<std::string> warnings;
};

/// Estimates a lens that is a guess from the images (self_calibration::estimate_lens). If they show it, it replaces the
/// guess, with a reason that names focal length and standard deviation; else a warning says why the guess stays.
/// `excerpt`: the part of the recording whose images are taken. `mask`: a file; empty: none.
void estimate_from_images(const Recording& recording, const Excerpt& excerpt, const std::filesystem::path& mask,
                          LensChoice& lens, const Progress& progress = {});

/// Chooses the lens by the first of these that there is: the calibration that was given, the photos' tags, a lens
/// profile of the camera that the recording names, a calibration beside the video (camera.yaml, calibration.json and
/// the like, or the video's name), the field of view that was given, the focal length in the log or the photos. Without
/// any of them, a pinhole of 80 degrees. Throws InputError for a calibration that was given and cannot be read or has
/// another shape.
LensChoice choose_lens(const Recording& recording, const LensHints& hints, const Progress& progress = {});

}  // namespace tileflight::project
