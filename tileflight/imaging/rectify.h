#pragma once

#include "tileflight/imaging/camera.h"
#include "tileflight/imaging/image.h"

namespace tileflight::imaging {

/// Pictures of one lens as another would have taken them from the same place, looking the same way.
class Rectifier {
 public:
  Rectifier(const Camera& from, const Camera& to);

  const Camera& camera() const { return to_; }
  /// Bilinear; 0 (black) where the first lens does not see. The picture must have the first lens's size.
  RgbImage operator()(const RgbImage& picture) const;
  GrayImage operator()(const GrayImage& picture) const;
  FloatImage operator()(const FloatImage& picture) const;

 private:
  Camera from_, to_;
  Image<std::array<float, 2>> source_;  ///< pixel of `from` for each pixel of `to`; below 0 where there is none
};

}  // namespace tileflight::imaging
