#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/voxel_grid.h"
#include "tileflight/world/ground_truth/brick_map.h"

namespace tileflight::ground_truth {

/// Returns the distance from each point to the nearest of geometry::centers(grid), metres, in the order of the points.
/// A point in an occupied cell is nearest to that cell's centre, so samples of the surface from which the grid was made
/// need no search. Throws InputError if no cell is occupied.
std::vector<double> center_distances(const std::vector<geometry::Vec3>& points, const geometry::VoxelGrid& grid);

/// Finds the nearest of the centres of a grid's occupied cells, bit-identical to geometry::NearestIndex. Points within
/// a cell and a half of a centre need no search in a tree; centres that lie on no grid are found by the tree alone.
/// Queries are const and may run in parallel.
class CenterIndex {
 public:
  /// Keeps a reference to the centres, which must outlive it. `edge_m`: edge of a cell.
  CenterIndex(const std::vector<geometry::Vec3>& centers, double edge_m);

  /// Returns the distance to the nearest centre within `radius_m` (inclusive), metres; nullopt if there is none.
  std::optional<double> nearest(const geometry::Vec3& query, double radius_m) const;

 private:
  bool add(const geometry::Vec3& center);
  std::optional<double> distance_to(const geometry::Cell& cell, const geometry::Vec3& query) const;
  std::optional<double> nearest_around(const geometry::Vec3& query) const;
  const geometry::NearestIndex& tree() const;

  const std::vector<geometry::Vec3>& centers_;
  double edge_m_;
  geometry::Vec3 low_ = geometry::Vec3::Zero();  ///< least coordinates of the centres
  bool on_grid_ = true;
  std::array<std::vector<double>, 3> coordinates_;  ///< along each axis, of the centres in each layer of cells
  BrickMap cells_;
  mutable std::once_flag tree_built_;
  mutable std::unique_ptr<geometry::NearestIndex> tree_;
};

}  // namespace tileflight::ground_truth
