#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/odometry/run_comparison.h"

namespace tileflight::odometry {

/// Sensors that the built-in odometry uses besides one camera.
enum class OdometryMode {
  kMono,           ///< nothing: the map's scale is unknown
  kInertial,       ///< an inertial unit: the map is metric and level, if the flight shows its scale
  kStereo,         ///< the rig's other cameras: the map is metric
  kStereoInertial  ///< both: the map is metric, and level
};

inline bool uses_inertial_unit(OdometryMode mode) {
  return mode == OdometryMode::kInertial || mode == OdometryMode::kStereoInertial;
}
inline bool uses_other_cameras(OdometryMode mode) {
  return mode == OdometryMode::kStereo || mode == OdometryMode::kStereoInertial;
}

/// "mono", "inertial", "stereo" or "stereo-inertial". Throws InputError that names `where` and the modes for other
/// words.
OdometryMode parse_odometry_mode(const std::string& where, const std::string& word);
std::string to_string(OdometryMode mode);

/// Selection of a dataset's frames, by index.
struct FrameRange {
  std::size_t from = 0;
  std::optional<std::size_t> to;  ///< exclusive
  std::size_t every = 1;
  bool reverse = false;
};

/// Settings of track(): of the odometry itself, and what it reads and writes besides the images.
struct TrackOptions {
  OdometryOptions odometry;
  FrameRange frames;
  OdometryMode mode = OdometryMode::kMono;
  double gravity_m_s2 = 9.80665;          ///< at the place; with an inertial unit
  std::filesystem::path camera;           ///< calibration that replaces the dataset's
  std::string camera_id;                  ///< which of several cameras in it
  std::filesystem::path mask;             ///< image of the frames' size; dark pixels are ignored
  std::optional<double> rectify_fov_deg;  ///< rectify to a pinhole of this horizontal field of view first
  std::filesystem::path init_from;        ///< TUM poses (a file), or depth/000000.exr by frame (a folder)
  bool colmap = false;                    ///< write colmap/ into the output folder
  std::filesystem::path debug_pictures;   ///< folder for an image of each keyframe with its points
  bool check_reversed = true;  ///< also track the images in reverse order, and report a warning if the results disagree
};

/// Line delay of a rolling shutter, estimated by tracking the images again with each estimate.
struct FoundLineDelay {
  int passes = 0;
  double used_s = 0.0;                                 ///< tracked with, in the sensor's order of rows
  std::optional<mapping::LineDelayEstimate> estimate;  ///< in the same order; nullopt: too few keyframes
};

/// Result of track().
struct TrackResult {
  OdometryResult odometry;  ///< of the chosen run; times and order are those of the dataset
  OdometryMode mode = OdometryMode::kMono;
  std::vector<std::string> frame_ids;  ///< the dataset's names of the images, by InputFrame::index
  std::int64_t frames_skipped = 0;     ///< images that could not be decoded
  bool backwards = false;              ///< the chosen run began with the last image
  imaging::Calibration calibration;    ///< of the images as tracked, with the line delay and intrinsics that were found
  bool intrinsics_estimated = false;
  std::optional<FoundLineDelay> line_delay;  ///< if it was to be estimated
  std::optional<Dispersion> dispersion;      ///< between both directions, in stated sigmas; none: there is one run
  bool loops_searched = false;
  std::vector<std::string> path_warnings;  ///< messages of those of `warnings` that concern the trajectory's shape
  Warnings warnings;

  /// Returns whether map and trajectory are in metres.
  bool is_metric() const {
    return (odometry.inertial && odometry.inertial->metric) || (odometry.stereo && odometry.stereo->metric);
  }
};

/// Runs the built-in odometry on a dataset folder and atomically writes a folder with trajectory.txt, keyframes.txt,
/// map.ply, camera.yaml (of the images as tracked), quality.csv (a line for each image) and odometry.json
/// (track_result.h); with an inertial unit whose readings show the scale also inertial.csv. The dataset's ground truth
/// and positions are not used. A run that loses tracking is written up to there, with `lost` true; one that never
/// initializes has an empty trajectory and no map points. Images that cannot be decoded are skipped, counted and
/// reported. Throws InputError for an unreadable dataset, mask or initialization, and for a lens without a COLMAP model
/// if COLMAP output is requested.
TrackResult track(const std::filesystem::path& dataset_folder, const std::filesystem::path& out, bool replace,
                  const TrackOptions& options = {}, const Progress& progress = {});

}  // namespace tileflight::odometry
