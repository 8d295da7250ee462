#include "tileflight/core/alignment/matcher.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <nanoflann.hpp>

#include "tileflight/core/geometry/point_order.h"

namespace tileflight::alignment {

using geometry::Vec3;

namespace {

/// nanoflann's adaptor for the target points.
struct Points {
  const std::vector<Vec3>* positions;

  std::size_t kdtree_get_point_count() const { return positions->size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return (*positions)[i][static_cast<Eigen::Index>(axis)];
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

/// The two nearest points within a radius, for nanoflann's search.
class TwoNearest {
 public:
  using DistanceType = double;

  explicit TwoNearest(double squared_radius) : first_(squared_radius), second_(squared_radius) {}

  bool addPoint(double squared, std::uint32_t index) {
    if (squared < first_ || (squared == first_ && index < index_)) {
      second_ = first_;
      first_ = squared;
      index_ = index;
    } else if (squared < second_) {
      second_ = squared;
    }
    return true;
  }
  /// Slightly more, so that of equally distant points the one of the lowest index is met in every tree.
  double worstDist() const { return second_ * (1.0 + 1e-9) + std::numeric_limits<double>::min(); }
  bool full() const { return true; }
  void sort() {}

  std::uint32_t index() const { return index_; }
  double second() const { return second_; }

 private:
  double first_;
  double second_;
  std::uint32_t index_ = 0xffffffffu;
};

}  // namespace

struct CloudMatcher::Tree {
  using Index =
      nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Points>, Points, 3, std::uint32_t>;

  explicit Tree(const std::vector<Vec3>& positions) : points{&positions}, index(3, points, {10}) {}

  Points points;
  Index index;
};

CloudMatcher::CloudMatcher(const geometry::PointCloud& target, const Vec3& shift, std::size_t source_points,
                           double radius_m)
    : cache_(source_points), radius_m_(radius_m) {
  target_.reserve(target.size());
  normals_.reserve(target.normals.size());
  for (const std::uint32_t i : geometry::morton_order(target.positions, geometry::kCoarseMortonCells)) {
    target_.push_back(target.positions[i] - shift);
    if (!target.normals.empty()) normals_.push_back(target.normals[i].cast<double>().normalized());
  }
  tree_ = std::make_unique<Tree>(target_);
}

CloudMatcher::~CloudMatcher() = default;
CloudMatcher::CloudMatcher(CloudMatcher&&) noexcept = default;
CloudMatcher& CloudMatcher::operator=(CloudMatcher&&) noexcept = default;

void CloudMatcher::search(const Vec3& position, CachedMatch& memory) const {
  // Searching beyond the radius costs little and shows how far an unmatched point may move before it must be searched
  // again.
  const double reach = 1.5 * radius_m_;
  TwoNearest nearest(reach * reach);
  tree_->index.findNeighbors(nearest, position.data(), {});
  memory.position = position;
  memory.nearest = nearest.index();
  memory.others_m = std::sqrt(nearest.second());
}

bool CloudMatcher::find(std::size_t i, const Vec3& position, Match& match) {
  CachedMatch& memory = cache_[i];
  const double others_m = memory.others_m - (position - memory.position).norm();  // triangle inequality
  const bool known = memory.nearest != kNoNeighbor ? (position - target_[memory.nearest]).norm() < others_m  //
                                                   : others_m > radius_m_;
  if (!known) search(position, memory);
  if (memory.nearest == kNoNeighbor) return false;

  match.point = target_[memory.nearest];
  match.distance_m = (position - match.point).norm();
  if (!normals_.empty()) match.normal = normals_[memory.nearest];
  return match.distance_m <= radius_m_;
}

MeshMatcher::MeshMatcher(const geometry::TriangleIndex& index, const geometry::TriangleMesh& mesh, const Vec3& shift,
                         std::size_t source_points, double radius_m)
    : index_(&index), mesh_(&mesh), shift_(shift), cache_(source_points), radius_m_(radius_m) {}

bool MeshMatcher::find(std::size_t i, const Vec3& position, Match& match) {
  CachedMatch& memory = cache_[i];
  if (!memory.found && memory.empty_m - (position - memory.position).norm() > radius_m_) return false;

  double bound = 1.5 * radius_m_;
  const auto surface_at = [&](const Vec3& p) { bound = std::min(bound, (position - p).norm() * (1.0 + 1e-9) + 1e-12); };
  if (memory.found) {
    surface_at(memory.nearest);
  } else if (match.triangle != Match::kNoTriangle) {
    surface_at(match.point);
  }
  const auto hit = index_->nearest(position + shift_, bound);
  memory.position = position;
  memory.found = hit.has_value();
  if (!hit) {
    memory.empty_m = bound;
    return false;
  }
  memory.nearest = hit->position - shift_;
  match.triangle = hit->triangle;
  match.point = memory.nearest;
  match.distance_m = hit->distance_m;
  constexpr double kOnSurface_m = 1e-9;
  match.normal =
      match.distance_m > kOnSurface_m ? Vec3((position - match.point).normalized()) : triangle_normal(hit->triangle);
  return match.distance_m <= radius_m_;
}

Vec3 MeshMatcher::triangle_normal(std::size_t triangle) const {
  const auto& [a, b, c] = mesh_->triangles[triangle];
  const Vec3& origin = mesh_->vertices[a];
  const Vec3 normal = (mesh_->vertices[b] - origin).cross(mesh_->vertices[c] - origin);
  const double length = normal.norm();
  return length > 0.0 ? Vec3(normal / length) : Vec3::Zero();
}

}  // namespace tileflight::alignment
