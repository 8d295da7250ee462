#include "tileflight/world/scene/part_queries.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace tileflight::scene {

namespace {

/// The part's number as a child: it tells itself from pointers, whose lowest bits are 0, and from 0.
void* create_part_leaf(RTCThreadLocalAllocator, const RTCBuildPrimitive* boxes, std::size_t, void*) {
  return reinterpret_cast<void*>(static_cast<BeamNode::Child>(boxes->primID) << 2U | 2U);
}

}  // namespace

PartTree::PartTree(std::span<const Eigen::AlignedBox3f> boxes, DeviceHandle device)
    : device_(std::move(device)), memory_(rtcNewBVH(device_.get())) {
  if (!memory_) throw std::runtime_error("Embree: no memory for a tree");
  std::vector<RTCBuildPrimitive> primitives;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    if (boxes[i].isEmpty()) continue;
    const Eigen::Vector3f &low = boxes[i].min(), &high = boxes[i].max();
    primitives.push_back({low.x(), low.y(), low.z(), 0, high.x(), high.y(), high.z(), static_cast<std::uint32_t>(i)});
  }
  RTCBuildArguments arguments = rtcDefaultBuildArguments();
  arguments.maxLeafSize = 1;
  arguments.bvh = memory_.get();
  arguments.createLeaf = create_part_leaf;
  root_ = build_beam_nodes(arguments, primitives);
  if (root_ == 0) throw std::runtime_error("Embree: the tree of parts was not built; is there enough memory?");
}

namespace {

/// Bound on the rounding errors of a ray's entry into a box, relative to the largest coordinate.
constexpr float kSlabSlack = 4e-6F;
/// Surfaces at distances that differ by less than this share of them may be told in another order than their boxes.
constexpr float kReachSlack = 1e-5F;

std::vector<Eigen::AlignedBox3f> float_boxes(const std::vector<QueriedPart>& parts, const geometry::Vec3& anchor) {
  std::vector<Eigen::AlignedBox3f> boxes(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const geometry::Box3& box = parts[i].motion ? parts[i].motion->bounds() : parts[i].part->bounds();
    if (parts[i].part->triangle_count() == 0) continue;
    // Rounding keeps the order of numbers, so these are the bounds of the rounded corners, too.
    boxes[i].min() = (box.min() - anchor).cast<float>();
    boxes[i].max() = (box.max() - anchor).cast<float>();
  }
  return boxes;
}

float largest_box_coordinate(const std::vector<Eigen::AlignedBox3f>& boxes) {
  float largest = 0.0F;
  for (const Eigen::AlignedBox3f& box : boxes) {
    if (!box.isEmpty()) largest = std::max({largest, box.min().cwiseAbs().maxCoeff(), box.max().cwiseAbs().maxCoeff()});
  }
  return largest;
}

/// A ray, prepared for tests against boxes (Kay and Kajiya's slabs, 1986).
struct RaySlabs {
  float origin[3], inverse[3];  ///< finite, also for a direction of 0
  float slack_m;                ///< by which boxes are larger
  float near, far;              ///< in multiples of the direction's length

  RaySlabs() = default;
  RaySlabs(const float (&o)[3], const float (&d)[3], float slack, float from, float to)
      : slack_m(slack), near(from), far(to) {
    constexpr float kSmallest = 1e-18F;
    for (int axis = 0; axis < 3; ++axis) {
      origin[axis] = o[axis];
      inverse[axis] = 1.0F / (std::abs(d[axis]) < kSmallest ? std::copysign(kSmallest, d[axis]) : d[axis]);
    }
  }

  float reach() const { return far * (1.0F + kReachSlack); }

