#pragma once

// A dataset's inertial unit for the odometry, and what the odometry made of it, as files.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/dataset/dataset.h"
#include "tileflight/inertial/align_to_gravity.h"
#include "tileflight/survey/track_options.h"

namespace tileflight::survey {

/// Readings (imu.csv), noise (imu.yaml; without it EuRoC's ADIS16448, with a line in `warnings`) and mounting
/// (T_cam_imu). The readings are checked (inertial/imu_check.h). Throws InputError for a dataset without an inertial
/// unit, and for readings that cannot be used.
inertial::InertialInput read_inertial_input(const dataset::Dataset& data, double gravity_m_s2,
                                            std::vector<std::string>& warnings);

/// `inertial` of odometry.json (docs/formats.md).
nlohmann::json inertial_json(const inertial::InertialAlignment& alignment);

/// inertial.csv: scale, velocity and biases at each keyframe.
std::string inertial_csv(const inertial::InertialAlignment& alignment, const geometry::Trajectory& keyframes);

}  // namespace tileflight::survey
