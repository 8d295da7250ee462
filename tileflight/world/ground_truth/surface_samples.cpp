#include "tileflight/world/ground_truth/surface_samples.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <span>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/core/geometry/point_order.h"

namespace tileflight::ground_truth {
namespace {

using geometry::Box3;
using geometry::PointCloud;
using geometry::TriangleMesh;
using geometry::Vec3;

/// Upper limit of samples: 48 bytes each.
constexpr double kMaxPoints = 5e8;

/// A number in [0, 1) that depends only on (seed, index).
double uniform(std::uint64_t seed, std::uint64_t index) {
  const std::uint64_t bits = base::splitmix64_hash(seed * 0xD1B54A32D192ED03U + index * base::kSplitMixStep);
  return static_cast<double>(bits >> 11) * 0x1p-53;
}

/// A convex polygon of at most nine corners: a triangle clipped by the six faces of a box.
struct Polygon {
  std::array<Vec3, 9> corners;
  std::size_t size = 0;

  void add(const Vec3& p) { corners[size++] = p; }
};

/// The part where sign * (p[axis] - at) >= 0 (Sutherland and Hodgman 1974).
Polygon clip_by_plane(const Polygon& polygon, int axis, double at, double sign) {
  Polygon clipped;
  for (std::size_t i = 0; i < polygon.size; ++i) {
    const Vec3& p = polygon.corners[i];
    const Vec3& q = polygon.corners[(i + 1) % polygon.size];
    const double depth_p = sign * (p[axis] - at);
    const double depth_q = sign * (q[axis] - at);
    if (depth_p >= 0.0) clipped.add(p);
    if ((depth_p >= 0.0) != (depth_q >= 0.0)) clipped.add(p + depth_p / (depth_p - depth_q) * (q - p));
  }
  return clipped;
}

Polygon clip_to_box(const Vec3& a, const Vec3& b, const Vec3& c, const Box3& box) {
  Polygon polygon;
  for (const Vec3& p : {a, b, c}) polygon.add(p);
  for (int axis = 0; axis < 3; ++axis) {
    polygon = clip_by_plane(polygon, axis, box.min()[axis], 1.0);
    polygon = clip_by_plane(polygon, axis, box.max()[axis], -1.0);
  }
  return polygon;
}

/// A number that depends only on the seed and the triangle's corners: the triangle gets the same samples in whatever
/// part of a mesh, and with whatever neighbours, it is met.
std::uint64_t triangle_seed(std::uint64_t seed, const std::array<Vec3, 3>& corners) {
  std::uint64_t hash = base::splitmix64_hash(seed);
  for (const Vec3& corner : corners) {
    for (int axis = 0; axis < 3; ++axis)
      hash = base::splitmix64_hash(hash ^ std::bit_cast<std::uint64_t>(corner[axis]));
  }
  return hash;
}

/// Places samples along the area of one triangle: one in each interval of 1 / per_m2 square metres, of which the first
/// begins at a random place before the triangle's area, so that small triangles get their share on average.
class TriangleSampler {
 public:
  TriangleSampler(double per_m2, std::uint64_t seed) : per_m2_(per_m2), seed_(seed), phase_(uniform(seed, 0)) {
    draw_next();
  }

  /// Samples the next piece of the triangle's area, an interval of the whole; calls add(point).
  template <typename Add>
  void sample(const Vec3& a, const Vec3& b, const Vec3& c, const Add& add) {
    const double area_m2 = 0.5 * (b - a).cross(c - a).norm();
    for (; next_m2_ < done_m2_ + area_m2; ++interval_, draw_next()) {
      if (next_m2_ < done_m2_) continue;
      // The position within the piece's area replaces one of the two random numbers, which keeps samples of one
      // triangle apart.
      const double r = std::sqrt((next_m2_ - done_m2_) / area_m2);
      const double s = uniform(seed_, 2 * interval_ + 2);
      add((1.0 - r) * a + r * ((1.0 - s) * b + s * c));
    }
    done_m2_ += area_m2;
  }

 private:
  void draw_next() {
    next_m2_ = (static_cast<double>(interval_) - phase_ + uniform(seed_, 2 * interval_ + 1)) / per_m2_;
  }

  double per_m2_;
  std::uint64_t seed_;
  double phase_;  ///< share of the first interval that lies before the triangle's area
  std::uint64_t interval_ = 0;
  double done_m2_ = 0.0;  ///< area of the pieces so far
  double next_m2_ = 0.0;  ///< area at which the interval's sample lies
};

/// Samples of a run of triangles.
class RunSampler {
 public:
  RunSampler(const Box3& box, const Box3& part, const SampleFilter& wanted, double per_m2, std::uint64_t seed)
      : box_(box), part_(part), wanted_(wanted), per_m2_(per_m2), seed_(seed) {}

