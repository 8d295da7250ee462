#include "tileflight/world/ground_truth/center_distances.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <optional>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/nearest.h"
#include "tileflight/world/ground_truth/brick_map.h"

namespace tileflight::ground_truth {
namespace {

using geometry::Cell;
using geometry::Vec3;
using geometry::VoxelGrid;

constexpr double kUnknown = -1.0;

Cell cell_of(const VoxelGrid& grid, const Vec3& p) {
  // Clamped, since converting a number that no integer can hold is undefined.
  const Vec3 at = ((p - grid.origin) / grid.edge_m).array().floor().max(-8.0).min(BrickMap::kMaxCellsPerAxis + 8.0);
  return {static_cast<std::int32_t>(at.x()), static_cast<std::int32_t>(at.y()), static_cast<std::int32_t>(at.z())};
}

double distance_m(const VoxelGrid& grid, const Cell& cell, const Vec3& p) {
  const Vec3 d = p - geometry::center_by_equation(grid, cell);
  return std::sqrt(d.x() * d.x() + d.y() * d.y() + d.z() * d.z());
}

/// Searches the cells around points that arrive in sequence and mostly lie within one brick.
class CellFinder {
 public:
  CellFinder(const VoxelGrid& grid, const BrickMap& cells) : grid_(grid), cells_(cells) {}

  /// kUnknown if neither the point's own cell nor its neighbours decide it.
  double distance_m(const Vec3& p) {
    const Cell own = cell_of(grid_, p);
    if (contains(own)) return ground_truth::distance_m(grid_, own, p);
    double least_m = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 27; ++i) {
      const Cell near{own.x + i % 3 - 1, own.y + i / 3 % 3 - 1, own.z + i / 9 - 1};
      if (contains(near)) least_m = std::min(least_m, ground_truth::distance_m(grid_, near, p));
    }
    // The centres of all other cells are at least one and a half cells away along some axis.
    constexpr double kSafe = 1.5 - 1e-6;
    return least_m < kSafe * grid_.edge_m ? least_m : kUnknown;
  }

 private:
  bool contains(const Cell& cell) {
    const Cell brick{cell.x >> 3, cell.y >> 3, cell.z >> 3};
    if (brick != last_) {
      last_ = brick;
      found_ = cells_.find(cell);
    }
    return found_ != nullptr && BrickMap::brick_contains(*found_, cell);
  }

  const VoxelGrid& grid_;
  const BrickMap& cells_;
  Cell last_{std::numeric_limits<std::int32_t>::min(), 0, 0};  ///< a cell of no brick
  const BrickMap::Brick* found_ = nullptr;
};

}  // namespace

std::vector<double> center_distances(const std::vector<Vec3>& points, const VoxelGrid& grid) {
  if (grid.occupied.empty())
    throw InputError("voxels", "no voxel is occupied; there is nothing to measure distances to");
  BrickMap cells;
  for (const Cell& c : grid.occupied) cells.insert(c.x, c.y, c.z);
  std::vector<double> distances(points.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 4096), [&](const auto& range) {
    CellFinder finder(grid, cells);
    for (std::size_t i = range.begin(); i < range.end(); ++i) distances[i] = finder.distance_m(points[i]);
  });
  std::optional<geometry::NearestIndex> all;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (distances[i] != kUnknown) continue;
    if (!all) all.emplace(geometry::cell_centers(grid).positions);
    distances[i] = all->nearest(points[i])->distance_m;
  }
  return distances;
}

}  // namespace tileflight::ground_truth
