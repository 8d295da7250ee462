#pragma once

#include <functional>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/tiling/materials.h"

namespace tileflight::tiling {

using geometry::Vec2;
using geometry::Vec3;

/// What a painter is asked about: one texel of a chart.
struct Texel {
  double s_m = 0.0, t_m = 0.0;   ///< place on the chart
  Vec3 position = Vec3::Zero();  ///< place in the site, metres
  Vec3 normal = Vec3::UnitZ();   ///< unit, outward
};

/// Colour of a texel before sun and shadow.
using Painter = std::function<Color(const Texel&)>;

/// A piece of surface that unrolls into a rectangle: a grid of vertices with places (s, t) in metres on it, and its
/// paint. Seen from outside, t is counter-clockwise of s. Everything in the built-in place is made of charts.
struct Chart {
  std::vector<double> s_m;     ///< columns' places, increasing from 0
  std::vector<double> t_m;     ///< rows' places, increasing from 0
  std::vector<Vec3> vertices;  ///< row by row: vertices[row * columns() + column]; site frame, metres
  std::vector<Vec3> normals;   ///< as vertices, unit, for round things; empty: flat cells
  std::vector<bool> hole;      ///< cells that are left out, row by row; empty: none
  Painter paint;
  double texel_m = 0.05;  ///< edge of a texel at texture scale 1
  bool thin = false;      ///< too slender for photogrammetry to keep (fences, posts)

  std::size_t columns() const { return s_m.size(); }
  std::size_t rows() const { return t_m.size(); }
  const Vec3& vertex(std::size_t column, std::size_t row) const { return vertices[row * columns() + column]; }
};

/// Flat or bent rectangle from `corner` along two edges, cut into cells of at most `cell_m`.
Chart make_panel(const Vec3& corner, const Vec3& along_s, const Vec3& along_t, Painter paint, double cell_m = 4.0);

/// A profile swept along a line: `profile` has places (out, up), metres from `start`; t runs along the profile, s along
/// the sweep.
Chart make_sweep(const Vec3& start, const Vec3& sweep, const Vec3& out, const std::vector<Vec2>& profile, Painter paint,
                 double cell_m);

/// An upright box without floor: four walls (s to the right, t up, seen from outside) and a roof (s, t along x, y).
std::vector<Chart> make_box(const Vec3& low, const Vec3& high, const Painter& wall, const Painter& roof,
                            double cell_m = 4.0);

/// Slender upright prism with `sides` faces as one chart, closed at the top.
Chart make_post(const Vec3& foot, double height_m, double radius_m, int sides, Painter paint);

/// Distances along a polyline, from 0.
std::vector<double> arc_lengths(const std::vector<Vec3>& points);

/// `count` + 1 even places from 0 to `length_m`.
std::vector<double> even_places(double length_m, std::size_t count);

}  // namespace tileflight::tiling
