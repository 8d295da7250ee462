#include "tileflight/capture/render/frame_outputs.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace tileflight::render {
namespace {

using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

Vec3 vec3(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }

const SE3& pose_of_row(std::span<const SE3> poses, int row) {
  return poses[poses.size() == 1 ? 0 : static_cast<std::size_t>(row)];
}

/// Unit normal of the visible side, in the camera frame.
std::array<float, 3> visible_normal(const SurfacePoint& point, const SE3& T_local_camera) {
  Vec3 normal = T_local_camera.rotation.conjugate() * vec3(point.normal_local).normalized();
  if (normal.dot(vec3(point.ray_camera)) > 0.0) normal = -normal;
  return {static_cast<float>(normal.x()), static_cast<float>(normal.y()), static_cast<float>(normal.z())};
}

/// Blank images for the requested outputs, with the values for no hit.
OutputImages make_blank_images(const OutputChannels& outputs, int width, int height, bool has_next) {
  OutputImages images;
  if (outputs.range) images.range_m = {width, height, kNaN};
  if (outputs.normals) images.normals = {width, height, {kNaN, kNaN, kNaN}};
  if (outputs.objects || outputs.placed_objects) images.objects = {width, height, 0};
  if (outputs.flow && has_next) images.flow_px = {width, height, {kNaN, kNaN}};
  if (outputs.visibility) images.visibility = {width, height, 0};
  return images;
}

}  // namespace

std::optional<Vec2> project_by_rows(const imaging::Camera& camera, std::span<const SE3> T_local_camera_of_row,
                                    const Vec3& point) {
  return project_by_rows(camera, T_local_camera_of_row, [&point](int) { return point; });
}

std::optional<Vec2> project_by_rows(const imaging::Camera& camera, std::span<const SE3> T_local_camera_of_row,
                                    const PointOfRow& point) {
  const auto projected = [&](int row) {
    const SE3& T = pose_of_row(T_local_camera_of_row, row);
    return camera.project(T.rotation.conjugate() * (point(row) - T.translation));
  };
  const int last_row = camera.height() - 1;
  if (T_local_camera_of_row.size() == 1) {
    const auto pixel = projected(0);
    return pixel && camera.contains(*pixel) ? pixel : std::nullopt;
  }
  // The row that sees the point is the fixed point of the projection as a function of the row. The projection changes
  // by far less than a row between adjacent rows, so that fixed-point iteration converges; then linear interpolation.
  int row = last_row / 2;
  constexpr int kMaxSteps = 20;
  for (int step = 0; step < kMaxSteps; ++step) {
    const auto upper = projected(row), lower = projected(row + 1);
    if (!upper || !lower) return std::nullopt;
    const int wanted = static_cast<int>(std::floor(std::clamp(upper->y(), 0.0, last_row - 1.0)));
    if (std::abs(wanted - row) <= 1) {
      const Vec2 change = *lower - *upper;  // per row
      const Vec2 pixel = *upper + (upper->y() - row) / (1.0 - change.y()) * change;
      return camera.contains(pixel) ? std::optional(pixel) : std::nullopt;
    }
    row = wanted;
  }
  return std::nullopt;
}

OutputRenderer::OutputRenderer(const CameraRenderer& renderer, const scene::Scene& scene, const OutputChannels& outputs,
                               RegionPredicate place)
    : renderer_(renderer), outputs_(outputs), place_(std::move(place)) {
  if (outputs.objects || outputs.placed_objects) objects_.emplace(scene);
}

std::span<const SceneObject> OutputRenderer::objects() const {
  return objects_ ? objects_->all() : std::span<const SceneObject>();
}

OutputImages OutputRenderer::render(std::span<const SE3> T_local_camera_of_row, std::span<const SE3> next) const {
  return render(renderer_, T_local_camera_of_row, next, {}, [&](const SurfaceVisitor& visitor) {
    if (visitor) renderer_.visit_surface(T_local_camera_of_row, visitor);
  });
}

namespace {

float time_of_row(std::span<const float> times, int row) {
  return times.empty() ? 0.0F : times[times.size() == 1 ? 0 : static_cast<std::size_t>(row)];
}

bool is_placed(const MovingFrame& moving, const SurfacePoint& at) {
  return moving.scene != nullptr && at.mesh >= moving.scene->first_placed_mesh();
}

/// Where a point that is seen at this frame is at the next one, by row.
PointOfRow next_point(const MovingFrame& moving, const SurfacePoint& at, const Vec3& point) {
  if (!is_placed(moving, at)) return [point](int) { return point; };
  const std::size_t placed = moving.scene->placed_of_mesh(at.mesh);
  const double time = time_of_row(moving.scene_times, at.y);
  const Vec3 of_part = moving.scene->placed_pose(placed, time).inverse() * point;
  return [&moving, placed, of_part](int row) -> Vec3 {
    return moving.next->placed_pose(placed, time_of_row(moving.next_scene_times, row)) * of_part;
  };
}

}  // namespace

OutputImages OutputRenderer::render(const CameraRenderer& renderer, std::span<const SE3> T_local_camera_of_row,
                                    std::span<const SE3> next, const MovingFrame& moving,
                                    const SurfacePass& pass) const {
  const imaging::Camera& camera = renderer.camera();
  OutputImages images = make_blank_images(outputs_, camera.width(), camera.height(), !next.empty());
  const auto flow_px = [&](const SurfacePoint& at, const Vec3& point) -> std::array<float, 2> {
    const auto pixel = project_by_rows(camera, next, next_point(moving, at, point));
    if (!pixel) return {kNaN, kNaN};
    return {static_cast<float>(pixel->x() - at.x), static_cast<float>(pixel->y() - at.y)};
  };
  const auto visit = [&](const SurfacePoint& at) {
    if (outputs_.range) images.range_m(at.x, at.y) = at.hit ? at.distance_m : std::numeric_limits<float>::infinity();
    if (!at.hit) return;
    const SE3& T = pose_of_row(T_local_camera_of_row, at.y);
    if (outputs_.normals) images.normals(at.x, at.y) = visible_normal(at, T);
    if (outputs_.objects || (outputs_.placed_objects && is_placed(moving, at)))
      images.objects(at.x, at.y) = 1 + objects_->index_of(at.mesh, at.triangle);
    if (images.flow_px.empty() && !outputs_.visibility) return;
    const Vec3 point = T * (static_cast<double>(at.distance_m) * vec3(at.ray_camera));
    if (!images.flow_px.empty()) images.flow_px(at.x, at.y) = flow_px(at, point);
    if (outputs_.visibility && (!place_ || place_(point))) images.visibility(at.x, at.y) = 255;
  };
  pass({visit, outputs_.has_whole_images() ? VisitedPixels::kAll : VisitedPixels::kPlaced});
  return images;
}

}  // namespace tileflight::render
