#pragma once

#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/imaging/image.h"

namespace tileflight::localization {

/// Heights over a plane, from scattered points: in each square of a grid their median, and where a square has too few,
/// that of squares twice as large, and so on.
class HeightModel {
 public:
  /// Over the rectangle from `low` to `high`; points outside are left out. The grid is as fine as the points are dense.
  HeightModel(const std::vector<geometry::Vec3>& points, const geometry::Vec2& low, const geometry::Vec2& high);

  /// Bilinear; beyond the rim as at the rim.
  double at(const geometry::Vec2& position) const;
  /// Whether points lie near: within some squares of the grid.
  bool is_supported(const geometry::Vec2& position) const;
  double cell() const { return cell_; }

 private:
  geometry::Vec2 low_;
  double cell_ = 1.0;
  imaging::FloatImage heights_;  ///< of the squares' middles; rows along y
  imaging::GrayImage supported_;
};

}  // namespace tileflight::localization