  /// Lowers `distance` to that of the entry where the ray meets the box.
  void lower(const BeamNode& node, float (&distance)[8]) const {
    float enter[8], leave[8];
    std::fill_n(enter, 8, near);
    std::fill_n(leave, 8, reach());
    for (int axis = 0; axis < 3; ++axis) {
      const bool upwards = inverse[axis] > 0.0F;
      const float* first = upwards ? node.low[axis] : node.high[axis];
      const float* last = upwards ? node.high[axis] : node.low[axis];
      const float outwards = upwards ? slack_m : -slack_m;
      for (int k = 0; k < 8; ++k) {
        enter[k] = std::max(enter[k], (first[k] - outwards - origin[axis]) * inverse[axis]);
        leave[k] = std::min(leave[k], (last[k] + outwards - origin[axis]) * inverse[axis]);
      }
    }
    for (int k = 0; k < 8; ++k) {
      if (enter[k] <= leave[k]) distance[k] = std::min(distance[k], enter[k]);
    }
  }
  void distances(const BeamNode& node, float (&distance)[8]) const {
    std::fill_n(distance, 8, std::numeric_limits<float>::infinity());
    lower(node, distance);
  }
};

RaySlabs ray_slabs(const RTCRay& ray, float slack_m) {
  return {{ray.org_x, ray.org_y, ray.org_z}, {ray.dir_x, ray.dir_y, ray.dir_z}, slack_m, ray.tnear, ray.tfar};
}

/// The enabled lanes of a packet.
struct PacketSlabs {
  int count = 0;
  std::array<int, RayPacket8::kLanes> lanes;
  std::array<RaySlabs, RayPacket8::kLanes> rays;

  float reach() const {
    float farthest = -RayPacket8::kInfinity;
    for (int i = 0; i < count; ++i) farthest = std::max(farthest, rays[i].reach());
    return farthest;
  }
  void distances(const BeamNode& node, float (&distance)[8]) const {
    std::fill_n(distance, 8, RayPacket8::kInfinity);
    for (int i = 0; i < count; ++i) rays[i].lower(node, distance);
  }
  /// Takes over the lanes' far limits.
  void update(const RayPacket8& packet) {
    for (int i = 0; i < count; ++i) rays[i].far = packet.far[lanes[i]];
  }
};

/// Whether a hit takes the place of the best so far: it is nearer, or as near and of an earlier mesh of the scene.
bool is_better(float far, std::uint32_t mesh, float best_far, std::uint32_t best_mesh) {
  if (best_mesh == RTC_INVALID_GEOMETRY_ID) return true;
  return far < best_far || (far == best_far && mesh < best_mesh);
}

void take_lane(const RayPacket8& from, int lane, std::uint32_t mesh, RayPacket8& to) {
  to.far[lane] = from.far[lane];
  to.normal_x[lane] = from.normal_x[lane];
  to.normal_y[lane] = from.normal_y[lane];
  to.normal_z[lane] = from.normal_z[lane];
  to.u[lane] = from.u[lane];
  to.v[lane] = from.v[lane];
  to.triangle[lane] = from.triangle[lane];
  to.mesh[lane] = mesh;
}

template <class SlackAt>
PacketSlabs packet_slabs(const RayPacket8& packet, const SlackAt& slack_at) {
  PacketSlabs slabs;
  for (int i = 0; i < RayPacket8::kLanes; ++i) {
    if (packet.far[i] < 0.0F) continue;
    const float o[3] = {packet.origin_x[i], packet.origin_y[i], packet.origin_z[i]};
    const float d[3] = {packet.direction_x[i], packet.direction_y[i], packet.direction_z[i]};
    slabs.lanes[slabs.count] = i;
    slabs.rays[slabs.count++] = RaySlabs(o, d, slack_at(o[0], o[1], o[2]), packet.near[i], packet.far[i]);
  }
  return slabs;
}

void to_part(const PartTransform& to, RTCRay& ray) {
  const Eigen::Vector3f origin = to.point_to_part({ray.org_x, ray.org_y, ray.org_z});
  const Eigen::Vector3f direction = to.part_scene * Eigen::Vector3f(ray.dir_x, ray.dir_y, ray.dir_z);
  ray.org_x = origin.x();
  ray.org_y = origin.y();
  ray.org_z = origin.z();
  ray.dir_x = direction.x();
  ray.dir_y = direction.y();
  ray.dir_z = direction.z();
}

void lane_to_part(const PartTransform& to, int i, RayPacket8& packet) {
  const Eigen::Vector3f origin = to.point_to_part({packet.origin_x[i], packet.origin_y[i], packet.origin_z[i]});
  const Eigen::Vector3f direction =
      to.part_scene * Eigen::Vector3f(packet.direction_x[i], packet.direction_y[i], packet.direction_z[i]);
  packet.origin_x[i] = origin.x();
  packet.origin_y[i] = origin.y();
  packet.origin_z[i] = origin.z();
  packet.direction_x[i] = direction.x();
  packet.direction_y[i] = direction.y();
  packet.direction_z[i] = direction.z();
}

void rotate_lane_normal(const PartTransform& to, RayPacket8& packet, int i) {
  const Eigen::Vector3f normal =
      to.normals * Eigen::Vector3f(packet.normal_x[i], packet.normal_y[i], packet.normal_z[i]);
  packet.normal_x[i] = normal.x();
  packet.normal_y[i] = normal.y();
  packet.normal_z[i] = normal.z();
}

/// The transforms of a packet's lanes to a part, each at its own time. Lanes of a row of pixels have the same.
class PacketTransforms {
 public:
  explicit PacketTransforms(const PartMotion* motion) : motion_(motion) {}

