#include "tileflight/core/geometry/nearest.h"

#include <algorithm>
#include <cmath>
#include <nanoflann.hpp>
#include <numeric>
#include <span>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/point_order.h"

namespace tileflight::geometry {
namespace {

/// The points in the form required by nanoflann, sorted so that neighbours are adjacent in memory: building the tree
/// takes half the time, and searches are cache friendly. Equal points are one: no search can tell them apart, so that
/// each would have to visit all of them.
struct PointsAdaptor {
  std::vector<Vec3> points;
  std::vector<std::uint32_t> number;  ///< indices in the input, those of equal points side by side, lowest first
  std::vector<std::uint32_t> first;   ///< for each point, its first in `number`; empty if no two points are equal

  /// Indices in the input of the points at a place.
  std::span<const std::uint32_t> numbers(std::uint32_t place) const {
    if (first.empty()) return {&number[place], 1};
    const std::size_t end = place + 1 < first.size() ? first[place + 1] : number.size();
    return {&number[first[place]], end - first[place]};
  }

  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t index, std::size_t axis) const { return points[index][static_cast<int>(axis)]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using KdTree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, PointsAdaptor>, PointsAdaptor,
                                                   3, std::uint32_t>;

/// Squared distance, then index: an order of neighbours that does not depend on the tree.
using Candidate = std::pair<double, std::uint32_t>;
constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// Search radius of the tree, slightly above `distance2`: equally distant points must be visited so that the lowest
/// index can win, and the tree's own bounds carry rounding errors. The exact test is done here.
double search_bound(double distance2) { return distance2 * (1.0 + 1e-9) + std::numeric_limits<double>::min(); }

/// nanoflann result set: the best candidate.
class NearestResultSet {
 public:
  using DistanceType = double;

  NearestResultSet(const PointsAdaptor& points, double radius2) : points_(points), best_(radius2, kNone) {}
  bool full() const { return true; }
  void sort() {}
  double worstDist() const { return search_bound(best_.first); }
  bool addPoint(double distance2, std::uint32_t place) {
    if (distance2 <= best_.first) best_ = std::min(best_, Candidate(distance2, points_.numbers(place).front()));
    return true;
  }
  bool found() const { return best_.second != kNone; }
  const Candidate& best() const { return best_; }

 private:
  const PointsAdaptor& points_;
  Candidate best_;
};

/// nanoflann result set: the `count` best candidates, as a heap with the worst on top.
class KnnResultSet {
 public:
  using DistanceType = double;

  KnnResultSet(const PointsAdaptor& points, std::size_t count) : points_(points), count_(count) {
    heap_.reserve(count + 1);
  }
  bool full() const { return heap_.size() == count_; }
  void sort() {}
  double worstDist() const {
    return full() ? search_bound(heap_.front().first) : std::numeric_limits<double>::infinity();
  }
  bool addPoint(double distance2, std::uint32_t place) {
    for (const std::uint32_t number : points_.numbers(place)) {
      const Candidate candidate(distance2, number);
      if (full() && !(candidate < heap_.front())) break;
      heap_.push_back(candidate);
      std::push_heap(heap_.begin(), heap_.end());
      if (heap_.size() > count_) {
        std::pop_heap(heap_.begin(), heap_.end());
        heap_.pop_back();
      }
    }
    return true;
  }
  std::vector<Candidate>& candidates() { return heap_; }

 private:
  const PointsAdaptor& points_;
  std::size_t count_;
  std::vector<Candidate> heap_;
};

/// nanoflann result set: `visit` is told squared distance and number of every place within a radius.
template <class Visit>
class RadiusVisitor {
 public:
  using DistanceType = double;

  RadiusVisitor(double radius2, const Visit& visit) : radius2_(radius2), visit_(visit) {}
  bool full() const { return true; }
  void sort() {}
  double worstDist() const { return search_bound(radius2_); }
  bool addPoint(double distance2, std::uint32_t place) {
    if (distance2 <= radius2_) visit_(distance2, place);
    return true;
  }

 private:
  double radius2_;
  const Visit& visit_;
};

std::vector<Neighbor> sorted_neighbors(std::vector<Candidate>& candidates) {
  std::sort(candidates.begin(), candidates.end());
  std::vector<Neighbor> neighbors;
  neighbors.reserve(candidates.size());
  for (const auto& [distance2, index] : candidates) neighbors.push_back({index, std::sqrt(distance2)});
  return neighbors;
}

PointsAdaptor in_order(const std::vector<Vec3>& points) {
  if (points.size() >= kNone) throw InputError("points", "there are more than the supported 4 billion");
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) throw InputError("point " + std::to_string(i), "a coordinate is not finite");
  }
  PointsAdaptor result{{}, morton_order_of_places(points), {}};
  result.points.reserve(points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const Vec3& p = points[result.number[k]];
    const bool equal = k > 0 && p == result.points.back();
    if (equal && result.first.empty()) {  // until now each was alone at its place
      result.first.resize(k);
      std::iota(result.first.begin(), result.first.end(), 0U);
    }
    if (equal) continue;
    if (!result.first.empty()) result.first.push_back(static_cast<std::uint32_t>(k));
    result.points.push_back(p);
  }
  return result;
}

}  // namespace

