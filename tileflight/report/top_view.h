#pragma once

#include <string>
#include <vector>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/report/drawing.h"
#include "tileflight/report/html.h"
#include "tileflight/report/palette_png.h"

namespace tileflight::report {

/// A piece of ground seen from straight above, north up: metres of the local frame.
struct GroundExtent {
  double west = 0, east = 0, south = 0, north = 0;

  double width_m() const { return east - west; }
  double height_m() const { return north - south; }
};

/// The smallest extent around the points, with a margin, a share of its larger side; outermost `trimmed` share on each
/// side left out.
GroundExtent extent_of(const std::vector<geometry::Vec3>& points, double margin = 0.03, double trimmed = 0.0);
/// Widened about its middle, so that neither side is less than three quarters of the other.
GroundExtent roomy(const GroundExtent& extent);
GroundExtent united(const GroundExtent& a, const GroundExtent& b);

/// Occupied cells as squares, the highest on top, dark green low and light green high.
PaletteImage draw_voxels(const GroundExtent& extent, const geometry::PointCloud& centers, double voxel_m);

/// Points as dots of one colour.
PaletteImage draw_points(const GroundExtent& extent, const std::vector<geometry::Vec3>& points, const Rgba8& color);

/// Points as dots whose colour tells a value from 0 to `highest` (above: as `highest`), the highest point on top.
PaletteImage draw_values(const GroundExtent& extent, const std::vector<geometry::Vec3>& points,
                         const std::vector<float>& values, double highest);

/// The colours of draw_values, from 0 to 1.
Rgba8 value_color(double share);

/// A picture of the whole extent, shown under `name`, a class of the page's style sheet.
struct ImageLayer {
  std::string name;
  PaletteImage image;
};

/// A line over the ground.
struct TrackLayer {
  std::string style;
  std::vector<geometry::Vec3> points;
  bool dots = false;  ///< separate positions instead of a line
};

/// A view from above with axes in metres and a scale bar, as SVG that follows the page's colours.
struct TopView {
  std::string title, description;
  GroundExtent extent;
  std::vector<ImageLayer> images;  ///< from the lowest up
  std::vector<TrackLayer> tracks;  ///< above them
  std::vector<LegendEntry> legend{};
};
Drawing drawing_of(const TopView& view);

/// Bar of colours from 0 to `highest`, with its label.
Drawing color_bar(double highest, const std::string& label);

}  // namespace tileflight::report
