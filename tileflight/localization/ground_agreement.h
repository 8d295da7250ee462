#pragma once

#include <vector>

#include "tileflight/localization/ground_image.h"

namespace tileflight::localization {

/// A ground image at several sizes, each half as large as the one before.
class GroundPyramid {
 public:
  /// The image must outlive it.
  explicit GroundPyramid(const GroundImage& image);

  /// Grey value at a position, at the size whose pixel is nearest to `step`; NaN outside and where nothing was seen.
  float at(const geometry::Vec2& position, double step) const;
  const GroundImage& image() const { return image_; }

 private:
  const GroundImage& image_;
  std::vector<imaging::GrayImage> grey_, seen_;  ///< from half the size on
};

/// How well a mosaic agrees with the place where a similarity puts it.
struct GroundAgreement {
  geometry::Sim3 T_local_mosaic;  ///< moved, turned and scaled in the plane so that they agree best
  double correlation = 0.0;       ///< of grey values of even contrast
  double heights = 0.0;           ///< share of the heights that agree
  double share = 0.0;             ///< of the mosaic that lies on the place
};

/// The mosaic's grey values against the place's, from coarse to fine: at each size, the motion in the plane that makes
/// them most alike (Lucas and Kanade, IJCAI 1981).
GroundAgreement ground_agreement(const GroundPyramid& mosaic, const GroundPyramid& place,
                                 const geometry::Sim3& T_local_mosaic);

}  // namespace tileflight::localization
