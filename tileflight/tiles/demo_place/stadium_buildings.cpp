#include <array>
#include <cmath>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

constexpr double kParapet_m = 0.7, kParapetWidth_m = 0.35, kReveal_m = 0.07;

/// Division of a style's walls: storeys and bays, the window in each, and its depth.
struct Facade {
  double storey_m, bay_m;
  double left, right, bottom, top;  ///< window within its bay and storey, as fractions
  double depth_m;
  Color wall, band;
};

Facade facade_of(BuildingStyle style) {
  switch (style) {
    case BuildingStyle::kBrickHall:
      return {3.6, 3.3, 0.26, 0.74, 0.28, 0.80, 0.22, {0.58F, 0.32F, 0.24F}, {0.76F, 0.72F, 0.64F}};
    case BuildingStyle::kConcreteDeck:
      return {3.1, 8.0, 0.06, 0.94, 0.38, 0.86, 0.60, {0.66F, 0.63F, 0.58F}, {0.60F, 0.57F, 0.52F}};
    case BuildingStyle::kGlassOffice:
      return {3.9, 2.6, 0.10, 0.90, 0.20, 0.90, 0.12, {0.70F, 0.69F, 0.66F}, {0.42F, 0.44F, 0.46F}};
    case BuildingStyle::kConcession:
      return {4.5, 4.0, 0.18, 0.82, 0.22, 0.58, 0.35, {0.62F, 0.37F, 0.28F}, {0.12F, 0.32F, 0.22F}};
    case BuildingStyle::kPressBox:
      return {3.4, 3.2, 0.08, 0.92, 0.25, 0.85, 0.25, {0.60F, 0.34F, 0.26F}, {0.82F, 0.80F, 0.75F}};
    case BuildingStyle::kPlaster:
      return {2.9, 2.5, 0.30, 0.70, 0.30, 0.80, 0.14, {0.80F, 0.75F, 0.65F}, {0.70F, 0.66F, 0.60F}};
    case BuildingStyle::kFieldHouse:
      return {4.4, 5.0, 0.22, 0.78, 0.35, 0.75, 0.25, {0.55F, 0.31F, 0.24F}, {0.76F, 0.72F, 0.64F}};
  }
  return {};
}

struct Division {
  int count;
  double size_m;
};

Division divide(double length_m, double wanted_m) {
  const int count = std::max(1, static_cast<int>(length_m / wanted_m + 0.5));
  return {count, length_m / count};
}

/// Grid coordinates of a wall along one direction: for each bay its start and both sides of both reveals of its window.
std::vector<double> bay_knots(double from_m, const Division& bays, double low, double high) {
  std::vector<double> knots;
  if (from_m > 0) knots.push_back(0.0);
  for (int i = 0; i < bays.count; ++i) {
    const double start = from_m + i * bays.size_m, a = start + low * bays.size_m, b = start + high * bays.size_m;
    knots.insert(knots.end(), {start, a, a + kReveal_m, b - kReveal_m, b});
  }
  knots.push_back(from_m + bays.count * bays.size_m);
  return knots;
}

/// Whether a knot of bay_knots lies on the recessed pane.
bool is_sunk(std::size_t knot, bool skirt) {
  const std::size_t i = knot - (skirt ? 1 : 0);
  return (!skirt || knot > 0) && (i % 5 == 2 || i % 5 == 3);
}

Color pane_color(const Texel& texel, double bay, double storey, BuildingStyle style, std::uint32_t seed) {
  if (style == BuildingStyle::kConcreteDeck)
    return Color(0.13F, 0.13F, 0.14F) * (1.0F + 0.4F * base::fractal_noise(texel.s_m, texel.t_m, seed, 3));
  const float one = base::cell_random(bay, storey, seed + 1);
  Color color = material::glass(texel.s_m, texel.t_m, seed + 2) * (0.8F + 0.6F * one);
  if (one > 0.62F)
    color = mix_colors(color, {0.70F, 0.67F, 0.58F},
                       0.5F * one * (0.7F + 0.3F * band_coverage(texel.t_m, 0.2, 0.1)));  // blinds
  const float bars = std::max(band_coverage(texel.s_m, 0.85, 0.07), band_coverage(texel.t_m, 1.2, 0.07));
  return mix_colors(color, {0.78F, 0.77F, 0.74F}, 0.8F * bars);
}

/// Paint of a wall whose ground line is at t = `skirt_m`.
struct FacadePaint {
  Facade facade;
  Division bays, storeys;
  double skirt_m = 0.0;
  BuildingStyle style = BuildingStyle::kBrickHall;
  std::uint32_t seed = 0;

