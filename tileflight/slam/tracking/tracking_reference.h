#pragma once

// A keyframe as new images are aligned to it: its pixels with known inverse distance, by pyramid level (DSO, section
// 3.1, step 1).

#include <array>
#include <vector>

#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::tracking {

/// A pixel of the keyframe with known inverse distance.
struct ReferencePoint {
  Eigen::Vector2f pixel;  ///< level 0
  float rho = 0.0F;       ///< along the pixel's ray, in the keyframe
  float weight = 1.0F;    ///< information of rho, for averaging on coarser levels
};

/// The aligned pixels of one level as arrays, padded with dummy pixels to a multiple of the SIMD width.
struct ReferenceLevel {
  std::vector<Eigen::Vector2f> pixels;    ///< without the padding
  std::array<std::vector<float>, 3> ray;  ///< unit, by coordinate
  std::vector<float> rho;
  std::vector<float> intensity;

  std::size_t size() const { return pixels.size(); }
  Eigen::Vector3f ray_of(std::size_t i) const { return {ray[0][i], ray[1][i], ray[2][i]}; }
  void add(const Eigen::Vector2f& pixel, const Eigen::Vector3f& unit_ray, float inverse_distance, float grey);
  void pad();  ///< call once, after the last add()
};

struct TrackingReference {
  std::vector<ReferenceLevel> levels;
};

/// Averages the points' inverse distances on each level and dilates them to neighbouring pixels, so that coarse levels
/// are dense enough (DSO, section 3.1, step 1: projected and slightly dilated).
TrackingReference make_tracking_reference(const keyframes::LensPyramid& lens, const keyframes::Pyramid& keyframe,
                                          const std::vector<ReferencePoint>& points);

}  // namespace tileflight::tracking
