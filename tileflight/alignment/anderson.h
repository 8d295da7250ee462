#pragma once

#include <deque>

#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

/// Anderson acceleration of a fixed-point iteration x <- g(x) in seven dimensions: combines the last steps so that
/// their residuals g(x) - x cancel best. Walker and Ni, SIAM J. Numerical Analysis 49(4), 2011 (their method of
/// differences); for ICP see Pavlov et al., ICRA 2018.
class Anderson {
 public:
  /// The next x, given the present one and what the plain iteration makes of it.
  geometry::Vec7 next(const geometry::Vec7& x, const geometry::Vec7& g);

  /// Forgets the past: after a step that was not taken.
  void reset();

 private:
  static constexpr std::size_t kWindow = 6;

  struct Entry {
    geometry::Vec7 g;
    geometry::Vec7 residual;
  };
  std::deque<Entry> past_;  ///< oldest first
};

}  // namespace tileflight::alignment
