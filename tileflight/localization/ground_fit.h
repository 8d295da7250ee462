#pragma once

#include <vector>

#include "tileflight/localization/ground_image.h"

namespace tileflight::localization {

/// A place in a flight's mosaic, and where it may be.
struct GroundPair {
  geometry::Vec3 source;  ///< mosaic's frame, with the height
  geometry::Vec3 target;  ///< local, with the height
  double weight = 1.0;
};

/// The similarity near `start` (local frame from the mosaic's) that carries the pairs onto one another and the mosaic's
/// surface onto the place's: three residuals a pair, one (the height) for a place of `surface`, all surface together as
/// much as all pairs; Gauss-Newton with Geman-McClure's weights. It finds what the plane's similarity cannot: how the
/// mosaic's up leans, and the height.
geometry::Sim3 fit_to_ground(const geometry::Sim3& T_local_mosaic_start, const std::vector<GroundPair>& pairs,
                             const std::vector<geometry::Vec3>& surface, const GroundImage& ground);

/// Every so many of a mosaic's places whose height is known, in its frame: about `most`.
std::vector<geometry::Vec3> surface_of(const GroundImage& mosaic, std::size_t most);

}  // namespace tileflight::localization
