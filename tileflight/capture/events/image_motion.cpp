#include "tileflight/capture/events/image_motion.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace tileflight::events {
namespace {

using geometry::Vec3;

constexpr int kCell = 8;
constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

/// Where a placed part's point is at another instant; both local.
Vec3 moved(const Vec3& point, std::uint32_t placed, const SceneInstant& from, const SceneInstant& to) {
  if (placed == SeenSurface::kPlace || from.scene == nullptr || to.scene == nullptr) return point;
  return to.scene->placed_pose(placed, 0.0) * (from.scene->placed_pose(placed, 0.0).inverse() * point);
}

}  // namespace

SeenSurface::SeenSurface(int width, int height) : range_m(width, height, kNaN), placed(width, height, kPlace) {}

render::SurfaceVisitor SeenSurface::visitor(const scene::Scene& scene) {
  return {[this, &scene](const render::SurfacePoint& at) {
    range_m(at.x, at.y) = at.hit ? at.distance_m : std::numeric_limits<float>::infinity();
    if (at.hit && at.mesh >= scene.first_placed_mesh())
      placed(at.x, at.y) = static_cast<std::uint32_t>(scene.placed_of_mesh(at.mesh));
  }};
}

void ImageMotion::add_point(const SeenSurface& seen, int x, int y, std::vector<Point>& points) const {
  const auto ray = camera_.unproject(geometry::Vec2(x, y));
  if (!ray) return;
  Point point{*ray, seen.range_m(x, y), seen.placed(x, y), {}};
  if (camera_.project(*ray, point.d_pixel_d_ray)) points.push_back(point);
}

std::vector<ImageMotion::Point> ImageMotion::nearest_points(const SeenSurface& seen) const {
  using Pixel = std::pair<int, int>;
  std::vector<Point> points;
  const auto is_nearer = [&](int x, int y, const std::optional<Pixel>& than) {
    return !than || seen.range_m(x, y) < seen.range_m(than->first, than->second);
  };
  for (int top = 0; top < camera_.height(); top += kCell) {
    for (int left = 0; left < camera_.width(); left += kCell) {
      std::optional<Pixel> nearest, nearest_placed;
      for (int y = top; y < std::min(top + kCell, camera_.height()); ++y) {
        for (int x = left; x < std::min(left + kCell, camera_.width()); ++x) {
          if (std::isnan(seen.range_m(x, y))) continue;
          std::optional<Pixel>& kept = seen.placed(x, y) == SeenSurface::kPlace ? nearest : nearest_placed;
          if (is_nearer(x, y, kept)) kept = Pixel(x, y);
        }
      }
      for (const std::optional<Pixel>& pixel : {nearest, nearest_placed}) {
        if (pixel) add_point(seen, pixel->first, pixel->second, points);
      }
    }
  }
  return points;
}

double ImageMotion::largest_px(const std::vector<Point>& points, const SceneInstant& seen_at,
                               const SceneInstant& other) {
  const geometry::SE3& T_local_seen = seen_at.T_local_camera;
  const Eigen::Quaterniond R_other_local = other.T_local_camera.rotation.conjugate();
  double largest = 0.0;
  for (const Point& point : points) {
    Vec3 after;
    if (std::isinf(point.range_m)) {
      after = R_other_local * (T_local_seen.rotation * point.ray);
    } else {
      const Vec3 local = moved(T_local_seen * (point.range_m * point.ray), point.placed, seen_at, other);
      after = R_other_local * (local - other.T_local_camera.translation);
    }
    largest = std::max(largest, (point.d_pixel_d_ray * (after.normalized() - point.ray)).norm());
  }
  return largest;
}

}  // namespace tileflight::events
