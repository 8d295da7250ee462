#pragma once

#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::localization {

/// Height field from scattered points: the median height per grid cell; a cell with too few points takes the median of
/// cells twice as large, and so on.
class HeightModel {
 public:
  /// Covers the rectangle from `low` to `high`; points outside are ignored. The cell size follows the density of the
  /// points.
  HeightModel(const std::vector<geometry::Vec3>& points, const geometry::Vec2& low, const geometry::Vec2& high);

  /// Height by bilinear interpolation; outside the rectangle, the value at its border.
  double at(const geometry::Vec2& position) const;
  /// Whether there are points within a few grid cells.
  bool is_supported(const geometry::Vec2& position) const;
  double cell() const { return cell_; }

 private:
  geometry::Vec2 low_;
  double cell_ = 1.0;
  imaging::FloatImage heights_;  ///< heights at the cell centres; rows along y
  imaging::GrayImage supported_;
};

}  // namespace tileflight::localization
