#include "tileflight/tiles/tileset/view_cone_tree.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>

namespace tileflight::tileset {
namespace {

using geometry::Box3;
using geometry::Vec3;

/// Tolerance for rounding of angles, and of earth-centred coordinates relative to the distance.
constexpr double kSlack_rad = 1e-9;
/// Tolerances of a group. They exceed all rounding errors of its members' tests, of which an angle from a cosine near 1
/// has the largest (2e-8).
constexpr double kGroupSlack_rad = 1e-6;
constexpr double kGroupSlack_m = 1e-6;
constexpr double kGroupSlackShare = 1e-9;
/// Cosine of the largest angle between the axes of a group that is divided by time: 30 degrees.
constexpr double kAlike = 0.866;
/// View cones that are tested one by one.
constexpr std::size_t kLeafSize = 4;

double angle_rad(const Vec3& a, const Vec3& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

ViewConeTree::Group group_of(const std::vector<ViewCone>& cones, std::span<const std::size_t> members) {
  Box3 positions;
  Vec3 axes = Vec3::Zero();
  for (const std::size_t i : members) {
    positions.extend(cones[i].position);
    axes += cones[i].axis;
  }
  ViewConeTree::Group group;
  group.around.position = positions.center();
  group.around.axis = axes.norm() > 0.0 ? axes.normalized() : Vec3::UnitZ();
  group.around.half_angle_rad = 0.0;
  bool is_finite = true;
  for (const std::size_t i : members) {
    const ViewCone& cone = cones[i];
    group.radius_m = std::max(group.radius_m, (cone.position - group.around.position).norm());
    group.around.half_angle_rad =
        std::max(group.around.half_angle_rad, angle_rad(group.around.axis, cone.axis) + cone.half_angle_rad);
    group.around.pixels_per_rad = std::max(group.around.pixels_per_rad, cone.pixels_per_rad);
    is_finite = is_finite && cone.position.allFinite() && cone.axis.allFinite();
  }
  // Cones that cannot be bounded are tested one by one.
  if (!is_finite) group.radius_m = group.around.half_angle_rad = INFINITY;
  group.around.half_angle_rad = std::min(std::numbers::pi, group.around.half_angle_rad + kGroupSlack_rad);
  return group;
}

}  // namespace

bool intersects_cone(const ViewCone& eye, const BoundingSphere& sphere) {
  const Vec3 offset = sphere.center - eye.position;
  const double distance_m = offset.norm();
  if (distance_m <= sphere.radius_m || eye.half_angle_rad >= std::numbers::pi) return true;
  const double off_axis_rad = std::acos(std::clamp(offset.dot(eye.axis) / distance_m, -1.0, 1.0));
  return off_axis_rad <= eye.half_angle_rad + std::asin(sphere.radius_m / distance_m) + kSlack_rad;
}

ViewConeTree::ViewConeTree(std::vector<ViewCone> cones) : cones_(std::move(cones)), order_(cones_.size()) {
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  if (!cones_.empty()) build(0, cones_.size());
}

void ViewConeTree::build(std::size_t begin, std::size_t end) {
  const std::size_t own = nodes_.size();
  const bool is_leaf = end - begin <= kLeafSize;
  // Members are ascending until the group is divided.
  nodes_.push_back({group_of(cones_, std::span(order_).subspan(begin, end - begin)), begin, end, order_[begin],
                    order_[end - 1], 0, is_leaf});
  if (!is_leaf) {
    const std::size_t middle = divide(begin, end);
    build(begin, middle);
    build(middle, end);
  }
  nodes_[own].next = nodes_.size();
}

/// Divides a group in two; returns where the second begins.
std::size_t ViewConeTree::divide(std::size_t begin, std::size_t end) {
  const auto members = std::span(order_).subspan(begin, end - begin);
  const auto farthest_from = [&](const Vec3& axis) -> const Vec3& {
    return cones_[*std::ranges::min_element(members, {}, [&](std::size_t i) { return axis.dot(cones_[i].axis); })].axis;
  };
  const Vec3 one = farthest_from(cones_[members.front()].axis), other = farthest_from(one);
  if (!(one.dot(other) < kAlike)) return begin + (end - begin) / 2;
  const auto second = std::stable_partition(members.begin(), members.end(), [&](std::size_t i) {
    return one.dot(cones_[i].axis) >= other.dot(cones_[i].axis);
  });
  const auto middle = static_cast<std::size_t>(second - members.begin());
  // Axes that are no numbers are nowhere.
  return middle == 0 || middle == members.size() ? begin + (end - begin) / 2 : begin + middle;
}

bool ViewConeTree::any_of(const ViewConeRange& range, const std::function<bool(const Group&)>& may_hold,
                          const std::function<bool(const ViewCone&)>& holds) const {
  for (std::size_t i = 0; i < nodes_.size();) {
    const Node& node = nodes_[i];
    if (node.first >= range.end || node.last < range.begin || !may_hold(node.group)) {
      i = node.next;
      continue;
    }
    for (std::size_t k = node.begin; node.is_leaf && k < node.end; ++k) {
      if (order_[k] >= range.begin && order_[k] < range.end && holds(cones_[order_[k]])) return true;
    }
    ++i;
  }
  return false;
}

// A sphere is seen from some point within r of the centre, in some direction, if and only if the sphere enlarged by r
// is seen from the centre in that direction.
bool may_intersect(const ViewConeTree::Group& group, const BoundingSphere& sphere) {
  const double radius_m = (sphere.radius_m + group.radius_m) * (1.0 + kGroupSlackShare) + kGroupSlack_m;
  return intersects_cone(group.around, {sphere.center, radius_m});
}

double least_distance_m(const ViewConeTree::Group& group, double distance_m) {
  return std::max(0.0, (distance_m - group.radius_m) * (1.0 - kGroupSlackShare) - kGroupSlack_m);
}

}  // namespace tileflight::tileset
