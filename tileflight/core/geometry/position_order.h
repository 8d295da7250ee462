#pragma once

#include "tileflight/core/geometry/point_cloud.h"

namespace tileflight::geometry {

/// Sorts points, with their normals, into an order that depends on nothing but the points themselves: neighbours are
/// near each other (Morton 1966, cells of 0.25 m from the frame's origin), points of one cell by x, y, z, then normal.
/// The same points sampled in parts, and in whatever sequence, are the same cloud afterwards. Only positions and
/// normals are kept. At most 2^32 points.
void sort_by_position(PointCloud& cloud);

}  // namespace tileflight::geometry
