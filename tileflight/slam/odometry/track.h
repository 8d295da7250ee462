#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/slam/odometry/odometry.h"

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

/// Optional inputs and outputs of the built-in odometry besides the images.
struct TrackOptions {
  OdometryMode mode = OdometryMode::kMono;
  double gravity_m_s2 = 9.80665;          ///< at the place; with an inertial unit
  bool inertial_in_window = false;        ///< with an inertial unit: odometry::Priors::inertial_in_window
  std::filesystem::path camera;           ///< calibration that replaces the dataset's
  std::string camera_id;                  ///< which of several cameras in it
  std::filesystem::path mask;             ///< image of the frames' size; dark pixels are ignored
  std::optional<double> rectify_fov_deg;  ///< rectify to a pinhole of this horizontal field of view first
  std::filesystem::path init_from;        ///< TUM poses (a file), or depth/000000.exr by frame (a folder)
  bool colmap = false;                    ///< write colmap/ into the output folder
  std::filesystem::path debug_pictures;   ///< folder for an image of each keyframe with its points
  bool check_reversed = true;  ///< also track the images in reverse order, and report a warning if the results disagree
};

/// Selection of a dataset's frames, by index.
struct FrameRange {
  std::size_t from = 0;
  std::optional<std::size_t> to;  ///< exclusive
  std::size_t every = 1;
  bool reverse = false;
};

/// Runs the built-in odometry on a dataset folder and atomically writes a folder with trajectory.txt, keyframes.txt,
/// map.ply, camera.yaml (of the images as tracked), quality.csv (a line per image) and odometry.json (returned, with
/// `warnings`, `mode` and `scale`); with an inertial unit whose readings show the scale also inertial.csv. The
/// dataset's ground truth and positions are not used. A run that loses tracking is written up to there, with `lost`
/// true; one that never initializes has an empty trajectory and no map points. Images that cannot be decoded are
/// skipped, counted and reported. Throws InputError for an unreadable dataset, mask or initialization, and for a lens
/// without a COLMAP model if COLMAP output is requested.
nlohmann::json track(const std::filesystem::path& dataset_folder, const std::filesystem::path& out, bool replace,
                     const odometry::OdometryOptions& options, const FrameRange& range, const Progress& progress = {},
                     const TrackOptions& extras = {});

/// The output folder of any odometry program: the files by which a folder of an earlier version is recognised, and the
/// inputs that must not be overwritten.
base::OutputFolder odometry_output_folder(const std::filesystem::path& out, bool replace,
                                          std::vector<std::filesystem::path> inputs);

/// Runs an external odometry program instead: a shell command with {dataset} and {out} substituted (each quoted for the
/// shell), executed in `folder`. It must write trajectory.txt and map.ply into {out}; odometry.json is added if it
/// writes none. Throws InputError if the command fails or writes no trajectory.txt or map.ply.
nlohmann::json track_with_command(const std::filesystem::path& dataset_folder, const std::filesystem::path& out,
                                  bool replace, const std::string& command, const std::filesystem::path& folder);

}  // namespace tileflight::odometry
