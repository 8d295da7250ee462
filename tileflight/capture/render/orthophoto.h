#pragma once

#include <limits>
#include <memory>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

class Daylight;  // daylight.h

/// A grid of square pixels on the ground, north up, in metres of the local frame.
struct GroundGrid {
  double west_m = 0.0, north_m = 0.0;  ///< of the upper left corner of pixel (0, 0)
  double pixel_m = 1.0;
  int width = 0, height = 0;

  double east_m() const { return west_m + pixel_m * width; }
  double south_m() const { return north_m - pixel_m * height; }
  /// Returns the pixel coordinates of a point, possibly outside the image.
  geometry::Vec2 pixel_at(const geometry::Vec3& place) const {
    return {(place.x() - west_m) / pixel_m - 0.5, (north_m - place.y()) / pixel_m - 0.5};
  }
  /// Returns a part of the grid, starting at pixel (x, y).
  GroundGrid crop(int x, int y, int part_width, int part_height) const {
    return {west_m + pixel_m * x, north_m - pixel_m * y, pixel_m, part_width, part_height};
  }
};

/// A top view of a scene.
struct Orthophoto {
  imaging::RgbImage rgb;
  imaging::FloatImage height_m;  ///< highest surface within the pixel, local frame; NaN if there is none

  Orthophoto() = default;
  Orthophoto(int width, int height)
      : rgb(width, height), height_m(width, height, std::numeric_limits<float>::quiet_NaN()) {}
};

struct OrthophotoOptions {
  int samples_along_axis = 2;                              ///< n x n rays per pixel
  double top_m = std::numeric_limits<double>::infinity();  ///< surfaces above are ignored, such as roofs over interiors
  double bottom_m = -std::numeric_limits<double>::infinity();
  /// Shades surfaces, without shadows, for a place without textures (relief_light()). Null: textures and colours are
  /// shown as they are.
  std::shared_ptr<const Daylight> daylight{};
};

/// Renders an orthographic image with parallel rays straight down. A pixel's colour is the mean, in linear light, over
/// its rays that hit a surface: textures and colours unlit; surfaces with neither are shaded by a light from the
/// north-west. Surfaces that blend show what lies below them. The result does not depend on the number of threads.
/// Throws InputError for a grid without pixels.
Orthophoto render_orthophoto(const scene::Scene& scene, const GroundGrid& grid, const OrthophotoOptions& options = {});

/// Draws points that lie higher than the existing surface, each as a dot large enough to close the gaps between evenly
/// spaced points.
void splat_points(const geometry::PointCloud& cloud, const GroundGrid& grid, const OrthophotoOptions& options,
                  Orthophoto& image);

}  // namespace tileflight::render
