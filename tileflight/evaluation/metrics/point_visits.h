#pragma once

#include <functional>

#include "tileflight/evaluation/metrics/voxel_wasserstein.h"

// Scores of a cloud that is not held in memory.

namespace tileflight::metrics {

/// Calls its argument for each point of a cloud, in order.
using PointVisits = std::function<void(const std::function<void(const geometry::Vec3& p)>&)>;

/// voxel_wasserstein() of a map whose points are visited one by one. The same to the last digit.
VoxelWasserstein voxel_wasserstein(const PointVisits& aligned_map, const geometry::PointCloud& truth,
                                   const VoxelWassersteinOptions& options = {});

}  // namespace tileflight::metrics