  void add(const std::array<Vec3, 3>& corners) {
    const auto& [a, b, c] = corners;
    Box3 around(a);
    around.extend(b).extend(c);
    if (!box_.intersects(around) || !part_.intersects(around)) return;
    const Vec3 normal = (b - a).cross(c - a);
    if (!(normal.norm() > 0.0)) return;
    const Eigen::Vector3f unit = normal.normalized().cast<float>();
    const Polygon polygon = clip_to_box(a, b, c, box_);
    TriangleSampler sampler(per_m2_, triangle_seed(seed_, corners));
    for (std::size_t i = 2; i < polygon.size; ++i) {
      const auto& p = polygon.corners;
      sampler.sample(p[0], p[i - 1], p[i], [&](const Vec3& point) {
        if (wanted_ && !wanted_(point)) return;
        cloud_.positions.push_back(point);
        cloud_.normals.push_back(unit);
      });
    }
  }

  PointCloud take() { return std::move(cloud_); }

 private:
  const Box3& box_;
  const Box3& part_;
  const SampleFilter& wanted_;
  double per_m2_;
  std::uint64_t seed_;
  PointCloud cloud_;
};

void check_samples(const TriangleMesh& mesh, const Box3& box, double per_m2) {
  if (!(per_m2 > 0.0) || !std::isfinite(per_m2)) {
    throw InputError("samples per square metre " + std::to_string(per_m2), "must be a number above zero");
  }
  if (box.isEmpty()) throw InputError("region", "is empty: give a box with sides above zero");
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices[i].allFinite()) throw InputError("vertex " + std::to_string(i), "is not finite");
  }
}

/// Tests whether a point is visible from a camera pose.
class VisibilityTester {
 public:
  VisibilityTester(const scene::Scene& scene, const geometry::Trajectory& poses, const imaging::Camera& camera,
                   double max_range_m, double tolerance_m)
      : scene_(scene), camera_(camera), max_range_m_(max_range_m), tolerance_m_(tolerance_m) {
    for (const auto& pose : poses.poses) T_camera_local_.push_back(pose.T_local_camera.inverse());
    for (const auto& pose : poses.poses) centers_.push_back(pose.T_local_camera.translation);
    // Slightly wider than the image: only avoids the full projection.
    widest_rad_ = std::min(std::numbers::pi, 1.02 * camera.max_image_angle_rad() + 0.01);
    cos_widest_ = std::cos(widest_rad_);
  }

  /// The poses from which part of a sphere may be visible, in order: the sphere is within range and intersects the cone
  /// around the lens's view.
  std::vector<std::uint32_t> candidate_poses(const Vec3& middle, double radius_m) const {
    constexpr double kSlack = 1e-6;  // of angle and distance, larger than any rounding error
    std::vector<std::uint32_t> poses;
    for (std::size_t k = 0; k < centers_.size(); ++k) {
      const Vec3 offset = middle - centers_[k];
      const double distance_m = offset.norm();
      if (distance_m > max_range_m_ + radius_m + kSlack) continue;
      const bool inside = distance_m <= radius_m;
      const double cosine = (T_camera_local_[k].rotation * offset).z() / std::max(distance_m, 1e-9);
      const double nearest_rad = std::acos(std::clamp(cosine, -1.0, 1.0)) -
                                 (inside ? std::numbers::pi : std::asin(std::min(1.0, radius_m / distance_m)));
      if (nearest_rad <= widest_rad_ + kSlack) poses.push_back(static_cast<std::uint32_t>(k));
    }
    return poses;
  }

  bool is_visible(std::size_t pose, const Vec3& point) const {
    const Vec3 offset = point - centers_[pose];
    const double distance_m = offset.norm();
    if (!(distance_m < max_range_m_)) return false;
    const Vec3 point_camera = T_camera_local_[pose].rotation * offset;
    if (point_camera.z() < cos_widest_ * distance_m || !in_image(point_camera)) return false;
    const double free_m = distance_m - tolerance_m_;
    return free_m <= 0.0 || !scene_.is_occluded({centers_[pose], offset / distance_m}, free_m);
  }

 private:
  bool in_image(const Vec3& point_camera) const {
    const auto pixel = camera_.project(point_camera);
    return pixel && pixel->x() >= -0.5 && pixel->y() >= -0.5 && pixel->x() < camera_.width() - 0.5 &&
           pixel->y() < camera_.height() - 0.5;
  }

  const scene::Scene& scene_;
  const imaging::Camera& camera_;
  double max_range_m_, tolerance_m_;
  double widest_rad_ = std::numbers::pi, cos_widest_ = -1.0;
  std::vector<geometry::SE3> T_camera_local_;
  std::vector<Vec3> centers_;
};

