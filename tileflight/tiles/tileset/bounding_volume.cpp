#include "tileflight/tiles/tileset/bounding_volume.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::tileset {
namespace {

using geometry::Box3;
using geometry::Mat3;
using geometry::Mat4;
using geometry::SE3;
using geometry::Vec3;

/// Earth-centred doubles have a rounding error of about a nanometre; a tile closer than this tolerance counts as
/// touching.
constexpr double kSlack_m = 1e-6;

OrientedBox in_local(const OrientedBox& box, const SE3& T_local_tileset) {
  return {T_local_tileset * box.center, T_local_tileset.rotation.toRotationMatrix() * box.half_axes};
}

double longitude_width_rad(const GeographicRegion& region) {
  const double width = region.east_rad - region.west_rad;
  return width >= 0 ? width : width + 2 * std::numbers::pi;
}

/// Whether the region surrounds the earth: more than half of a circle of latitude, up to a cap at a pole.
bool is_wide(const GeographicRegion& region) { return longitude_width_rad(region) > std::numbers::pi; }

/// The largest cosine of the region's latitudes.
double widest_parallel(const GeographicRegion& region) {
  if (region.south_rad <= 0 && region.north_rad >= 0) return 1.0;
  return std::cos(std::min(std::abs(region.south_rad), std::abs(region.north_rad)));
}

/// The latitude of the pole that a cap surrounds; nullopt if the region is none.
std::optional<double> pole_of_cap(const GeographicRegion& region) {
  constexpr double kTolerance_rad = 1e-6, kQuarter_rad = std::numbers::pi / 2;
  if (longitude_width_rad(region) < 2 * std::numbers::pi - kTolerance_rad) return std::nullopt;
  const bool north = region.north_rad > kQuarter_rad - kTolerance_rad;
  const bool south = region.south_rad < kTolerance_rad - kQuarter_rad;
  return north == south ? std::nullopt : std::optional(north ? kQuarter_rad : -kQuarter_rad);
}

Vec3 ecef(double latitude_rad, double longitude_rad, double height_m) {
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  return geometry::ecef_from_geodetic({latitude_rad * kDegrees, longitude_rad * kDegrees, {height_m}});
}

/// Samples of the patch on a grid, enlarged by the maximum distance of the curved surface from the grid's convex hull:
/// linear interpolation over a step d misses a function with second derivative M by at most M d^2 / 8, and both second
/// derivatives of a point on the ellipsoid (or at a height above it) are bounded by the largest radius of curvature.
Box3 bounds_of_region(const GeographicRegion& region, const SE3& T_local_tileset) {
  constexpr int kSteps = 8;
  constexpr double kLargestRadius_m = 6.5e6;
  const double latitude_step = (region.north_rad - region.south_rad) / kSteps;
  const int longitude_steps = is_wide(region) ? 8 * kSteps : kSteps;
  const double longitude_step = longitude_width_rad(region) / longitude_steps;
  Box3 box;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= longitude_steps; ++j) {
      for (const double height_m : {region.min_height_m, region.max_height_m}) {
        box.extend(T_local_tileset *
                   ecef(region.south_rad + i * latitude_step, region.west_rad + j * longitude_step, height_m));
      }
    }
  }
  const double radius_m = kLargestRadius_m + std::max(std::abs(region.min_height_m), std::abs(region.max_height_m));
  // A parallel's radius is smaller by the cosine of its latitude, which matters for caps at a pole.
  const double parallel = is_wide(region) ? widest_parallel(region) : 1.0;
  const double bulge_m = radius_m * (latitude_step * latitude_step + parallel * longitude_step * longitude_step) / 8;
  return {box.min() - Vec3::Constant(bulge_m), box.max() + Vec3::Constant(bulge_m)};
}

/// The point on the ellipsoid (or at a height above it) where its normal is `normal`.
Vec3 ecef(const Vec3& normal, double height_m) {
  constexpr double kSemiMajor_m = 6378137.0;
  constexpr double kFlattening = 1 / 298.257223563;
  constexpr double kSemiMinor_m = kSemiMajor_m * (1 - kFlattening);
  const Vec3 squares(kSemiMajor_m * kSemiMajor_m, kSemiMajor_m * kSemiMajor_m, kSemiMinor_m * kSemiMinor_m);
  const Vec3 scaled = squares.cwiseProduct(normal);
  return scaled / std::sqrt(normal.dot(scaled)) + height_m * normal;
}

