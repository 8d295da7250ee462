#include "tileflight/world/ground_truth/center_index.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
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

namespace {

using geometry::Cell;
using geometry::Vec3;

constexpr double kNotYet = std::numeric_limits<double>::quiet_NaN();
/// Tolerance in cells, larger than rounding errors.
constexpr double kSlack = 1e-6;
/// Layers along an axis for which coordinates are kept.
constexpr double kMostLayers = 4194304.0;

}  // namespace

CenterIndex::CenterIndex(const std::vector<Vec3>& centers, double edge_m) : centers_(centers), edge_m_(edge_m) {
  low_ = Vec3::Constant(std::numeric_limits<double>::infinity());
  for (const Vec3& center : centers) low_ = low_.cwiseMin(center);
  on_grid_ =
      edge_m > 0.0 && std::isfinite(edge_m) && std::ranges::all_of(centers, [&](const Vec3& c) { return add(c); });
}

/// False if it does not lie on the grid of those before.
bool CenterIndex::add(const Vec3& center) {
  std::array<std::int32_t, 3> cell{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    const double layers = (center[a] - low_[a]) / edge_m_, layer = std::round(layers);
    if (!(layer < kMostLayers) || std::abs(layers - layer) > kSlack) return false;
    cell[axis] = static_cast<std::int32_t>(layer);
    std::vector<double>& known = coordinates_[axis];
    if (known.size() <= static_cast<std::size_t>(cell[axis]))
      known.resize(static_cast<std::size_t>(cell[axis]) + 1, kNotYet);
    double& coordinate = known[static_cast<std::size_t>(cell[axis])];
    if (std::isnan(coordinate)) coordinate = center[a];
    if (coordinate != center[a]) return false;
  }
  cells_.insert(cell[0], cell[1], cell[2]);
  return true;
}

std::optional<double> CenterIndex::distance_to(const Cell& cell, const Vec3& query) const {
  if (!cells_.contains(cell)) return std::nullopt;
  const double x = query.x() - coordinates_[0][static_cast<std::size_t>(cell.x)];
  const double y = query.y() - coordinates_[1][static_cast<std::size_t>(cell.y)];
  const double z = query.z() - coordinates_[2][static_cast<std::size_t>(cell.z)];
  return std::sqrt(x * x + y * y + z * z);
}

/// nullopt if the cells around the query do not decide it.
std::optional<double> CenterIndex::nearest_around(const Vec3& query) const {
  const Vec3 at = (query - low_) / edge_m_;
  if (!(at.array() > -8.0).all() || !(at.array() < kMostLayers + 8.0).all()) return std::nullopt;
  const Vec3 layer = at.array().round();
  const Cell own{static_cast<std::int32_t>(layer.x()), static_cast<std::int32_t>(layer.y()),
                 static_cast<std::int32_t>(layer.z())};
  // Well inside its cell, a point is nearer to that cell's centre along each axis than to any other layer.
  if (((at - layer).array().abs() < 0.5 - kSlack).all()) {
    if (const auto found = distance_to(own, query)) return found;
  }
  double least_m = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 27; ++i) {
    const auto found = distance_to({own.x + i % 3 - 1, own.y + i / 3 % 3 - 1, own.z + i / 9 - 1}, query);
    least_m = std::min(least_m, found.value_or(least_m));
  }
  // All other centres are at least one and a half cells away along some axis.
  return least_m < (1.5 - kSlack) * edge_m_ ? std::optional(least_m) : std::nullopt;
}

const geometry::NearestIndex& CenterIndex::tree() const {
  std::call_once(tree_built_, [&] { tree_ = std::make_unique<geometry::NearestIndex>(centers_); });
  return *tree_;
}

std::optional<double> CenterIndex::nearest(const Vec3& query, double radius_m) const {
  if (on_grid_) {
    if (const auto found = nearest_around(query)) return *found <= radius_m ? found : std::nullopt;
  }
  const auto found = tree().nearest(query, radius_m);
  return found ? std::optional(found->distance_m) : std::nullopt;
}

}  // namespace tileflight::ground_truth
