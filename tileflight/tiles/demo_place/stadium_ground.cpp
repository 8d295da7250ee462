#include <cmath>

#include "tileflight/tiles/demo_place/ground_paint.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

constexpr double kCell_m = 1.0;

/// Finer near the flight area.
double ground_texel_m(const Rect& part) {
  const double away_m = part.center().cwiseAbs().maxCoeff();
  return away_m < 100 ? 0.05 : away_m < 150 ? 0.0625 : 0.1;
}

Chart make_part(const SitePlan& plan, const Terrain& terrain, const Rect& part) {
  Chart chart;
  const auto cells = static_cast<std::size_t>(std::lround((part.x1 - part.x0) / kCell_m));
  chart.s_m = even_positions(part.x1 - part.x0, cells);
  chart.t_m = even_positions(part.y1 - part.y0, cells);
  for (const double t : chart.t_m) {
    for (const double s : chart.s_m) {
      chart.vertices.push_back(terrain.point(part.x0 + s, part.y0 + t));
      chart.normals.push_back(terrain.normal(part.x0 + s, part.y0 + t));
    }
  }
  for (std::size_t row = 0; row < cells; ++row)
    for (std::size_t column = 0; column < cells; ++column)
      chart.hole.push_back(plan.is_built(part.x0 + (static_cast<double>(column) + 0.5) * kCell_m,
                                         part.y0 + (static_cast<double>(row) + 0.5) * kCell_m));
  chart.paint = ground_painter(plan, part);
  chart.texel_m = ground_texel_m(part);
  return chart;
}

}  // namespace

std::vector<Chart> make_ground(const SitePlan& plan, const Terrain& terrain, double tile_m) {
  std::vector<Chart> charts;
  for (double y = -kSiteHalf_m; y < kSiteHalf_m - 1e-6; y += tile_m)
    for (double x = -kSiteHalf_m; x < kSiteHalf_m - 1e-6; x += tile_m)
      charts.push_back(make_part(plan, terrain, {x, y, x + tile_m, y + tile_m}));
  return charts;
}

}  // namespace tileflight::demo_place
