#include "tileflight/tiles/demo_place/chart.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace tileflight::demo_place {
namespace {

std::size_t cells_along(double length_m, double cell_m) {
  return static_cast<std::size_t>(std::max(1.0, std::ceil(length_m / cell_m - 1e-9)));
}

}  // namespace

std::vector<double> even_positions(double length_m, std::size_t count) {
  std::vector<double> places(count + 1);
  for (std::size_t i = 0; i <= count; ++i) places[i] = length_m * static_cast<double>(i) / static_cast<double>(count);
  return places;
}

std::vector<double> arc_lengths(const std::vector<Vec3>& points) {
  std::vector<double> lengths(points.size(), 0.0);
  for (std::size_t i = 1; i < points.size(); ++i) lengths[i] = lengths[i - 1] + (points[i] - points[i - 1]).norm();
  return lengths;
}

Chart make_panel(const Vec3& corner, const Vec3& along_s, const Vec3& along_t, Painter paint, double cell_m) {
  Chart chart;
  const double width_m = along_s.norm(), height_m = along_t.norm();
  chart.s_m = even_positions(width_m, cells_along(width_m, cell_m));
  chart.t_m = even_positions(height_m, cells_along(height_m, cell_m));
  for (const double t : chart.t_m)
    for (const double s : chart.s_m) chart.vertices.push_back(corner + s / width_m * along_s + t / height_m * along_t);
  chart.paint = std::move(paint);
  return chart;
}

Chart make_sweep(const Vec3& start, const Vec3& sweep, const Vec3& out, const std::vector<Vec2>& profile, Painter paint,
                 double cell_m) {
  Chart chart;
  const double length_m = sweep.norm();
  chart.s_m = even_positions(length_m, cells_along(length_m, cell_m));
  std::vector<Vec3> places;
  for (const Vec2& p : profile) places.push_back(start + p.x() * out + p.y() * Vec3::UnitZ());
  chart.t_m = arc_lengths(places);
  for (const Vec3& place : places)
    for (const double s : chart.s_m) chart.vertices.push_back(place + s / length_m * sweep);
  chart.paint = std::move(paint);
  return chart;
}

std::vector<Chart> make_box(const Vec3& low, const Vec3& high, const Painter& wall, const Painter& roof,
                            double cell_m) {
  const Vec3 size = high - low;
  const Vec3 along_x(size.x(), 0, 0), along_y(0, size.y(), 0), up(0, 0, size.z());
  std::vector<Chart> charts;
  charts.push_back(make_panel(low, along_x, up, wall, cell_m));
  charts.push_back(make_panel(low + along_x, along_y, up, wall, cell_m));
  charts.push_back(make_panel(low + along_x + along_y, -along_x, up, wall, cell_m));
  charts.push_back(make_panel(low + along_y, -along_y, up, wall, cell_m));
  charts.push_back(make_panel(low + up, along_x, along_y, roof, cell_m));
  return charts;
}

Chart make_post(const Vec3& foot, double height_m, double radius_m, int sides, Painter paint) {
  Chart chart;
  chart.s_m = even_positions(2 * std::numbers::pi * radius_m, static_cast<std::size_t>(sides));
  chart.t_m = {0.0, height_m, height_m + radius_m};
  for (const double t : chart.t_m) {
    const double radius = t > height_m ? 0.0 : radius_m;
    for (int i = 0; i <= sides; ++i) {
      const double angle = 2 * std::numbers::pi * (i % sides) / sides;
      chart.vertices.push_back(foot + Vec3(radius * std::cos(angle), radius * std::sin(angle), std::min(t, height_m)));
    }
  }
  chart.paint = std::move(paint);
  return chart;
}

}  // namespace tileflight::demo_place