  Color operator()(const Texel& texel) const {
    const double t = texel.t_m - skirt_m;
    const double bay = std::floor(texel.s_m / bays.size_m), storey = std::floor(t / storeys.size_m);
    const double u = texel.s_m / bays.size_m - bay, v = t / storeys.size_m - storey;
    const bool pane =
        t > 0 && storey < storeys.count && u > facade.left && u < facade.right && v > facade.bottom && v < facade.top;
    if (pane) return pane_color(texel, bay, storey, style, seed);
    const bool lintel =
        u > facade.left - 0.05 && u < facade.right + 0.05 && (v > facade.bottom - 0.06 && v < facade.top + 0.09);
    const bool cornice = v > 0.96 || v < 0.015 || (t > 0 && t < 0.8);
    const std::uint32_t own = seed + 31U;
    if (lintel || cornice) return material::concrete(texel.s_m, t, 1.65, own) * (facade.band / 0.64F).min(1.25F);
    if (style == BuildingStyle::kGlassOffice || style == BuildingStyle::kConcreteDeck)
      return material::concrete(texel.s_m, t, 2.6, own) * (facade.wall / 0.66F);
    if (style == BuildingStyle::kPlaster) return material::plaster(texel.s_m, t, own);
    return material::brick(texel.s_m, t, facade.wall, own);
  }
};

}  // namespace

Chart make_wall(const Vec3& corner, const Vec3& along, double height_m, double skirt_m, BuildingStyle style,
                std::uint32_t seed) {
  const Facade facade = facade_of(style);
  const FacadePaint paint{facade, divide(along.norm(), facade.bay_m), divide(height_m, facade.storey_m), skirt_m, style,
                          seed};
  Chart chart;
  chart.s_m = bay_knots(0.0, paint.bays, facade.left, facade.right);
  chart.t_m = bay_knots(skirt_m, paint.storeys, facade.bottom, facade.top);
  const Vec3 direction = along.normalized(), inward = Vec3::UnitZ().cross(direction);
  for (std::size_t row = 0; row < chart.rows(); ++row) {
    for (std::size_t column = 0; column < chart.columns(); ++column) {
      const bool sunk = is_sunk(column, false) && is_sunk(row, true);
      chart.vertices.push_back(corner + chart.s_m[column] * direction + Vec3(0, 0, chart.t_m[row] - skirt_m) +
                               (sunk ? facade.depth_m : 0.0) * inward);
    }
  }
  chart.paint = paint;
  chart.texel_m = 0.06;
  return chart;
}