struct NearestIndex::Tree {
  explicit Tree(const std::vector<Vec3>& positions)
      : points(in_order(positions)), index(3, points, nanoflann::KDTreeSingleIndexAdaptorParams(kLeafSize)) {}

  template <class Visit>
  void visit_within(const Vec3& query, double radius_m, const Visit& visit) const {
    if (points.points.empty() || !query.allFinite() || !(radius_m >= 0.0)) return;
    RadiusVisitor visitor(radius_m * radius_m, visit);
    index.findNeighbors(visitor, query.data(), {});
  }

  static constexpr std::size_t kLeafSize = 10;
  PointsAdaptor points;
  KdTree index;
};

NearestIndex::NearestIndex(const std::vector<Vec3>& points) : tree_(std::make_unique<Tree>(points)) {}
NearestIndex::~NearestIndex() = default;
NearestIndex::NearestIndex(NearestIndex&&) noexcept = default;
NearestIndex& NearestIndex::operator=(NearestIndex&&) noexcept = default;

std::size_t NearestIndex::size() const { return tree_->points.number.size(); }

std::optional<Neighbor> NearestIndex::nearest(const Vec3& query, double radius_m) const {
  if (size() == 0 || !query.allFinite() || !(radius_m >= 0.0)) return std::nullopt;
  NearestResultSet best(tree_->points, radius_m * radius_m);
  tree_->index.findNeighbors(best, query.data(), {});
  if (!best.found()) return std::nullopt;
  return Neighbor{best.best().second, std::sqrt(best.best().first)};
}

std::vector<Neighbor> NearestIndex::nearest_k(const Vec3& query, std::size_t count) const {
  count = std::min(count, size());
  if (count == 0 || !query.allFinite()) return {};
  KnnResultSet best(tree_->points, count);
  tree_->index.findNeighbors(best, query.data(), {});
  return sorted_neighbors(best.candidates());
}

std::vector<Neighbor> NearestIndex::within(const Vec3& query, double radius_m) const {
  std::vector<Candidate> found;
  tree_->visit_within(query, radius_m, [&](double distance2, std::uint32_t place) {
    for (const std::uint32_t number : tree_->points.numbers(place)) found.emplace_back(distance2, number);
  });
  return sorted_neighbors(found);
}

std::vector<Place> NearestIndex::places_within(const Vec3& query, double radius_m) const {
  std::vector<std::pair<Candidate, std::size_t>> found;  // and how many points
  tree_->visit_within(query, radius_m, [&](double distance2, std::uint32_t place) {
    const auto numbers = tree_->points.numbers(place);
    found.emplace_back(Candidate(distance2, numbers.front()), numbers.size());
  });
  std::ranges::sort(found);
  std::vector<Place> places;
  places.reserve(found.size());
  for (const auto& [nearest, count] : found) places.push_back({nearest.second, count, std::sqrt(nearest.first)});
  return places;
}

void NearestIndex::for_each_within(const Vec3& query, double radius_m,
                                   const std::function<void(std::size_t)>& visit) const {
  tree_->visit_within(query, radius_m, [&](double, std::uint32_t place) {
    for (const std::uint32_t number : tree_->points.numbers(place)) visit(number);
  });
}

}  // namespace tileflight::geometry
