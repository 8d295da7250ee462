#pragma once

#include <optional>

#include "tileflight/data/dataset/dataset.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/evaluation/registration/telemetry_estimate.h"

namespace tileflight::scoring {

/// Estimates the up direction of a map from its flight's IMU: the dataset's readings, rotated into the camera
/// frame by the calibration's T_cam_imu. nullopt if there is no IMU, or if its readings do not look like gravity.
/// `path`: T_map_camera on the dataset's clock. Throws InputError for a malformed file.
std::optional<registration::UpDirection> up_from_imu(const dataset::Dataset& dataset, const geometry::Trajectory& path);

}  // namespace tileflight::scoring
