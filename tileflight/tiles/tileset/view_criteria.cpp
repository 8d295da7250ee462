#include "tileflight/tiles/tileset/view_criteria.h"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "tileflight/tiles/tileset/view_cone_tree.h"

namespace tileflight::tileset {
namespace {

using geometry::Box3;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec2;
using geometry::Vec3;

/// Cesium's minimum distance, so that a camera inside a volume has a finite error.
constexpr double kMinDistance_m = 1e-7;

/// A volume in the local frame: box or sphere; a geographic region's axis-aligned bounding box.
using LocalVolume = std::variant<OrientedBox, BoundingSphere>;

LocalVolume in_local(const BoundingVolume& volume, const SE3& T_local_tileset) {
  const BoundingVolume moved = transformed(T_local_tileset.matrix(), volume);
  if (const auto* box = std::get_if<OrientedBox>(&moved)) return *box;
  if (const auto* sphere = std::get_if<BoundingSphere>(&moved)) return *sphere;
  const Box3 box = local_bounding_box(volume, T_local_tileset);
  return OrientedBox{box.center(), (box.sizes() / 2).asDiagonal()};
}

/// A bounding sphere around the volume's centre.
BoundingSphere sphere_around(const LocalVolume& volume) {
  if (const auto* sphere = std::get_if<BoundingSphere>(&volume)) return *sphere;
  const auto& box = std::get<OrientedBox>(volume);
  double radius_m = 0.0;
  for (int corner = 0; corner < 4; ++corner) {  // the other four are opposite
    const Vec3 signs(1, corner % 2 == 0 ? 1 : -1, corner / 2 == 0 ? 1 : -1);
    radius_m = std::max(radius_m, (box.half_axes * signs).norm());
  }
  return {box.center, radius_m};
}

bool is_right_angled(const Mat3& half_axes) {
  const Mat3 products = half_axes.transpose() * half_axes;
  const double largest = products.diagonal().maxCoeff();
  return std::max({std::abs(products(0, 1)), std::abs(products(0, 2)), std::abs(products(1, 2))}) <= 1e-9 * largest;
}

double distance_to_box_m(const OrientedBox& box, const Vec3& point) {
  Vec3 rest = point - box.center;
  // Subtracts the component within the box along each axis; flat axes subtract nothing.
  for (int i = 0; i < 3; ++i) {
    const double length_m = box.half_axes.col(i).norm();
    if (!(length_m > 0)) continue;
    const Vec3 axis = box.half_axes.col(i) / length_m;
    rest -= std::clamp((point - box.center).dot(axis), -length_m, length_m) * axis;
  }
  return rest.norm();
}

double distance_to_sphere_m(const BoundingSphere& sphere, const Vec3& point) {
  return std::max(0.0, (point - sphere.center).norm() - sphere.radius_m);
}

double distance_local_m(const LocalVolume& volume, const Vec3& point) {
  if (const auto* box = std::get_if<OrientedBox>(&volume); box != nullptr && is_right_angled(box->half_axes))
    return distance_to_box_m(*box, point);
  return distance_to_sphere_m(sphere_around(volume), point);
}

double angle_between_rad(const Vec3& a, const Vec3& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

/// The most pixels that a small angle covers around a ray: the largest singular value of the pixel's derivative across
/// the ray. For a panorama the smallest: towards its poles many pixels of a row show the same direction, so the columns
/// determine the resolution.
double pixels_per_rad(const imaging::Camera& camera, const Vec3& ray) {
  Eigen::Matrix<double, 2, 3> d_pixel_d_point;
  if (!camera.project(ray, d_pixel_d_point)) return 0.0;
  Eigen::Matrix<double, 3, 2> across;
  across.col(0) = ray.unitOrthogonal();
  across.col(1) = ray.cross(across.col(0));
  const Eigen::Matrix2d d_pixel_d_angle = d_pixel_d_point * across;
  const bool panorama = std::holds_alternative<imaging::Equirectangular>(camera.model());
  return Eigen::JacobiSVD<Eigen::Matrix2d>(d_pixel_d_angle).singularValues()(panorama ? 1 : 0);
}

/// Unit normals of the frustum's four sides, pointing inwards, local frame.
std::array<Vec3, 4> frustum_sides(const ViewerCamera& camera) {
  const double tan_x = std::tan(camera.horizontal_fov_deg * std::numbers::pi / 360.0);
  const double tan_y = tan_x * camera.height / camera.width;
  std::array<Vec3, 4> sides{Vec3(1, 0, tan_x), Vec3(-1, 0, tan_x), Vec3(0, 1, tan_y), Vec3(0, -1, tan_y)};
  for (Vec3& side : sides) side = camera.T_local_camera.rotation * side.normalized();
  return sides;
}

/// Extent of the volume along a direction from a point.
double reach_m(const LocalVolume& volume, const Vec3& direction, const Vec3& from) {
  if (const auto* sphere = std::get_if<BoundingSphere>(&volume))
    return (sphere->center - from).dot(direction) + sphere->radius_m;
  const auto& box = std::get<OrientedBox>(volume);
  return (box.center - from).dot(direction) + (box.half_axes.transpose() * direction).cwiseAbs().sum();
}

}  // namespace

ViewCone view_cone_of(const imaging::Camera& camera) {
  constexpr int kSteps = 64;
  ViewCone eye{.half_angle_rad = 0.0};
  for (int j = 0; j <= kSteps; ++j) {
    for (int i = 0; i <= kSteps; ++i) {
      // The outer edges of the border pixels.
      const Vec2 pixel(camera.width() * static_cast<double>(i) / kSteps - 0.5,
                       camera.height() * static_cast<double>(j) / kSteps - 0.5);
      const std::optional<Vec3> ray = camera.unproject(pixel);
      if (!ray) continue;
      eye.half_angle_rad = std::max(eye.half_angle_rad, angle_between_rad(*ray, Vec3::UnitZ()));
      eye.pixels_per_rad = std::max(eye.pixels_per_rad, pixels_per_rad(camera, *ray));
    }
  }
  // If the image extends beyond the lens's valid cone, the view covers all of that cone.
  if (!camera.unproject({-0.5, -0.5})) eye.half_angle_rad = std::max(eye.half_angle_rad, camera.max_theta_rad());
  eye.half_angle_rad = std::min(eye.half_angle_rad, std::numbers::pi);
  return eye;
}

std::vector<ViewCone> view_cones_along(const imaging::Camera& camera, const std::vector<SE3>& T_local_camera) {
  const ViewCone lens = view_cone_of(camera);
  std::vector<ViewCone> eyes;
  for (const SE3& pose : T_local_camera)
    eyes.push_back({pose.translation, pose.rotation * Vec3::UnitZ(), lens.half_angle_rad, lens.pixels_per_rad});
  return eyes;
}

std::vector<ViewCone> widen_to_all_directions(std::vector<ViewCone> eyes) {
  for (ViewCone& eye : eyes) eye.half_angle_rad = std::numbers::pi;
  return eyes;
}

RefinementCriterion flight_criterion(std::vector<ViewCone> eyes, const SE3& T_local_tileset, double error_px,
                                     const ViewConeRange& part) {
  const auto shared = std::make_shared<const ViewConeTree>(std::move(eyes));
  return {.intersects =
              [shared, T_local_tileset, part](const BoundingVolume& volume) {
                const BoundingSphere sphere = sphere_around(in_local(volume, T_local_tileset));
                return shared->any_of(
                    part, [&](const ViewConeTree::Group& group) { return may_intersect(group, sphere); },
                    [&](const ViewCone& eye) { return intersects_cone(eye, sphere); });
              },
          .is_fine_enough =
              [shared, T_local_tileset, error_px](const BoundingVolume& volume, double geometric_error_m) {
                const LocalVolume local = in_local(volume, T_local_tileset);
                const BoundingSphere sphere = sphere_around(local);
                const auto is_fine = [&](const ViewCone& eye, double distance_m) {
                  return geometric_error_m * eye.pixels_per_rad <= error_px * distance_m;
                };
                return !shared->any_of(
                    {},
                    [&](const ViewConeTree::Group& group) {
                      const double away_m = distance_local_m(local, group.around.position);
                      return !is_fine(group.around, least_distance_m(group, away_m)) && may_intersect(group, sphere);
                    },
                    [&](const ViewCone& eye) {
                      return !is_fine(eye, distance_local_m(local, eye.position)) && intersects_cone(eye, sphere);
                    });
              }};
}

RefinementCriterion limit_refinement(RefinementCriterion wanted, double error_m) {
  wanted.is_fine_enough = [inner = std::move(wanted.is_fine_enough), error_m](const BoundingVolume& volume,
                                                                              double error) {
    return error <= error_m || inner(volume, error);
  };
  return wanted;
}

RefinementCriterion viewer_criterion(const ViewerCamera& camera, const SE3& T_local_tileset) {
  const Vec3 position = camera.T_local_camera.translation;
  const double tan_x = std::tan(camera.horizontal_fov_deg * std::numbers::pi / 360.0);
  const double pixels_per_tangent = camera.width / (2.0 * tan_x);
  return {.intersects =
              [=, sides = frustum_sides(camera)](const BoundingVolume& volume) {
                const LocalVolume local = in_local(volume, T_local_tileset);
                return std::ranges::all_of(sides,
                                           [&](const Vec3& side) { return reach_m(local, side, position) >= 0.0; });
              },
          .is_fine_enough =
              [=, max_error_px = camera.max_error_px](const BoundingVolume& volume, double geometric_error_m) {
                const double away_m = std::max(kMinDistance_m, distance_m(volume, T_local_tileset, position));
                return geometric_error_m * pixels_per_tangent / away_m < max_error_px;
              },
          .contains_viewer =
              [=](const BoundingVolume& volume) { return distance_m(volume, T_local_tileset, position) <= 0.0; }};
}

double distance_m(const BoundingVolume& volume, const SE3& T_local_tileset, const Vec3& point_local) {
  return distance_local_m(in_local(volume, T_local_tileset), point_local);
}

}  // namespace tileflight::tileset
