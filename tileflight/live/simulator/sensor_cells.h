#pragma once

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/tileset/selection.h"

namespace tileflight::simulator {

/// Position and angular resolution of a sensor that may look in any direction.
struct SensorViewpoint {
  geometry::Vec3 position = geometry::Vec3::Zero();  ///< local frame
  double pixels_per_rad = 100.0;
};

/// A cube of space that contains sensors.
struct SensorCell {
  static constexpr double kSize_m = 24.0;

  std::array<double, 3> center{};  ///< local frame, metres
  double pixels_per_rad = 0.0;     ///< highest of its sensors

  auto operator<=>(const SensorCell&) const = default;
};
using SensorCells = std::vector<SensorCell>;

/// The cells that contain the viewpoints, sorted, each once.
SensorCells cells_around(std::span<const SensorViewpoint> viewpoints);

/// The allowed error of a tile by its distance: `error_px` up to `full_detail_m`, proportional to the distance beyond.
struct DetailLimit {
  double error_px = 1.0;
  double full_detail_m = std::numeric_limits<double>::infinity();

  double allowed_px(double distance_m) const;
  /// Returns the next coarser limit, for when memory is short: first far tiles get coarser, then all. nullopt: there is
  /// none.
  std::optional<DetailLimit> coarser() const;

  bool operator==(const DetailLimit&) const = default;
};

/// Tells which surfaces the Earth hides. It stands for the ellipsoid lowered by 500 m, below all dry land.
class Horizon {
 public:
  explicit Horizon(const geometry::LocalFrame& frame) : T_ecef_local_(frame.T_ecef_local()) {}

  /// Returns true only if nothing inside the box (local frame) can be seen from anywhere within `radius_m` of the
  /// position.
  bool hides(const geometry::Box3& box, const geometry::Vec3& position, double radius_m) const;

 private:
  geometry::SE3 T_ecef_local_;
};

/// The criterion that selects tiles for cells.
struct SensorCriterion {
  geometry::SE3 T_local_tileset;
  DetailLimit detail;
  double error_m = 0.0;                                             ///< no tile is refined beyond
  double max_distance_m = std::numeric_limits<double>::infinity();  ///< tiles farther away are left out
  std::optional<Horizon> horizon;

  /// Selects everything that sensors in the cells may see in any direction, at the finest detail that any of the cells
  /// needs. `worst_px`, if given, is raised to the largest error in pixels that was accepted, from anywhere in the
  /// cells.
  tileset::RefinementCriterion for_cells(const SensorCells& cells, double* worst_px = nullptr) const;
};

/// Predicts from the sensors' motion which cells they will enter next.
class SensorMotion {
 public:
  /// Returns the next sets of cells if the sensors continue as since the last answer, in order, at most `count` and
  /// none farther than 2.5 cells ahead; nullopt if the sensors have hardly moved.
  std::optional<std::vector<SensorCells>> predict(std::span<const SensorViewpoint> viewpoints, std::size_t count);

 private:
  std::vector<geometry::Vec3> before_;  ///< positions of the last answer
};

}  // namespace tileflight::simulator
