#pragma once

#include <cstdint>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

/// Sorts points, with their normals, into an order that depends only on the points themselves: along a Morton curve
/// (Morton 1966, cells of 0.25 m from the frame's origin), within a cell by x, y, z, then normal. Points that were
/// sampled in parts and in any sequence thus give the same cloud. Drops all attributes but positions and normals. At
/// most 2^32 points.
void sort_by_position(PointCloud& cloud);

/// Cell count of a coarser grid for morton_order(): 16 bits an axis.
inline constexpr double kCoarseMortonCells = 65535.0;

/// Returns the number of the cell along a Morton curve that holds a point: 2^21 cells an axis from `low` on,
/// `cells_a_metre` each metre; points beyond lie in the outermost cells.
std::uint64_t morton_code(const Vec3& p, const Vec3& low, double cells_a_metre);

/// Returns the indices of the points along a Morton curve (Morton 1966) through their bounding box. Neighbours in the
/// list are neighbours in space, so queries or storage in this order are cache friendly. The points must be finite and
/// fewer than 2^32. `cells`: number of cells along the longest side, at most 2^21; points in one cell keep their input
/// order.
std::vector<std::uint32_t> morton_order(const std::vector<Vec3>& points, double cells = 2097152.0);

/// Returns morton_order() with equal points side by side: points in one cell are in the order of their coordinates,
/// equal ones in input order.
std::vector<std::uint32_t> morton_order_of_places(const std::vector<Vec3>& points);

/// Returns the indices of `count` points at even steps along morton_order(), in that order, so that each represents an
/// equal number of neighbours. Returns all points in input order if there are no more than `count`. Deterministic.
std::vector<std::uint32_t> sample_evenly(const std::vector<Vec3>& points, std::size_t count);

}  // namespace tileflight::geometry
