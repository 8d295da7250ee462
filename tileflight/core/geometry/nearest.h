#pragma once

#include <cstddef>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

struct Neighbor {
  std::size_t index = 0;  ///< into the points that the index was built from
  double distance_m = 0.0;
};

/// A place where one point or several equal points lie.
struct Place {
  std::size_t index = 0;  ///< of the first of the points, into those that the index was built from
  std::size_t count = 1;  ///< number of equal points
  double distance_m = 0.0;
};

/// Exact nearest neighbours among fixed points (k-d tree, nanoflann). Copies the points. Queries are const and may run
/// in parallel. On equal distances the lowest index wins, so that results do not depend on the tree. Equal points are
/// one in the tree: a map with a million points at its origin is searched as fast as any other.
class NearestIndex {
 public:
  explicit NearestIndex(const std::vector<Vec3>& points);
  ~NearestIndex();
  NearestIndex(NearestIndex&&) noexcept;
  NearestIndex& operator=(NearestIndex&&) noexcept;

  std::size_t size() const;

  /// Returns the nearest point within `radius_m` (inclusive); nullopt if there is none.
  std::optional<Neighbor> nearest(const Vec3& query, double radius_m = std::numeric_limits<double>::infinity()) const;
  /// Returns the `count` nearest points, nearest first (fewer if there are fewer points).
  std::vector<Neighbor> nearest_k(const Vec3& query, std::size_t count) const;
  /// Returns all points within the radius, nearest first.
  std::vector<Neighbor> within(const Vec3& query, double radius_m) const;
  /// Returns all places within the radius, nearest first: equal points are one place.
  std::vector<Place> places_within(const Vec3& query, double radius_m) const;
  /// Calls `visit` with the index of each point within the radius, in no particular order.
  void for_each_within(const Vec3& query, double radius_m, const std::function<void(std::size_t)>& visit) const;

 private:
  struct Tree;
  std::unique_ptr<Tree> tree_;
};

}  // namespace tileflight::geometry
