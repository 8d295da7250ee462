#pragma once

// Rolling-shutter model. The time and pose of an image are those of its middle row. The camera's velocity is constant
// during the readout, so row v, at the share s = (v - (H - 1) / 2) / H of the readout, has
//   T_row_middle = exp(s xi),    X_row = exp(s xi) X,
// and a point projects to the row that solves v = v(X_row(s(v))). xi, the motion over a whole readout, is not a
// separate unknown: it follows from the pose of the image and those of the images before.

#include <array>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::keyframes {

/// Motion over the readout as a function of the image's pose: xi = share log(T_target_previous) + offset.
struct RollingShutter {
  double motion_share = 0.0;  ///< share of the motion since the previous image; 0 for a global shutter
  geometry::Vec6 offset = geometry::Vec6::Zero();
  geometry::SE3 T_previous_reference;  ///< pose of the previous image in the reference frame

  bool is_global() const { return motion_share == 0.0; }
  geometry::Vec6 twist(const geometry::SE3& T_target_reference) const {
    return motion_share * (T_target_reference * T_previous_reference.inverse()).log() + offset;
  }
};

/// Poses and intervals before an image.
struct MotionHistory {
  geometry::SE3 T_previous_reference;  ///< pose of the previous image
  double interval_s = 0.0;             ///< since then
  geometry::SE3 T_previous_earlier;    ///< motion between the previous two images
  double earlier_interval_s = 0.0;     ///< time between them; 0: unknown
};

/// Rolling-shutter model of an image. With one previous image the velocity is the mean since that image; with two it is
/// extrapolated to the image's time from the change between both intervals. `readout_s`: readout time of all rows,
/// seconds, negative if the images are played backwards. Returns a global shutter if no time has passed.
RollingShutter make_rolling_shutter(double readout_s, const MotionHistory& path);

/// A known inverse distance at a pixel.
struct DepthSample {
  Eigen::Vector2f pixel;  ///< level 0
  float rho = 0.0F;
};

/// Maps each pixel of the image that a global shutter would have taken at the middle row's time to its pixel in the
/// rolling-shutter image. Displacements are computed on a coarse grid, with inverse distances interpolated from the
/// samples (rotation needs none), and interpolated in between.
class RowRectifier {
 public:
  RowRectifier(const Lens& lens, int width, int height, const geometry::Vec6& twist,
               const std::vector<DepthSample>& samples);

  /// Rectifies an image by cubic interpolation (Keys 1981, a = -1/2), which loses little contrast; border pixels are
  /// repeated outside. `memory`: an image no longer needed, whose storage is reused.
  imaging::FloatImage operator()(const PyramidLevel& picture, imaging::FloatImage memory = {}) const;
  imaging::RgbImage operator()(const imaging::RgbImage& picture) const;
  /// Source pixel of a rectified pixel.
  Eigen::Vector2f source_pixel(int x, int y) const;

 private:
  /// Calls `row(y, displacements at the columns of cells)` for each row, in parallel.
  template <class Row>
  void for_rows(const Row& row) const;

  int width_, height_;
  int columns_, rows_;
  std::vector<Eigen::Vector2f> displacement_px_;  ///< at the cells' centres, row by row
};

/// Transforms points of one image with known inverse distances into another image; the first `count` points.
std::vector<DepthSample> transform_depth_samples(const Lens& lens, const geometry::SE3& T_target_reference,
                                                 const std::array<std::vector<float>, 3>& rays,
                                                 const std::vector<float>& rho, std::size_t count);

}  // namespace tileflight::keyframes
