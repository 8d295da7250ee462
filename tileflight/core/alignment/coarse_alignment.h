#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tileflight/core/alignment/align_map.h"

namespace tileflight::alignment {

/// Every k-th point (position and normal), with the smallest k that leaves at most about `most` points.
geometry::PointCloud subsample(const geometry::PointCloud& map, std::size_t most);

/// One ICP step against the part of the target that the method needs. Throws InputError if that is missing, and as
/// icp() does.
IcpResult align_step(const geometry::PointCloud& map, const geometry::Sim3& start, const AlignmentTarget& target,
                     const IcpOptions& options);

/// Result of the coarse steps.
struct CoarseAlignment {
  geometry::Sim3 T_local_map;
  std::vector<IcpResult> steps;  ///< in order, from the best scale seed
  double best_scale_seed = 1.0;  ///< best scale seed, as a multiple of the start's scale
  std::string note;              ///< empty, or a note that another scale fits as well
};

/// ICP with decreasing radii from each scale seed, over at most about 10 000 evenly chosen points; the result with the
/// smallest mean of min(distance, last radius)^2 is returned. Several seeds are needed because a map that is too small
/// has surface close to all its points at many places, so that a start with a wrong scale gets stuck at a wrong place.
CoarseAlignment align_coarsely(const geometry::PointCloud& map, const geometry::Sim3& T_local_map_start,
                               const AlignmentTarget& target, const AlignMapOptions& options);

}  // namespace tileflight::alignment
