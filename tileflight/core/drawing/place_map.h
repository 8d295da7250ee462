#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/drawing/top_view.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::drawing {

/// Returns the map's colour of a height, given as a fraction 0 to 1 of the displayed range.
imaging::Rgb8 height_color(double share);

/// Computes hill shading with light from the north-west, relative to flat ground (1); NaN where there is no surface.
imaging::FloatImage hill_shade(const imaging::FloatImage& heights_m, double pixel_m);

/// The ground seen vertically from above, north up.
struct GroundImage {
  GroundExtent extent;
  imaging::RgbImage colors;
  imaging::FloatImage heights_m;  ///< in the local frame; NaN where there is no surface
};

/// A polygon of the map.
struct MapOutline {
  enum class Kind { kProposedRegion, kMissingTile };
  Kind kind = Kind::kProposedRegion;
  std::vector<geometry::Vec2> corners;  ///< east, north
};

/// The part of the ground visible in one frame of a flight.
struct ViewFootprint {
  std::string name;                       ///< "first"
  geometry::Vec3 position;                ///< of the camera
  std::vector<geometry::Vec2> footprint;  ///< outline, east, north; empty: no ground is visible
};

/// A flight drawn over the map.
struct FlightOverlay {
  std::vector<geometry::Vec3> positions;  ///< camera position of each frame
  std::vector<geometry::Vec2>
      headings;  ///< horizontal component (east, north) of the unit viewing direction; zero: straight down
  std::vector<std::size_t> colliding_frames;  ///< frames inside a surface, or whose path segment intersects one
  std::vector<ViewFootprint> views;
};

/// A map of a place: its orthophoto beside its heights, each with a grid in metres of the local frame and, if the place
/// is georeferenced, one in degrees. Areas without a surface are hatched.
struct PlaceMap {
  std::string title;
  std::vector<std::string> notes;  ///< lines below the title
  std::string attribution;
  GroundImage ground;
  std::optional<geometry::LocalFrame> frame;
  std::vector<MapOutline> outlines;
  std::optional<FlightOverlay> flight;
};

/// Draws the map as an image.
imaging::RgbImage draw_to_image(const PlaceMap& map);

/// A crossing of a round parallel or meridian with a side of an extent: its distance along the side in metres (east of
/// the west end, or north of the south end) and its degrees. `meridians`: crossings with the north side; else parallels
/// along the east side.
struct DegreeTick {
  double along_m = 0.0;
  double degrees = 0.0;
  double step = 1.0;  ///< spacing of neighbouring ticks, degrees
};
std::vector<DegreeTick> degree_ticks(const GroundExtent& extent, const geometry::LocalFrame& frame, bool meridians,
                                     int count);

}  // namespace tileflight::drawing