/// A box around an S2 cell, with its up axis at the cell's centre and its sides along the cell's edges: samples on a
/// grid, enlarged by the surface's distance from their hull (as above). On the cube's face, with u and v from -1 to 1,
/// the normal's first and second derivatives are below 1 and 1.2, and so the point's second derivative below 1.3 times
/// the largest radius of curvature.
OrientedBox box_around(const S2Volume& volume) {
  constexpr int kSteps = 8;
  constexpr double kLargestRadius_m = 6.5e6;
  constexpr double kWidestCube = 8.0 / 3.0;  // the quadratic projection's derivative is at most 8/3 of the grid's step
  const Vec3 up = s2_normal(volume.cell, 0.5, 0.5);
  const Vec3 along = s2_normal(volume.cell, 1.0, 0.5) - s2_normal(volume.cell, 0.0, 0.5);
  Mat3 axes;
  axes.col(2) = up;
  axes.col(0) = (along - along.dot(up) * up).normalized();
  axes.col(1) = up.cross(Vec3(axes.col(0)));
  Box3 box;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Vec3 normal = s2_normal(volume.cell, static_cast<double>(i) / kSteps, static_cast<double>(j) / kSteps);
      for (const double height_m : {volume.min_height_m, volume.max_height_m}) {
        box.extend(Vec3(axes.transpose() * ecef(normal, height_m)));
      }
    }
  }
  const double radius_m = kLargestRadius_m + std::max(std::abs(volume.min_height_m), std::abs(volume.max_height_m));
  const double step = kWidestCube * std::ldexp(1.0, -static_cast<int>(volume.cell.level)) / kSteps;
  const double bulge_m = 1.3 * radius_m * 2 * step * step / 8;
  const Vec3 half_size = box.sizes() / 2 + Vec3::Constant(bulge_m);
  return {axes * box.center(), axes * half_size.asDiagonal()};
}

/// Whether the axis separates the bodies: their projections on it are intervals around their centres.
bool separated_along(const Vec3& axis, const Vec3& offset, const Mat3& half_axes, const Vec3& half_size) {
  const double length = axis.norm();
  if (!(length > 0)) return false;  // parallel edges or a flat box give no axis
  const double reach = (half_axes.transpose() * axis).cwiseAbs().sum() + half_size.dot(axis.cwiseAbs());
  return std::abs(offset.dot(axis)) > reach + kSlack_m * length;
}

/// Separating axis theorem for a parallelepiped and an axis-aligned box: their face normals and the cross products of
/// their edges.
bool boxes_intersect(const OrientedBox& a, const Box3& box) {
  const Vec3 offset = a.center - box.center();
  const Vec3 half_size = box.sizes() / 2;
  const auto separates = [&](const Vec3& axis) { return separated_along(axis, offset, a.half_axes, half_size); };
  for (int i = 0; i < 3; ++i) {
    if (separates(Vec3::Unit(i))) return false;
    const Vec3 edge = a.half_axes.col(i);
    if (separates(edge.cross(Vec3(a.half_axes.col((i + 1) % 3))))) return false;
    for (int j = 0; j < 3; ++j) {
      if (separates(edge.cross(Vec3::Unit(j)))) return false;
    }
  }
  return true;
}

bool intervals_meet(const Box3& a, const Box3& b) {
  return (a.min().array() <= b.max().array() + kSlack_m).all() && (b.min().array() <= a.max().array() + kSlack_m).all();
}

}  // namespace

BoundingVolume transformed(const Mat4& T_a_b, const BoundingVolume& volume_b) {
  const Mat3 linear = T_a_b.topLeftCorner<3, 3>();
  const Vec3 translation = T_a_b.topRightCorner<3, 1>();
  if (const auto* box = std::get_if<OrientedBox>(&volume_b)) {
    return OrientedBox{linear * box->center + translation, linear * box->half_axes};
  }
  if (const auto* sphere = std::get_if<BoundingSphere>(&volume_b)) {
    const double stretch = Eigen::JacobiSVD<Mat3>(linear).singularValues()(0);
    return BoundingSphere{linear * sphere->center + translation, stretch * sphere->radius_m};
  }
  return volume_b;  // earth-fixed
}

