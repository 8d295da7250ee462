#include "tileflight/capture/render/view_overlap.h"

#include <algorithm>

#include "tileflight/core/base/input_error.h"

namespace tileflight::render {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

std::vector<GridRay> grid_rays(const imaging::Camera& camera, int grid) {
  if (grid < 2)
    throw InputError("view overlap", "a grid of " + std::to_string(grid) + " rays is too coarse; use at least 2");
  std::vector<GridRay> rays;
  const double step_px = static_cast<double>(std::max(camera.width(), camera.height())) / grid;
  for (double y = 0.5 * step_px - 0.5; y < camera.height() - 0.5; y += step_px) {
    for (double x = 0.5 * step_px - 0.5; x < camera.width() - 0.5; x += step_px) {
      if (const auto ray = camera.unproject(Vec2(x, y))) rays.push_back({Vec2(x, y), ray->normalized()});
    }
  }
  return rays;
}

ViewOverlap::ViewOverlap(const scene::Scene& scene, const imaging::Camera& a, const imaging::Camera& b, int grid)
    : scene_(scene), a_{a, grid_rays(a, grid)}, b_{b, grid_rays(b, grid)} {}

bool ViewOverlap::sees(const View& view, const SE3& T_local_camera, const Vec3& point) const {
  const auto pixel = view.camera.project(T_local_camera.inverse() * point);
  if (!pixel || !view.camera.contains(*pixel)) return false;
  // The point itself lies on a surface, so only surfaces nearer by more than the float error occlude it.
  const Vec3 towards = point - T_local_camera.translation;
  const double distance_m = towards.norm(), before_m = distance_m * (1 - 1e-3) - 0.01;
  return before_m <= 0 || !scene_.is_occluded({T_local_camera.translation, towards / distance_m}, before_m);
}

double ViewOverlap::operator()(const SE3& T_local_a, const SE3& T_local_b) const {
  std::size_t hits = 0, shared = 0;
  const auto count = [&](const View& from, const SE3& T_from, const View& other, const SE3& T_other) {
    for (const GridRay& ray : from.rays) {
      const Vec3 direction = T_from.rotation * ray.direction;
      const auto hit = scene_.intersect({T_from.translation, direction});
      if (!hit) continue;
      ++hits;
      shared += sees(other, T_other, T_from.translation + hit->distance_m * direction) ? 1 : 0;
    }
  };
  count(a_, T_local_a, b_, T_local_b);
  count(b_, T_local_b, a_, T_local_a);
  return hits > 0 ? static_cast<double>(shared) / static_cast<double>(hits) : 0.0;
}

}  // namespace tileflight::render