  void to_part(RayPacket8& packet) {
    if (motion_ == nullptr) return;
    for (int i = 0; i < RayPacket8::kLanes; ++i) lane_to_part(at(packet.time[i]), i, packet);
  }
  void rotate_normal(RayPacket8& packet, int lane) {
    if (motion_ != nullptr) rotate_lane_normal(at(packet.time[lane]), packet, lane);
  }

 private:
  const PartTransform& at(float time) {
    if (!is_set_ || time != time_) transform_ = motion_->transform(time);
    time_ = time;
    is_set_ = true;
    return transform_;
  }

  const PartMotion* motion_;
  bool is_set_ = false;
  float time_ = 0.0F;
  PartTransform transform_;
};

}  // namespace

PartQueries::PartQueries(std::vector<QueriedPart> parts, const SceneFrame& frame)
    : parts_(std::move(parts)),
      reach_m_(largest_box_coordinate(float_boxes(parts_, frame.anchor()))),
      tree_(float_boxes(parts_, frame.anchor()), frame.device()) {
  std::size_t next = 0;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    first_mesh_.push_back(static_cast<std::uint32_t>(next));
    next += parts_[i].part->meshes().size();
    if (!parts_[i].motion) {
      first_placed_mesh_ = static_cast<std::uint32_t>(next);
    } else {
      placed_.insert(placed_.end(), parts_[i].part->meshes().size(), static_cast<std::uint32_t>(i));
    }
  }
}

float PartQueries::slack_at(float x, float y, float z) const {
  return kSlabSlack * (reach_m_ + std::abs(x) + std::abs(y) + std::abs(z));
}

void PartQueries::intersect(RTCRayHit& query) const {
  RaySlabs slabs = ray_slabs(query.ray, slack_at(query.ray.org_x, query.ray.org_y, query.ray.org_z));
  tree_.visit_parts(slabs, [&](std::size_t part) {
    RTCRayHit found = query;
    found.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    if (parts_[part].motion) to_part(parts_[part].motion->transform(query.ray.time), found.ray);
    find_nearest(tree_of(part), found);
    if (found.hit.geomID == RTC_INVALID_GEOMETRY_ID) return true;
    found.hit.geomID += first_mesh_[part];
    if (!is_better(found.ray.tfar, found.hit.geomID, query.ray.tfar, query.hit.geomID)) return true;
    query.hit = found.hit;
    query.ray.tfar = found.ray.tfar;
    slabs.far = query.ray.tfar;
    return true;
  });
}

