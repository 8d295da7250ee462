#pragma once

#include <filesystem>
#include <optional>
#include <string>

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

}  // namespace tileflight::odometry
