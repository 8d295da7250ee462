#pragma once

#include <vector>

#include "tileflight/evaluation/localization/ground_image.h"

namespace tileflight::localization {

/// A point of a flight's mosaic with its putative match in the place.
struct GroundPair {
  geometry::Vec3 source;  ///< mosaic frame, including the height
  geometry::Vec3 target;  ///< local frame, including the height
  double weight = 1.0;
};

/// Similarity near `T_local_mosaic_start` that aligns the pairs and the mosaic's surface with the place's: three
/// residuals per pair, one (the height) per point of `surface`, with equal total weight of pairs and surface;
/// Gauss-Newton with Geman-McClure weights. Unlike a similarity in the plane it also estimates the tilt of the mosaic's
/// up direction and the height.
geometry::Sim3 fit_to_ground(const geometry::Sim3& T_local_mosaic_start, const std::vector<GroundPair>& pairs,
                             const std::vector<geometry::Vec3>& surface, const GroundImage& ground);

/// Evenly chosen points of a mosaic with known height, in its frame; about `most` of them.
std::vector<geometry::Vec3> sample_heights(const GroundImage& mosaic, std::size_t most);

}  // namespace tileflight::localization
