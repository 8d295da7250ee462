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

/// Fits the similarity near `T_local_mosaic_start` that aligns the pairs and the mosaic's surface with the place's:
/// three residuals per pair, one (the height) per point of `surface`, with equal total weight of pairs and surface;
/// Gauss-Newton with Geman-McClure weights. Unlike a similarity in the plane it also estimates the tilt of the mosaic's
/// up direction and the height.
geometry::Sim3 fit_to_ground(const geometry::Sim3& T_local_mosaic_start, const std::vector<GroundPair>& pairs,
                             const std::vector<geometry::Vec3>& surface, const GroundImage& ground);

/// Returns about `most` evenly chosen points of a mosaic with known height, in its frame.
std::vector<geometry::Vec3> sample_heights(const GroundImage& mosaic, std::size_t most);

/// Image pyramid of a ground image; each level has half the size of the one before.
class GroundPyramid {
 public:
  /// The image must outlive the pyramid.
  explicit GroundPyramid(const GroundImage& image);

  /// Grey value at a position, from the level whose pixel size is closest to `step`; NaN outside and where nothing was
  /// seen.
  float at(const geometry::Vec2& position, double step) const;
  const GroundImage& image() const { return image_; }

 private:
  const GroundImage& image_;
  std::vector<imaging::GrayImage> grey_, seen_;  ///< levels from half the size on
};

/// Agreement of a mosaic with the place under a similarity.
struct GroundAgreement {
  geometry::Sim3 T_local_mosaic;  ///< refined in the plane (translation, rotation, scale) for best agreement
  double correlation = 0.0;       ///< of locally normalised grey values
  double height_agreement = 0.0;  ///< share of heights that agree
  double overlap = 0.0;           ///< share of the mosaic that lies on the place
};

/// Aligns the mosaic's grey values with the place's, coarse to fine: at each level, the similarity in the plane that
/// maximises their agreement (Lucas and Kanade, IJCAI 1981).
GroundAgreement compute_ground_agreement(const GroundPyramid& mosaic, const GroundPyramid& place,
                                         const geometry::Sim3& T_local_mosaic);

}  // namespace tileflight::localization
