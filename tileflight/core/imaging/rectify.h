#pragma once

#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::imaging {

/// Resamples images of one lens to another lens at the same position and orientation.
class Rectifier {
 public:
  Rectifier(const Camera& from, const Camera& to);

  /// Interpolates bilinearly; 0 (black) outside the first lens's view. The image must have the size of `from`.
  RgbImage operator()(const RgbImage& picture) const;
  GrayImage operator()(const GrayImage& picture) const;
  FloatImage operator()(const FloatImage& picture) const;

 private:
  Camera from_, to_;
  Image<std::array<float, 2>> source_;  ///< pixel of `from` for each pixel of `to`; negative: none
};

}  // namespace tileflight::imaging