/// Throws InputError if a mesh's part would get more samples than are supported.
void require_few_samples(const TriangleMesh& mesh, const Box3& part, double per_m2) {
  if (area_within(mesh, part) * per_m2 <= kMaxPoints) return;
  throw InputError("samples per square metre " + std::to_string(per_m2),
                   "would give more than 500 million points: choose fewer (--samples), or a smaller region");
}

}  // namespace

double area_within(const TriangleMesh& mesh, const Box3& box) {
  double area_m2 = 0.0;
  for (const geometry::Triangle& t : mesh.triangles) {
    const Vec3 &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
    Box3 around(a);
    around.extend(b).extend(c);
    if (!box.intersects(around)) continue;
    const Polygon polygon = box.contains(around) ? Polygon{{a, b, c}, 3} : clip_to_box(a, b, c, box);
    for (std::size_t i = 2; i < polygon.size; ++i) {
      const auto& p = polygon.corners;
      area_m2 += 0.5 * (p[i - 1] - p[0]).cross(p[i] - p[0]).norm();
    }
  }
  return area_m2;
}

PointCloud sample_surface(const TriangleMesh& mesh, const Box3& box, double per_m2, std::uint64_t seed) {
  return sample_surface_near(mesh, box, box, per_m2, seed);
}

PointCloud sample_surface_near(const TriangleMesh& mesh, const Box3& box, const Box3& part, double per_m2,
                               std::uint64_t seed, const SampleFilter& wanted) {
  check_samples(mesh, box, per_m2);
  require_few_samples(mesh, box.intersection(part), per_m2);
  constexpr std::size_t kTogether = 8192;
  std::vector<PointCloud> runs((mesh.triangles.size() + kTogether - 1) / kTogether);
  tbb::parallel_for(std::size_t{0}, runs.size(), [&](std::size_t run) {
    RunSampler sampler(box, part, wanted, per_m2, seed);
    const std::size_t end = std::min(mesh.triangles.size(), (run + 1) * kTogether);
    for (std::size_t i = run * kTogether; i < end; ++i) {
      const geometry::Triangle& t = mesh.triangles[i];
      sampler.add({mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]});
    }
    runs[run] = sampler.take();
  });
  PointCloud cloud;
  for (PointCloud& run : runs) {
    cloud.positions.insert(cloud.positions.end(), run.positions.begin(), run.positions.end());
    cloud.normals.insert(cloud.normals.end(), run.normals.begin(), run.normals.end());
    run = {};
  }
  geometry::sort_by_position(cloud);
  return cloud;
}

Box3 view_range_bounds(const geometry::Trajectory& poses, double max_range_m) {
  Box3 box;
  for (const auto& pose : poses.poses) box.extend(pose.T_local_camera.translation);
  if (box.isEmpty()) return box;
  return {box.min() - Vec3::Constant(max_range_m), box.max() + Vec3::Constant(max_range_m)};
}

std::vector<bool> compute_visibility(const scene::Scene& scene, const PointCloud& points,
                                     const geometry::Trajectory& poses, const imaging::Camera& camera,
                                     double max_range_m, double tolerance_m) {
  const VisibilityTester viewer(scene, poses, camera, max_range_m, tolerance_m);
  std::vector<std::uint8_t> seen(points.size(), 0);  // bytes: threads must not share a word of bits
  const std::vector<std::uint32_t> order = geometry::morton_order(points.positions);
  constexpr std::size_t kTogether = 256;
  const std::size_t groups = (order.size() + kTogether - 1) / kTogether;
  tbb::parallel_for(std::size_t{0}, groups, [&](std::size_t group) {
    const std::span<const std::uint32_t> near =
        std::span(order).subspan(group * kTogether).first(std::min(kTogether, order.size() - group * kTogether));
    Box3 box;
    for (const std::uint32_t i : near) box.extend(points.positions[i]);
    const std::vector<std::uint32_t> candidates = viewer.candidate_poses(box.center(), 0.5 * box.diagonal().norm());
    // Neighbouring points are mostly visible from the same pose, which is therefore tested first.
    std::size_t last_seen_from = 0;
    for (const std::uint32_t i : near) {
      for (std::size_t k = 0; k < candidates.size() && seen[i] == 0; ++k) {
        const std::size_t asked = (last_seen_from + k) % candidates.size();
        if (!viewer.is_visible(candidates[asked], points.positions[i])) continue;
        seen[i] = 1;
        last_seen_from = asked;
      }
    }
  });
  return {seen.begin(), seen.end()};
}

}  // namespace tileflight::ground_truth
