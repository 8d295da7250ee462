#pragma once

// Image pyramid with gradients, read by every photometric residual.

#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

#include "tileflight/core/base/simd.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/photometric.h"
#include "tileflight/slam/keyframes/lens.h"
#include "tileflight/slam/keyframes/options.h"

namespace tileflight::keyframes {

/// Intensity (grey values), its central differences (grey values per pixel), and the squared gradient.
using Texel = base::Float4;
enum TexelPart { kIntensity = 0, kGradX = 1, kGradY = 2, kGradSquared = 3 };

/// One pyramid level. It stores grey values only; gradients are computed on access, because few pixels are read. Pixel
/// (x, y) is grey[y * width + x]; its centre is at (x, y).
struct PyramidLevel {
  /// Values after the last pixel, so that four values can be loaded at any pixel that may be sampled.
  static constexpr std::size_t kPadding = 4;

  int width = 0;
  int height = 0;
  std::vector<float> grey;  ///< row by row, with the padding

  const float* row(int y) const { return grey.data() + static_cast<std::size_t>(y) * width; }
  float* row(int y) { return grey.data() + static_cast<std::size_t>(y) * width; }
  float intensity(int x, int y) const { return row(y)[x]; }
  /// Squared gradient; (x, y) must not be on the edge.
  float gradient_squared(int x, int y) const {
    const float* p = row(y) + x;
    const float gx = 0.5F * (p[1] - p[-1]), gy = 0.5F * (p[width] - p[-width]);
    return gx * gx + gy * gy;
  }
  /// Intensity and gradients at a whole pixel; the gradient is zero on the border.
  Texel at(int x, int y) const {
    const float* p = row(y) + x;
    if (x == 0 || y == 0 || x == width - 1 || y == height - 1) return Texel{*p, 0.0F, 0.0F, 0.0F};
    const float gx = 0.5F * (p[1] - p[-1]), gy = 0.5F * (p[width] - p[-width]);
    return Texel{*p, gx, gy, gx * gx + gy * gy};
  }
  /// Returns whether (x, y) is at least `margin` pixels inside the outermost pixel centres.
  bool inside(float x, float y, float margin) const {
    return x >= margin && y >= margin && x < static_cast<float>(width - 1) - margin &&
           y < static_cast<float>(height - 1) - margin;
  }
  /// Bilinear interpolation of intensity and of the central differences (the fourth part is 0); (x, y) must be
  /// inside(x, y, 1).
  Texel sample(float x, float y) const {
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const float dx = x - static_cast<float>(ix), dy = y - static_cast<float>(iy);
    const float* p = row(iy) + ix - 1;
    const Texel above = load_float4(p - width), top = load_float4(p), bottom = load_float4(p + width),
                below = load_float4(p + 2 * width);
    const Texel here = top + dy * (bottom - top);  // at columns ix - 1 ... ix + 2
    const Texel down = (bottom - above) + dy * ((below - top) - (bottom - above));
    const float left = here[2] - here[0], right = here[3] - here[1];
    return Texel{here[1] + dx * (here[2] - here[1]), 0.5F * (left + dx * (right - left)),
                 0.5F * (down[1] + dx * (down[2] - down[1])), 0.0F};
  }
  /// Bilinear interpolation of the intensity; (x, y) must be inside(x, y, 0).
  float sample_intensity(float x, float y) const {
    const int ix = static_cast<int>(x), iy = static_cast<int>(y);
    const float dx = x - static_cast<float>(ix), dy = y - static_cast<float>(iy);
    const float* p = row(iy) + ix;
    const float top = p[0] + dx * (p[1] - p[0]), bottom = p[width] + dx * (p[width + 1] - p[width]);
    return top + dy * (bottom - top);
  }

 private:
  static Texel load_float4(const float* p) {
    Texel out;
    std::memcpy(&out, p, sizeof(out));
    return out;
  }
};

/// Level 0 is the full image; each further level has half the size, each pixel the mean of four.
struct Pyramid {
  std::vector<PyramidLevel> levels;
};

/// Number of levels for an image of this size.
int pyramid_levels(int width, int height, const OdometryOptions& options);

/// Grey values 0..255 as irradiance: luma of Rec. 601 (not rounded), then I = G^-1(luma) / V where a calibration is
/// given (DSO, section 2.1, eq. 2 and 3). `memory`: an image no longer needed, whose storage is reused.
imaging::FloatImage luminance(const imaging::RgbImage& image, const imaging::PhotometricCalibration* photometric,
                              imaging::FloatImage memory = {});

/// Makes an image in the storage of `memory`, with room for a pyramid's padding; its pixel values are undefined.
imaging::FloatImage make_image_in(imaging::FloatImage memory, int width, int height);

/// Builds a pyramid on `image`. `memory`: a pyramid no longer needed; the storage of its levels but the first is
/// reused.
Pyramid build_pyramid(imaging::FloatImage image, int levels, Pyramid memory = {});

/// Builds pyramids in the storage of released ones, so that a flight allocates none once its window is full.
class PyramidPool {
 public:
  /// Pyramid of an image's luminance.
  std::shared_ptr<const Pyramid> make(const imaging::RgbImage& image,
                                      const imaging::PhotometricCalibration* photometric, int levels);
  /// Pyramid of the image that `picture` returns, given storage to reuse.
  std::shared_ptr<const Pyramid> make(const std::function<imaging::FloatImage(imaging::FloatImage memory)>& picture,
                                      int levels);

 private:
  /// Outlives the pool as long as any of its pyramids is in use.
  struct Store {
    std::mutex mutex;
    std::vector<Pyramid> free;
  };
  Pyramid acquire();

  std::shared_ptr<Store> store_ = std::make_shared<Store>();
};

/// Unit ray of each pixel of a level; zero outside the lens model's valid domain.
struct RayTable {
  int width = 0;
  int height = 0;
  std::vector<Eigen::Vector3f> rays;  ///< row by row

  const Eigen::Vector3f& at(int x, int y) const { return rays[static_cast<std::size_t>(y) * width + x]; }
};

/// The lens at each pyramid level with its rays. Built once for a sequence.
struct LensPyramid {
  std::vector<Lens> lenses;    ///< with the estimated focal lengths and principal point
  std::vector<RayTable> rays;  ///< of the camera as it was given

  /// Unit ray of a pixel by `lenses[level]`; zero where `rays` is zero.
  Eigen::Vector3f ray(std::size_t level, int x, int y) const;
};
LensPyramid build_lens_pyramid(const imaging::Camera& camera, int levels);

/// Sets the change of focal lengths and principal point relative to the given camera (lens.h).
void set_intrinsics_delta(LensPyramid& lens, const IntrinsicsDelta& delta);

}  // namespace tileflight::keyframes
