#pragma once

#include <string>
#include <vector>

#include "tileflight/core/drawing/drawing.h"
#include "tileflight/core/drawing/html.h"
#include "tileflight/core/drawing/page_image.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::drawing {

/// A rectangle of ground seen from above, north up: metres in the local frame.
struct GroundExtent {
  double west = 0, east = 0, south = 0, north = 0;

  double width_m() const { return east - west; }
  double height_m() const { return north - south; }
};

/// Returns the smallest extent around the points, with a margin given as a share of its larger side, ignoring the
/// outermost `trimmed` share on each side.
GroundExtent fit_extent(const std::vector<geometry::Vec3>& points, double margin = 0.03, double trimmed = 0.0);
/// Widens the extent about its centre so that neither side is less than three quarters of the other.
GroundExtent limit_aspect_ratio(const GroundExtent& extent);
/// Returns the smallest extent that contains both.
GroundExtent merge_extents(const GroundExtent& a, const GroundExtent& b);

/// Draws occupied cells as squares, the highest on top, dark green for low and light green for high ones.
PaletteImage draw_voxels(const GroundExtent& extent, const geometry::PointCloud& centers, double voxel_m);

/// Draws points as dots in one colour.
PaletteImage draw_points(const GroundExtent& extent, const std::vector<geometry::Vec3>& points, const Rgba8& color);

/// Draws points as dots coloured by a value from 0 to `highest` (clamped), the highest point on top.
PaletteImage draw_values(const GroundExtent& extent, const std::vector<geometry::Vec3>& points,
                         const std::vector<float>& values, double highest);

/// Returns the colour of a share from 0 to 1 in the scale of draw_values().
Rgba8 value_color(double share);

/// An image of the whole extent; `name` is a class of the page's style sheet.
struct ImageLayer {
  std::string name;
  PaletteImage image;
};

/// A line drawn over the ground.
struct TrackLayer {
  std::string style;
  std::vector<geometry::Vec3> points;
  bool dots = false;  ///< separate positions instead of a connected line
};

/// A view from above with axes in metres and a scale bar, as SVG in the page's colours.
struct TopView {
  std::string title, description;
  GroundExtent extent;
  std::vector<ImageLayer> images;  ///< bottom layer first
  std::vector<TrackLayer> tracks;  ///< drawn above the images
  std::vector<LegendEntry> legend{};
  std::string x_label = "east, m", y_label = "north, m";
};
/// Draws the view with axes and a scale bar.
Drawing to_drawing(const TopView& view);

/// Draws a colour bar from 0 to `highest`, with its label.
Drawing color_bar(double highest, const std::string& label);

}  // namespace tileflight::drawing