namespace {

/// Each pair of sides moves outwards by at least the margin; sides of a sheared box by more.
OrientedBox widened_box(OrientedBox box, double margin_m) {
  const Eigen::JacobiSVD<Mat3> svd(box.half_axes, Eigen::ComputeFullU);
  const double longest_m = svd.singularValues()[0];
  const bool is_flat = !(svd.singularValues()[2] > 1e-9 * longest_m) || !(longest_m > 0.0);
  // A box without volume becomes the box along its principal axes.
  if (is_flat) box.half_axes = svd.matrixU() * (std::sqrt(3.0) * svd.singularValues()).asDiagonal();
  const Mat3 normals = is_flat ? Mat3(svd.matrixU()) : Mat3(box.half_axes.inverse().transpose());
  for (int axis = 0; axis < 3; ++axis) {
    const Vec3 normal = normals.col(axis).normalized();
    const double half_m = box.half_axes.col(axis).dot(normal);  // from the centre to the side
    if (half_m > 0.0) {
      box.half_axes.col(axis) *= (half_m + margin_m) / half_m;
    } else {
      box.half_axes.col(axis) = margin_m * normal;
    }
  }
  return box;
}

GeographicRegion widened_region(GeographicRegion region, double margin_m) {
  constexpr double kSmallestRadius_m = 6.33e6, kQuarter_rad = std::numbers::pi / 2;
  const double angle_rad = margin_m / kSmallestRadius_m;
  region.min_height_m -= margin_m;
  region.max_height_m += margin_m;
  region.south_rad = std::max(-kQuarter_rad, region.south_rad - angle_rad);
  region.north_rad = std::min(kQuarter_rad, region.north_rad + angle_rad);
  const double narrowest = std::cos(std::max(std::abs(region.south_rad), std::abs(region.north_rad)));
  const double across_rad = angle_rad / std::max(narrowest, 1e-6);
  if (longitude_width_rad(region) + 2 * across_rad >= 2 * std::numbers::pi) {
    region.west_rad = -std::numbers::pi;
    region.east_rad = std::numbers::pi;
    return region;
  }
  region.west_rad = std::remainder(region.west_rad - across_rad, 2 * std::numbers::pi);
  region.east_rad = std::remainder(region.east_rad + across_rad, 2 * std::numbers::pi);
  return region;
}

}  // namespace

BoundingVolume widened(const BoundingVolume& volume, double margin_m) {
  if (const auto* box = std::get_if<OrientedBox>(&volume)) return widened_box(*box, margin_m);
  if (const auto* region = std::get_if<GeographicRegion>(&volume)) return widened_region(*region, margin_m);
  if (const auto* sphere = std::get_if<BoundingSphere>(&volume))
    return BoundingSphere{sphere->center, sphere->radius_m + margin_m};
  S2Volume cell = std::get<S2Volume>(volume);
  cell.min_height_m -= margin_m;
  cell.max_height_m += margin_m;
  return cell;
}

Vec3 center_of(const BoundingVolume& volume) {
  if (const auto* box = std::get_if<OrientedBox>(&volume)) return box->center;
  if (const auto* sphere = std::get_if<BoundingSphere>(&volume)) return sphere->center;
  if (const auto* s2 = std::get_if<S2Volume>(&volume)) {
    return ecef(s2_normal(s2->cell, 0.5, 0.5), (s2->min_height_m + s2->max_height_m) / 2);
  }
  const auto& region = std::get<GeographicRegion>(volume);
  if (const auto pole = pole_of_cap(region)) return ecef(*pole, 0.0, (region.min_height_m + region.max_height_m) / 2);
  return ecef((region.south_rad + region.north_rad) / 2, region.west_rad + longitude_width_rad(region) / 2,
              (region.min_height_m + region.max_height_m) / 2);
}

Box3 local_bounding_box(const BoundingVolume& volume, const SE3& T_local_tileset) {
  if (const auto* box = std::get_if<OrientedBox>(&volume)) {
    const OrientedBox local = in_local(*box, T_local_tileset);
    const Vec3 reach = local.half_axes.cwiseAbs().rowwise().sum();
    return {local.center - reach, local.center + reach};
  }
  if (const auto* sphere = std::get_if<BoundingSphere>(&volume)) {
    const Vec3 center = T_local_tileset * sphere->center;
    return {center - Vec3::Constant(sphere->radius_m), center + Vec3::Constant(sphere->radius_m)};
  }
  if (const auto* s2 = std::get_if<S2Volume>(&volume)) return local_bounding_box(box_around(*s2), T_local_tileset);
  return bounds_of_region(std::get<GeographicRegion>(volume), T_local_tileset);
}

bool intersects(const BoundingVolume& volume, const SE3& T_local_tileset, const Box3& box_local) {
  if (const auto* box = std::get_if<OrientedBox>(&volume))
    return boxes_intersect(in_local(*box, T_local_tileset), box_local);
  if (const auto* sphere = std::get_if<BoundingSphere>(&volume)) {
    return box_local.exteriorDistance(T_local_tileset * sphere->center) <= sphere->radius_m + kSlack_m;
  }
  if (const auto* s2 = std::get_if<S2Volume>(&volume)) {
    return boxes_intersect(in_local(box_around(*s2), T_local_tileset), box_local);
  }
  return intervals_meet(local_bounding_box(volume, T_local_tileset), box_local);
}

}  // namespace tileflight::tileset
