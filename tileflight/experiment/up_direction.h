#pragma once

#include <optional>

#include "tileflight/alignment/evidence.h"
#include "tileflight/dataset/dataset.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::experiment {

/// Which way is up in a map by its flight's inertial unit: imu.csv of the dataset's folder, turned into the camera's
/// axes by the calibration's T_cam_imu. nullopt where there is none, or where what it reads is no gravity. `path`:
/// T_map_camera on the dataset's clock. Throws InputError for a malformed file.
std::optional<alignment::UpDirection> up_by_inertial_unit(const dataset::Dataset& dataset,
                                                          const geometry::Trajectory& path);

}  // namespace tileflight::experiment