void PartQueries::test_occlusion(RTCRay& ray) const {
  const RaySlabs slabs = ray_slabs(ray, slack_at(ray.org_x, ray.org_y, ray.org_z));
  tree_.visit_parts(slabs, [&](std::size_t part) {
    RTCRay own = ray;
    if (parts_[part].motion) to_part(parts_[part].motion->transform(ray.time), own);
    find_any(tree_of(part), own);
    ray.tfar = own.tfar;
    return ray.tfar >= 0.0F;
  });
}

void PartQueries::intersect(RayPacket8& packet) const {
  PacketSlabs slabs = packet_slabs(packet, [this](float x, float y, float z) { return slack_at(x, y, z); });
  tree_.visit_parts(slabs, [&](std::size_t part) {
    RayPacket8 found = packet;
    std::fill_n(found.mesh, RayPacket8::kLanes, RayPacket8::kMiss);
    PacketTransforms transforms(parts_[part].motion.get());
    transforms.to_part(found);
    find_nearest(tree_of(part), reinterpret_cast<RTCRayHit8*>(&found));
    for (int i = 0; i < slabs.count; ++i) {
      const int lane = slabs.lanes[i];
      if (found.mesh[lane] == RayPacket8::kMiss) continue;
      const std::uint32_t mesh = found.mesh[lane] + first_mesh_[part];
      if (!is_better(found.far[lane], mesh, packet.far[lane], packet.mesh[lane])) continue;
      take_lane(found, lane, mesh, packet);
      transforms.rotate_normal(packet, lane);
    }
    slabs.update(packet);
    return true;
  });
}

void PartQueries::test_occlusion(RayPacket8& packet) const {
  PacketSlabs slabs = packet_slabs(packet, [this](float x, float y, float z) { return slack_at(x, y, z); });
  tree_.visit_parts(slabs, [&](std::size_t part) {
    RayPacket8 own = packet;
    PacketTransforms(parts_[part].motion.get()).to_part(own);
    find_any(tree_of(part), reinterpret_cast<RTCRay8*>(&own));
    std::copy_n(own.far, RayPacket8::kLanes, packet.far);
    slabs.update(packet);
    return true;
  });
}

bool PartQueries::intersect(std::span<RayPacket8> beam) const {
  if (!intersect_beam(tree_.root(), branches(), reach_m_, beam)) return false;
  if (!placed_.empty()) rotate_normals(beam);
  return true;
}

bool PartQueries::intersect_moving(std::span<const std::span<RayPacket8>> beams) const {
  if (!intersect_moving_beams(tree_.root(), branches(), reach_m_, beams)) return false;
  if (placed_.empty()) return true;
  for (const std::span<RayPacket8> beam : beams) rotate_normals(beam);
  return true;
}

/// Rotates the normals of hits on placed parts into the scene's frame.
void PartQueries::rotate_normals(std::span<RayPacket8> beam) const {
  for (RayPacket8& packet : beam) {
    for (int i = 0; i < RayPacket8::kLanes; ++i) {
      if (packet.mesh[i] == RayPacket8::kMiss || packet.mesh[i] < first_placed_mesh_) continue;
      const QueriedPart& part = parts_[placed_[packet.mesh[i] - first_placed_mesh_]];
      rotate_lane_normal(part.motion->transform(packet.time[i]), packet, i);
    }
  }
}

RTCScene PartQueries::tree_of(std::size_t part) const { return parts_[part].part->ray_tree().scene.get(); }

const std::vector<BeamBranch>& PartQueries::branches() const {
  return branches_.get([this] {
    std::vector<BeamBranch> branches(parts_.size());
    tbb::parallel_for(std::size_t{0}, parts_.size(), [&](std::size_t i) {
      const QueriedPart& part = parts_[i];
      if (part.part->triangle_count() == 0) return;
      const BeamTree& tree = part.part->beam_tree();
      branches[i] = {tree.root(), first_mesh_[i], part.motion.get(), tree.reach_m()};
    });
    return branches;
  });
}

}  // namespace tileflight::scene
