#pragma once

// Pictures whose rows are taken one after the other. A picture's time and pose are those of its middle row. Over its
// readout the camera moves with one velocity, so that row v, at the share s = (v - (H - 1) / 2) / H of the readout, has
//   T_row_middle = exp(s xi),    X_row = exp(s xi) X,
// and where a point lands is the solution of v = v(X_row(s(v))). xi, the motion over a whole readout, is no unknown of
// its own: it follows from the pose and those of the pictures before.

#include <array>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/imaging/image.h"
#include "tileflight/odometry/pyramid.h"

namespace tileflight::odometry {

/// Motion over the readout as a function of the picture's pose: xi = share log(T_target_previous) + offset.
struct RollingShutter {
  double share = 0.0;  ///< of the motion since the previous picture; 0 for a global shutter
  geometry::Vec6 offset = geometry::Vec6::Zero();
  geometry::SE3 T_previous_reference;  ///< to the frame that poses are relative to

  bool is_global() const { return share == 0.0; }
  geometry::Vec6 twist(const geometry::SE3& T_target_reference) const {
    return share * (T_target_reference * T_previous_reference.inverse()).log() + offset;
  }
};

/// What is known of the path before a picture.
struct PathBefore {
  geometry::SE3 T_previous_reference;  ///< pose of the previous picture
  double interval_s = 0.0;             ///< since then
  geometry::SE3 T_previous_earlier;    ///< motion between the previous two pictures,
  double earlier_s = 0.0;              ///< in this time; 0: not known
};

/// The readout of a picture. From one previous picture the velocity is the mean one since then; from two it is brought
/// on to the picture's time by the change between both intervals. `readout_s`: of all rows, negative where the pictures
/// are played backwards. Global where no time has passed.
RollingShutter rolling_shutter(double readout_s, const PathBefore& path);

/// A known inverse distance in a picture.
struct DepthSample {
  Eigen::Vector2f pixel;  ///< level 0
  float rho = 0.0F;
};

/// For each pixel of the picture that a global shutter would have taken at the middle row's time: where the rolling one
/// has it. Displacements are found on a coarse grid, with inverse distances spread from the samples (rotation needs
/// none), and interpolated in between.
class RowRectifier {
 public:
  RowRectifier(const Lens& lens, int width, int height, const geometry::Vec6& twist,
               const std::vector<DepthSample>& samples);

  /// Cubic interpolation (Keys 1981, a = -1/2), so that little contrast is lost; the edge goes on outside. `memory`:
  /// what nobody needs any more, to be overwritten.
  imaging::FloatImage operator()(const PyramidLevel& picture, imaging::FloatImage memory = {}) const;
  imaging::RgbImage operator()(const imaging::RgbImage& picture) const;
  /// Source of a pixel.
  Eigen::Vector2f source(int x, int y) const;

 private:
  /// Calls `row(y, displacements at the columns of cells)` for each row, in parallel.
  template <class Row>
  void for_rows(const Row& row) const;

  int width_, height_;
  int columns_, rows_;
  std::vector<Eigen::Vector2f> displacement_px_;  ///< at the cells' centres, row by row
};

/// Inverse distances of one picture's points in another one.
std::vector<DepthSample> seen_from(const Lens& lens, const geometry::SE3& T_target_reference,
                                   const std::array<std::vector<float>, 3>& rays, const std::vector<float>& rho,
                                   std::size_t count);

}  // namespace tileflight::odometry
