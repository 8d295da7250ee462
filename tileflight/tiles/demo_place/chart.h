#pragma once

#include <functional>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/tiles/demo_place/materials.h"

namespace tileflight::demo_place {

using geometry::Vec2;
using geometry::Vec3;

/// Input of a painter: one texel of a chart.
struct Texel {
  double s_m = 0.0, t_m = 0.0;   ///< position on the chart
  Vec3 position = Vec3::Zero();  ///< position in the site frame, metres
  Vec3 normal = Vec3::UnitZ();   ///< unit, outward
};

/// Returns the colour of a texel before sunlight and shadow.
using Painter = std::function<Color(const Texel&)>;

/// A piece of surface that unrolls into a rectangle: a grid of vertices with coordinates (s, t) in metres, and its
/// paint. Seen from outside, t is counter-clockwise from s. Everything in the built-in site is made of charts.
struct Chart {
  std::vector<double> s_m;     ///< s of the columns, increasing from 0
  std::vector<double> t_m;     ///< t of the rows, increasing from 0
  std::vector<Vec3> vertices;  ///< row by row: vertices[row * columns() + column]; site frame, metres
  std::vector<Vec3> normals;   ///< unit, one for each vertex, for smooth shading; empty: flat cells
  std::vector<bool> hole;      ///< cells left out, row by row; empty: none
  Painter paint;
  double texel_m = 0.05;  ///< edge of a texel at texture scale 1
  bool thin = false;      ///< too slender to survive photogrammetry (fences, posts)

  std::size_t columns() const { return s_m.size(); }
  std::size_t rows() const { return t_m.size(); }
  const Vec3& vertex(std::size_t column, std::size_t row) const { return vertices[row * columns() + column]; }
};

/// Makes a rectangle from `corner` along two edges, cut into cells of at most `cell_m`.
Chart make_panel(const Vec3& corner, const Vec3& along_s, const Vec3& along_t, Painter paint, double cell_m = 4.0);

/// Sweeps a profile along a line: `profile` has points (out, up), metres from `start`; t runs along the profile, s
/// along the sweep.
Chart make_sweep(const Vec3& start, const Vec3& sweep, const Vec3& out, const std::vector<Vec2>& profile, Painter paint,
                 double cell_m);

/// Makes an upright box without floor: four walls (s to the right, t up, seen from outside) and a roof (s, t along x,
/// y).
std::vector<Chart> make_box(const Vec3& low, const Vec3& high, const Painter& wall, const Painter& roof,
                            double cell_m = 4.0);

/// Makes a slender upright prism with `sides` faces as one chart, closed at the top.
Chart make_post(const Vec3& foot, double height_m, double radius_m, int sides, Painter paint);

/// Returns the arc lengths of the points of a polyline, from 0.
std::vector<double> arc_lengths(const std::vector<Vec3>& points);

/// Returns `count` + 1 evenly spaced positions from 0 to `length_m`.
std::vector<double> even_positions(double length_m, std::size_t count);

}  // namespace tileflight::demo_place
