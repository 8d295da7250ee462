#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "tileflight/tiles/tileset/bounding_volume.h"
#include "tileflight/tiles/tileset/view_criteria.h"

namespace tileflight::tileset {

/// Returns whether the sphere (local frame) may intersect the view cone; never falsely negative.
bool intersects_cone(const ViewCone& eye, const BoundingSphere& sphere);

/// A hierarchy over the view cones of a flight, so that a query about all of them need not test each. Groups whose
/// members look into different directions are divided by direction (cameras of a rig, lines flown to and fro). Other
/// groups are divided by time, because consecutive frames see much the same.
class ViewConeTree {
 public:
  /// Bounds of a group of view cones.
  struct Group {
    ViewCone around;  ///< at the centre of the positions; contains the members' directions; the most pixels_per_rad
    double radius_m = 0.0;  ///< radius of a sphere around the centre that contains the positions
  };

  explicit ViewConeTree(std::vector<ViewCone> cones);

  const std::vector<ViewCone>& cones() const { return cones_; }

  /// Returns whether `holds` is true of any view cone of the range. `may_hold` of a group must be true if `holds` is
  /// true of any of its members; the result is then that of testing each.
  bool any_of(const ViewConeRange& range, const std::function<bool(const Group&)>& may_hold,
              const std::function<bool(const ViewCone&)>& holds) const;

 private:
  /// A node in depth-first order: its first child is the next one.
  struct Node {
    Group group;
    std::size_t begin = 0, end = 0;   ///< range of its members in order_
    std::size_t first = 0, last = 0;  ///< the members' least and greatest index
    std::size_t next = 0;             ///< node after all its descendants
    bool is_leaf = false;
  };

  void build(std::size_t begin, std::size_t end);
  std::size_t divide(std::size_t begin, std::size_t end);

  std::vector<ViewCone> cones_;
  std::vector<std::size_t> order_;
  std::vector<Node> nodes_;
};

/// Returns whether the sphere may intersect any view cone of the group; never falsely negative.
bool may_intersect(const ViewConeTree::Group& group, const BoundingSphere& sphere);

/// Returns a lower bound of the members' distances to a volume that is `distance_m` from the group's centre.
double least_distance_m(const ViewConeTree::Group& group, double distance_m);

}  // namespace tileflight::tileset
