#pragma once

#include <limits>
#include <vector>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/imaging/image.h"
#include "tileflight/scene/scene.h"

namespace tileflight::sensors {

/// Square pixels over the ground, north up: the local frame's metres.
struct GroundGrid {
  double west_m = 0.0, north_m = 0.0;  ///< of the upper left corner of pixel (0, 0)
  double pixel_m = 1.0;
  int width = 0, height = 0;

  double east_m() const { return west_m + pixel_m * width; }
  double south_m() const { return north_m - pixel_m * height; }
  /// The pixel that holds a place; it may lie outside the image.
  geometry::Vec2 pixel_of(const geometry::Vec3& place) const {
    return {(place.x() - west_m) / pixel_m - 0.5, (north_m - place.y()) / pixel_m - 0.5};
  }
  /// A part of it: pixels from (x, y) on.
  GroundGrid part(int x, int y, int part_width, int part_height) const {
    return {west_m + pixel_m * x, north_m - pixel_m * y, pixel_m, part_width, part_height};
  }
};

/// A place from straight above.
struct TopDown {
  imaging::RgbImage rgb;
  imaging::FloatImage height_m;  ///< the highest surface within the pixel, local frame; NaN where there is none

  TopDown() = default;
  TopDown(int width, int height)
      : rgb(width, height), height_m(width, height, std::numeric_limits<float>::quiet_NaN()) {}
};

struct TopDownOptions {
  int samples_along_axis = 2;  ///< n x n rays a pixel
  double top_m =
      std::numeric_limits<double>::infinity();  ///< what is higher is not there: roofs of what is looked into
  double bottom_m = -std::numeric_limits<double>::infinity();
};

/// Casts parallel rays straight down (an orthographic picture). A pixel's colour is the mean, in linear light, of those
/// of its rays that meet a surface: of textures and colours as they are, and of what has neither by a light from the
/// north-west. The same for any number of threads. Throws InputError for a grid without pixels.
TopDown render_top_down(const scene::Scene& scene, const GroundGrid& grid, const TopDownOptions& options = {});

/// Adds points where they lie higher than what is there, each as a dot that fills what is between them where they are
/// even.
void add_points(const geometry::PointCloud& cloud, const GroundGrid& grid, const TopDownOptions& options,
                TopDown& image);

}  // namespace tileflight::sensors
