#pragma once

#include <deque>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

/// Anderson acceleration of a fixed-point iteration x <- g(x) in seven dimensions: combines the last steps so that the
/// norm of their combined residuals g(x) - x is minimal. Walker and Ni, SIAM J. Numerical Analysis 49(4), 2011 (their
/// method of differences); for ICP see Pavlov et al., ICRA 2018.
class AndersonAcceleration {
 public:
  /// The next x, given the present x and g = g(x).
  geometry::Vec7 next(const geometry::Vec7& x, const geometry::Vec7& g);

  /// Clears the history; call after a step was rejected.
  void reset();

 private:
  static constexpr std::size_t kWindow = 6;

  struct Entry {
    geometry::Vec7 g;
    geometry::Vec7 residual;
  };
  std::deque<Entry> history_;  ///< oldest first
};

}  // namespace tileflight::alignment
