#pragma once

#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

/// Seven coordinates, all in metres, of similarities near a base: translation, rotation vector and logarithm of the
/// scale, the last two times a length (the spread of the points), so that equal coordinates move points about equally
/// far.
class SimilarityChart {
 public:
  SimilarityChart(const geometry::Sim3& base, double length_m) : base_(base), length_m_(length_m) {}

  geometry::Vec7 coordinates(const geometry::Sim3& T) const;
  geometry::Sim3 similarity(const geometry::Vec7& x) const;

 private:
  geometry::Sim3 base_;
  double length_m_;
};

/// First and second moments of a point set about the origin; they determine how far a motion moves it (RMS).
struct PointSpread {
  geometry::Vec3 mean = geometry::Vec3::Zero();
  geometry::Mat3 second_moment = geometry::Mat3::Zero();  ///< mean of p p^T
};

PointSpread compute_spread(const std::vector<geometry::Vec3>& points);

/// Returns the root mean square of |A p - B p| over the points, metres.
double rms_motion_m(const geometry::Sim3& A, const geometry::Sim3& B, const PointSpread& points);

/// Converts a fit about two centres to the points' own coordinates.
geometry::Sim3 uncentered(const geometry::Sim3& T, const geometry::Vec3& source_center,
                          const geometry::Vec3& target_center);

}  // namespace tileflight::alignment
