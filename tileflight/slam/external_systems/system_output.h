#pragma once

#include <filesystem>
#include <optional>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/slam/external_systems/adapter.h"
#include "tileflight/slam/external_systems/handed_dataset.h"

namespace tileflight::external_systems {

/// Throws InputError unless the system left a file of this name, of at most 4 GB.
void require_result_file(const Adapter& adapter, const std::filesystem::path& output, const std::string& name);

/// Reads the path that a system left in `output`, by its convention, as camera-to-world poses at the frames' times.
/// Poses of an inertial unit or a lidar are moved to the camera. Throws InputError: no such file (or a huge one),
/// malformed lines, a frame that the dataset does not have, a sensor whose pose is unknown.
geometry::Trajectory read_estimated_path(const Adapter& adapter, const std::filesystem::path& output,
                                         const dataset::Dataset& dataset, const HandedDataset& handed);

/// Number of the dataset's frames that have an estimated pose within half a frame interval.
std::size_t count_tracked_frames(const geometry::Trajectory& path, const dataset::Dataset& dataset);

}  // namespace tileflight::external_systems
