#pragma once

// A picture at several sizes, with gradients: what every photometric residual reads.

#include <cstdint>
#include <memory>
#include <vector>

#include "tileflight/imaging/image.h"
#include "tileflight/imaging/photometric.h"
#include "tileflight/odometry/lens.h"
#include "tileflight/odometry/options.h"

namespace tileflight::odometry {

/// Intensity (grey values), its central differences (grey values a pixel), and the squared gradient.
using Texel = float __attribute__((vector_size(16)));
enum TexelPart { kIntensity = 0, kGradX = 1, kGradY = 2, kGradSquared = 3 };

/// One size of the picture. Texel (x, y) is texels[y * width + x]; its centre is at (x, y).
struct PyramidLevel {
  int width = 0;
  int height = 0;
  std::vector<Texel> texels;

  const Texel& at(int x, int y) const { return texels[static_cast<std::size_t>(y) * width + x]; }
  /// Whether (x, y) is at least `margin` pixels inside the outermost pixel centres.
  bool inside(float x, float y, float margin) const {
    return x >= margin && y >= margin && x < static_cast<float>(width - 1) - margin &&
           y < static_cast<float>(height - 1) - margin;
  }
  /// Bilinear; (x, y) must be inside(x, y, 0).
  Texel sample(float x, float y) const {
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const float dx = x - static_cast<float>(ix), dy = y - static_cast<float>(iy);
    const Texel* p = texels.data() + static_cast<std::size_t>(iy) * width + ix;
    const float dxy = dx * dy;
    return p[0] * (1.0F - dx - dy + dxy) + p[1] * (dx - dxy) + p[width] * (dy - dxy) + p[width + 1] * dxy;
  }
};

/// Level 0 is the picture; each further level is half the size, every pixel the mean of four.
struct Pyramid {
  std::vector<PyramidLevel> levels;
};

/// Number of levels for a picture of this size.
int pyramid_levels(int width, int height, const OdometryOptions& options);

/// Grey values 0..255 as irradiance: luma of Rec. 601 (not rounded), then I = G^-1(luma) / V where a calibration is
/// given (section 2.1, eq. 2 and 3, of the paper).
imaging::FloatImage luminance(const imaging::RgbImage& image, const imaging::PhotometricCalibration* photometric);

Pyramid build_pyramid(const imaging::FloatImage& image, int levels);

/// Unit ray of each pixel of a level; zero where the lens model does not hold.
struct RayTable {
  int width = 0;
  int height = 0;
  std::vector<Eigen::Vector3f> rays;  ///< row by row

  const Eigen::Vector3f& at(int x, int y) const { return rays[static_cast<std::size_t>(y) * width + x]; }
};

/// The lens at each pyramid level with its rays. Made once a sequence.
struct LensPyramid {
  std::vector<Lens> lenses;
  std::vector<RayTable> rays;
};
LensPyramid build_lens_pyramid(const imaging::Camera& camera, int levels);

}  // namespace tileflight::odometry
