#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tileflight/alignment/align_map.h"

namespace tileflight::alignment {

/// Every k-th point, with k the least that leaves at most about `most`: positions and normals.
geometry::PointCloud thinned(const geometry::PointCloud& map, std::size_t most);

/// One step of an alignment against whatever the method needs of the target. Throws InputError where that is missing,
/// and as icp() does.
AlignmentResult align_step(const geometry::PointCloud& map, const geometry::Sim3& start, const AlignmentTarget& target,
                           const IcpOptions& options);

/// Where the coarse steps lead.
struct CoarseAlignment {
  geometry::Sim3 T_local_map;
  std::vector<AlignmentResult> steps;  ///< from the scale that won, in order
  double scale_seed = 1.0;             ///< that scale, as a factor of the start's
  std::string note;                    ///< empty, or that another scale fits as well
};

/// ICP with radii that shrink, from each of the scale seeds, over at most some 10 000 evenly chosen points; the end
/// with the least mean min(distance, last radius)^2 wins. A map that is too small finds surface close to each of its
/// points wherever it lies, so that from far off in scale a single start rests in the wrong place.
CoarseAlignment align_coarsely(const geometry::PointCloud& map, const geometry::Sim3& T_local_map_start,
                               const AlignmentTarget& target, const AlignMapOptions& options);

}  // namespace tileflight::alignment
