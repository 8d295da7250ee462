#include "tileflight/live/simulator/sensor_cells.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tileflight/tiles/tileset/bounding_volume.h"
#include "tileflight/tiles/tileset/view_criteria.h"

namespace tileflight::simulator {
namespace {

using geometry::Box3;
using geometry::Vec3;

/// Half the diagonal of a cell: the maximum distance of a sensor from its centre.
const double kCellRadius_m = 0.5 * std::sqrt(3.0) * SensorCell::kSize_m;

constexpr double kErrorGrowth = 1.5;     ///< factor by which the allowed error is raised if memory is short
constexpr double kCoarsest_px = 4096.0;  ///< upper limit of the allowed error
/// Distances at which tiles get coarser when memory is short: the first one tried and the last one. Within some 250 m
/// an image shows the obstacles that vehicles fly around.
constexpr double kFarAtFirst_m = 2048.0, kFarAtLast_m = 256.0;

constexpr double kPredictionStep_m = 0.5;
constexpr double kLookAhead_m = 2.5 * SensorCell::kSize_m;
constexpr double kHardlyMoved_m = 1.0;
constexpr double kJump_m = SensorCell::kSize_m;  ///< no way leads on from a jump

Vec3 center_of(const SensorCell& cell) { return {cell.center[0], cell.center[1], cell.center[2]}; }

/// The share of the axes of the ellipsoid that hides what is behind the Earth.
Vec3 scaled_to_unit_sphere(const Vec3& ecef_m) {
  constexpr double kLowered_m = 500.0;
  constexpr double kEquatorial_m = 6378137.0 - kLowered_m, kPolar_m = 6356752.0 - kLowered_m;  // WGS84
  return {ecef_m.x() / kEquatorial_m, ecef_m.y() / kEquatorial_m, ecef_m.z() / kPolar_m};
}

/// Distance of the horizon of the unit sphere from a point outside.
double tangent_length(double from_center) { return std::sqrt(std::max(0.0, from_center * from_center - 1.0)); }

}  // namespace

SensorCells cells_around(std::span<const SensorViewpoint> viewpoints) {
  SensorCells cells;
  for (const SensorViewpoint& viewpoint : viewpoints) {
    SensorCell cell;
    for (int axis = 0; axis < 3; ++axis)
      cell.center[static_cast<std::size_t>(axis)] =
          (std::floor(viewpoint.position[axis] / SensorCell::kSize_m) + 0.5) * SensorCell::kSize_m;
    cell.pixels_per_rad = viewpoint.pixels_per_rad;
    cells.push_back(cell);
  }
  std::ranges::sort(cells);
  // The highest resolution of a cell's viewpoints counts.
  SensorCells distinct;
  for (const SensorCell& cell : cells) {
    if (!distinct.empty() && cell.center == distinct.back().center) distinct.pop_back();
    distinct.push_back(cell);
  }
  return distinct;
}

double DetailLimit::allowed_px(double distance_m) const { return error_px * std::max(1.0, distance_m / full_detail_m); }

std::optional<DetailLimit> DetailLimit::coarser() const {
  if (full_detail_m > kFarAtFirst_m) return DetailLimit{error_px, kFarAtFirst_m};
  if (full_detail_m > kFarAtLast_m) return DetailLimit{error_px, full_detail_m / 2.0};
  if (error_px * kErrorGrowth > kCoarsest_px) return std::nullopt;
  return DetailLimit{error_px * kErrorGrowth, full_detail_m};
}

/// Scaling to the unit sphere keeps straight what is straight, and shortens by the polar axis at most. Two points see
/// each other past a sphere only if they are no farther apart than their two tangents are long.
bool Horizon::hides(const Box3& box, const Vec3& position, double radius_m) const {
  const double polar_m = 1.0 / scaled_to_unit_sphere(Vec3::UnitZ()).z();
  const Vec3 from = scaled_to_unit_sphere(T_ecef_local_ * position);
  const Vec3 to = scaled_to_unit_sphere(T_ecef_local_ * box.center());
  const double from_radius = radius_m / polar_m, to_radius = 0.5 * box.sizes().norm() / polar_m;
  const double nearest = (to - from).norm() - from_radius - to_radius;
  if (from.norm() - from_radius <= 1.0) return false;  // below the ellipsoid: told nothing about
  return nearest > tangent_length(from.norm() + from_radius) + tangent_length(to.norm() + to_radius);
}

tileset::RefinementCriterion SensorCriterion::for_cells(const SensorCells& cells, double* worst_px) const {
  const auto away_m = [T = T_local_tileset](const tileset::BoundingVolume& volume, const SensorCell& cell) {
    return std::max(0.0, tileset::distance_m(volume, T, center_of(cell)) - kCellRadius_m);
  };
  const auto in_sight = [cells, away_m, wanted = *this](const tileset::BoundingVolume& volume, const SensorCell& cell) {
    if (away_m(volume, cell) > wanted.max_distance_m) return false;
    return !wanted.horizon || !wanted.horizon->hides(tileset::local_bounding_box(volume, wanted.T_local_tileset),
                                                     center_of(cell), kCellRadius_m);
  };
  const auto fine_enough = [cells, away_m, in_sight, wanted = *this, worst_px](const tileset::BoundingVolume& volume,
                                                                               double geometric_error_m) {
    if (geometric_error_m <= wanted.error_m) return true;
    double worst = 0.0;
    for (const SensorCell& cell : cells) {
      if (!in_sight(volume, cell)) continue;
      const double distance_m = away_m(volume, cell);
      if (geometric_error_m * cell.pixels_per_rad > wanted.detail.allowed_px(distance_m) * distance_m) return false;
      if (distance_m > 0.0) worst = std::max(worst, geometric_error_m * cell.pixels_per_rad / distance_m);
    }
    if (worst_px != nullptr) *worst_px = std::max(*worst_px, worst);
    return true;
  };
  return {.intersects =
              [cells, in_sight](const tileset::BoundingVolume& volume) {
                return std::ranges::any_of(cells, [&](const SensorCell& cell) { return in_sight(volume, cell); });
              },
          .is_fine_enough = fine_enough};
}

std::optional<std::vector<SensorCells>> SensorMotion::predict(std::span<const SensorViewpoint> viewpoints,
                                                              std::size_t count) {
  std::vector<Vec3> moved(viewpoints.size(), Vec3::Zero());
  double longest_m = 0.0;
  const bool known = before_.size() == viewpoints.size();
  for (std::size_t i = 0; known && i < moved.size(); ++i) {
    moved[i] = viewpoints[i].position - before_[i];
    longest_m = std::max(longest_m, moved[i].norm());
  }
  if (known && longest_m < kHardlyMoved_m) return std::nullopt;
  before_.clear();
  for (const SensorViewpoint& viewpoint : viewpoints) before_.push_back(viewpoint.position);
  std::vector<SensorCells> next;
  if (!known || longest_m > kJump_m) return next;
  SensorCells last = cells_around(viewpoints);
  std::vector<SensorViewpoint> ahead(viewpoints.begin(), viewpoints.end());
  for (double way_m = kPredictionStep_m; way_m <= kLookAhead_m && next.size() < count; way_m += kPredictionStep_m) {
    for (std::size_t i = 0; i < ahead.size(); ++i)
      ahead[i].position = viewpoints[i].position + way_m / longest_m * moved[i];
    SensorCells cells = cells_around(ahead);
    if (cells == last) continue;
    next.push_back(cells);
    last = std::move(cells);
  }
  return next;
}

}  // namespace tileflight::simulator