namespace {

/// The parapet: top of the wall, inner side and down to the roof, mitred at both corners.
Chart make_parapet(const Vec3& a, const Vec3& b, const Vec3& middle, std::uint32_t seed) {
  const auto inset = [&](const Vec3& p) -> Vec3 {
    return p + kParapetWidth_m * Vec3(p.x() < middle.x() ? 1 : -1, p.y() < middle.y() ? 1 : -1, 0);
  };
  Chart chart;
  chart.s_m = {0.0, (b - a).norm()};
  chart.t_m = {0.0, kParapetWidth_m, kParapetWidth_m + kParapet_m};
  const Vec3 down(0, 0, -kParapet_m);
  chart.vertices = {a, b, inset(a), inset(b), inset(a) + down, inset(b) + down};
  chart.paint = [seed](const Texel& texel) -> Color {
    return material::concrete(texel.s_m, texel.t_m, 2.2, seed + 41) * 0.95F;
  };
  chart.texel_m = 0.08;
  return chart;
}

void add_machines(const Rect& roof, double z, base::HashRandom& random, std::vector<Chart>& charts) {
  const int count = static_cast<int>((roof.x1 - roof.x0) * (roof.y1 - roof.y0) / 90);
  for (int i = 0; i < count; ++i) {
    const Vec3 size(random.uniform(1.0, 3.6), random.uniform(1.0, 2.4), random.uniform(0.6, 1.9));
    const Vec3 low(random.uniform(roof.x0 + 1, roof.x1 - 1 - size.x()),
                   random.uniform(roof.y0 + 1, roof.y1 - 1 - size.y()), z - 0.1);
    const std::uint32_t seed = random.bits();
    const Color base = random.chance(0.7) ? Color(0.70F, 0.71F, 0.71F) : Color(0.45F, 0.47F, 0.48F);
    const auto wall = [base, seed](const Texel& t) -> Color {
      return material::metal(t.s_m, t.t_m, base, seed) * (1.0F - 0.5F * band_coverage(t.t_m, 0.3, 0.1));
    };
    const auto top = [base, seed](const Texel& t) -> Color {
      const bool fan = std::hypot(std::fmod(t.s_m, 1.1) - 0.55, std::fmod(t.t_m, 1.1) - 0.55) < 0.4;
      return fan ? Color(0.18F, 0.18F, 0.19F) : material::metal(t.s_m, t.t_m, base, seed);
    };
    for (Chart& chart : make_box(low, low + size, wall, top)) charts.push_back(std::move(chart));
  }
}

void add_flat_roof(const Building& building, double z, std::uint32_t seed, std::vector<Chart>& charts) {
  const Rect& f = building.footprint;
  const Vec3 middle(f.center().x(), f.center().y(), z);
  const std::array<Vec3, 4> corners{Vec3(f.x0, f.y0, z), Vec3(f.x1, f.y0, z), Vec3(f.x1, f.y1, z), Vec3(f.x0, f.y1, z)};
  for (std::size_t i = 0; i < 4; ++i) charts.push_back(make_parapet(corners[i], corners[(i + 1) % 4], middle, seed));
  const Rect roof{f.x0 + kParapetWidth_m, f.y0 + kParapetWidth_m, f.x1 - kParapetWidth_m, f.y1 - kParapetWidth_m};
  const bool gravel = building.style == BuildingStyle::kBrickHall || building.style == BuildingStyle::kFieldHouse;
  const bool deck = building.style == BuildingStyle::kConcreteDeck;
  Chart chart =
      make_panel({roof.x0, roof.y0, z - kParapet_m}, {roof.x1 - roof.x0, 0, 0}, {0, roof.y1 - roof.y0, 0},
                 [seed, gravel, deck](const Texel& t) -> Color {
                   if (gravel) return material::roof_gravel(t.s_m, t.t_m, seed);
                   if (!deck) return material::roof_membrane(t.s_m, t.t_m, seed);
                   const float line = std::fmod(t.t_m, 16.5) < 10.4 ? band_coverage(t.s_m, 2.7, 0.12) : 0.0F;
                   return mix_colors(material::concrete(t.s_m, t.t_m, 5.5, seed), {0.93F, 0.92F, 0.88F}, line);
                 });
  chart.texel_m = 0.06;
  charts.push_back(std::move(chart));
  base::HashRandom random(seed ^ 0x800fU);
  if (!deck) add_machines(roof, z - kParapet_m, random, charts);
}

/// Four slopes that meet in a ridge along the longer side (y).
void add_hip_roof(const Rect& f, double eaves_m, double rise_m, std::uint32_t seed, std::vector<Chart>& charts) {
  const double half_m = (f.x1 - f.x0) / 2;
  const Vec3 a(f.x0, f.y0, eaves_m), b(f.x1, f.y0, eaves_m), c(f.x1, f.y1, eaves_m), d(f.x0, f.y1, eaves_m);
  const Vec3 r0(f.x0 + half_m, f.y0 + half_m, eaves_m + rise_m), r1(f.x0 + half_m, f.y1 - half_m, eaves_m + rise_m);
  const double slope_m = std::hypot(half_m, rise_m);
  const auto slope = [&](const Vec3& left, const Vec3& right, const Vec3& top_left, const Vec3& top_right) {
    Chart chart;
    chart.s_m = {0.0, (right - left).norm()};
    chart.t_m = {0.0, slope_m};
    chart.vertices = {left, right, top_left, top_right};
    chart.paint = [seed](const Texel& t) {
      return material::metal(t.position.x() + t.position.y(), t.t_m, {0.22F, 0.42F, 0.33F}, seed);
    };
    charts.push_back(std::move(chart));
  };
  slope(a, b, r0, r0);
  slope(b, c, r0, r1);
  slope(c, d, r1, r1);
  slope(d, a, r1, r0);
}

}  // namespace

void add_building(const Building& building, double ground_m, std::uint32_t seed, std::vector<Chart>& charts) {
  constexpr double kSkirt_m = 0.6;
  const Rect& f = building.footprint;
  const std::array<Vec3, 4> corners{Vec3(f.x0, f.y0, ground_m), Vec3(f.x1, f.y0, ground_m), Vec3(f.x1, f.y1, ground_m),
                                    Vec3(f.x0, f.y1, ground_m)};
  for (std::size_t i = 0; i < 4; ++i)
    charts.push_back(make_wall(corners[i], corners[(i + 1) % 4] - corners[i], building.height_m, kSkirt_m,
                               building.style, seed + static_cast<std::uint32_t>(i)));
  const double top = ground_m + building.height_m;
  if (building.style == BuildingStyle::kConcession)
    add_hip_roof(f, top, 1.9, seed, charts);
  else
    add_flat_roof(building, top, seed, charts);
}

std::vector<Chart> make_buildings(const SitePlan& plan, const Terrain& terrain) {
  std::vector<Chart> charts;
  std::uint32_t seed = plan.seed ^ 0xb1d9U;
  for (const Building& building : plan.buildings) {
    const Vec2 middle = building.footprint.center();
    add_building(building, terrain.height_m(middle.x(), middle.y()), seed = base::murmur3_mix(seed + 7), charts);
  }
  return charts;
}

}  // namespace tileflight::demo_place
