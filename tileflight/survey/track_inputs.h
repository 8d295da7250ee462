#pragma once

// What the odometry takes of a dataset besides the images of one camera (its inertial unit, the rig's other cameras),
// and what it made of it, as files.

#include <cstddef>
#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/dataset/dataset.h"
#include "tileflight/inertial/align_to_gravity.h"
#include "tileflight/odometry/odometry.h"
#include "tileflight/survey/track_options.h"

namespace tileflight::survey {

/// Readings (imu.csv), noise (imu.yaml; without it EuRoC's ADIS16448, with a line in `warnings`) and mounting
/// (T_cam_imu). The readings are checked (inertial/imu_check.h). Throws InputError for a dataset without an inertial
/// unit, and for readings that cannot be used.
inertial::InertialInput read_inertial_input(const dataset::Dataset& data, double gravity_m_s2,
                                            std::vector<std::string>& warnings);

/// `inertial` of odometry.json (docs/formats.md).
nlohmann::json inertial_json(const inertial::InertialAlignment& alignment,
                             const std::optional<double>& coupled_since_s);

/// inertial.csv: scale, velocity and biases at each keyframe.
std::string inertial_csv(const inertial::InertialAlignment& alignment, const geometry::Trajectory& keyframes);

/// A rig's reference camera, and the others that expose at the same instants.
struct StereoRig {
  dataset::Dataset reference;
  std::vector<odometry::OtherCamera> others;
  std::map<double, std::vector<std::optional<dataset::Frame>>> other_frames;  ///< by the time of a reference frame: of
                                                                              ///< each of `others`, if it took one
};

/// Pictures are of one instant if their times differ by at most this.
inline constexpr double kSameInstant_s = 1e-4;

/// Reads a dataset with several cameras. The reference camera is the first, or the one that `camera` names. Cameras
/// without a picture at an instant of the reference camera are left out, with a line in `warnings`. Throws InputError
/// for a dataset with one camera, if `camera` is no name, and if no other camera is left.
StereoRig read_stereo_rig(const std::filesystem::path& folder, const std::string& camera,
                          std::vector<std::string>& warnings);

/// `stereo` of odometry.json (docs/formats.md).
nlohmann::json stereo_json(const odometry::StereoResult& stereo);

}  // namespace tileflight::survey
