#pragma once

// Estimates a lens from the images of a flight alone: focal length, principal point, distortion and rolling shutter,
// with standard deviations. Corners are followed over several segments of the flight (corner_segments.h); structure and
// motion of each segment start from two views (segment_structure.h), and one bundle adjustment of all segments shares
// the lens (lens_adjustment.h).

#include <cstddef>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/slam/self_calibration/follow_flight.h"
#include "tileflight/slam/self_calibration/lens_parameters.h"

namespace tileflight::self_calibration {

/// Holds what is known of a lens beforehand. All of it may be left out: then fields of view from 50 to 155 degrees are
/// tried.
struct LensGuess {
  /// For images of any size and the same aspect ratio. Its distortion, principal point and line delay are where the
  /// estimate begins, and what it keeps where the motion does not show them. A lens of another model than LensModel
  /// counts by its horizontal field of view alone.
  std::optional<imaging::Calibration> calibration;
  std::optional<double> horizontal_fov_deg;  ///< without a calibration
  std::optional<LensModel> model;            ///< none: the calibration's, else both are tried
  double focal_sigma = 0.3;                  ///< relative standard deviation of the focal length: 0.02 for a profile
};

/// Holds the settings of estimate_lens().
struct LensEstimateOptions {
  FlightImages images;
  SegmentOptions segments;
  bool estimate_line_delay = true;
};

/// Describes a parameter of the lens, for images of full size.
struct ParameterEstimate {
  std::string name;    ///< fx, fy, cx, cy, k1 k2 p1 p2 (pinhole) or k1 k2 k3 k4 (fisheye), line_delay
  double value = 0.0;  ///< pixels; seconds for line_delay
  double sigma = 0.0;  ///< standard deviation; of a held one that of the guess
  double guess = 0.0;
  /// Whether it is left at the guess: the motion does not show it (a note names it), or it hardly differs from the
  /// guess: by less than three standard deviations (line_delay, fy, p1, p2) or one and a half (k2, k3, k4).
  bool is_held = false;
};

/// Holds the result of estimate_lens().
struct LensEstimate {
  imaging::Calibration calibration;  ///< for images of full size; the guess if not `is_estimated`
  LensModel model = LensModel::kPinhole;
  std::vector<ParameterEstimate> parameters;
  /// Whether the images show the focal length, better than the guess. If not, `calibration` is the guess (without one:
  /// a pinhole of 70 degrees), and a warning says why.
  bool is_estimated = false;
  double focal_sigma = 0.0;         ///< relative standard deviation of the focal length
  double rms_px = 0.0;              ///< reprojection error of corners that fit, in pixels of full size
  double other_model_rms_px = 0.0;  ///< the same of the other model; 0: not tried
  std::size_t segments = 0;         ///< in which structure and motion were found
  std::size_t images = 0;           ///< of these
  std::size_t tracks = 0;           ///< corners that fit
  double turn_deg = 0.0;            ///< largest rotation within a segment
  Warnings warnings;
};

/// Estimates the lens of a video, of a dataset folder, or of a folder of images in the order of their names. A
/// dataset's own calibration is the guess if there is no other. Of a video only the parts where segments are are read.
/// The result does not depend on the number of threads. Throws InputError as read_video, read_dataset and the readers
/// of images do, and for a guess of another aspect ratio.
LensEstimate estimate_lens(const std::filesystem::path& images, const LensGuess& guess,
                           const LensEstimateOptions& options = {}, const Progress& progress = {});

/// Estimates the lens from corners that were followed in images of the given full size.
LensEstimate estimate_lens(const FollowedFlight& flight, const LensGuess& guess, bool estimate_line_delay = true,
                           const Progress& progress = {});

/// Returns the result as `tileflight lens --estimate --json` prints it.
nlohmann::json to_json(const LensEstimate& estimate);

}  // namespace tileflight::self_calibration
