// A ravine, and the edge of a forest: places of terrain and plants.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/tiles/demo_place/landscape.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

double smooth_step(double v, double from, double to) {
  const double t = std::clamp((v - from) / (to - from), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

/// A rounded boulder, half in the ground.
void add_boulder(const Vec3& at, double radius_m, std::uint32_t seed, std::vector<Chart>& charts) {
  constexpr std::size_t kAround = 14, kRows = 8;
  Chart chart;
  chart.s_m = even_positions(2.0 * std::numbers::pi * radius_m, kAround);
  chart.t_m = even_positions(std::numbers::pi * radius_m, kRows);
  for (std::size_t row = 0; row <= kRows; ++row) {
    const double up = std::numbers::pi * (static_cast<double>(row) / kRows - 0.5);
    for (std::size_t i = 0; i <= kAround; ++i) {
      const double angle = 2.0 * std::numbers::pi * static_cast<double>(i % kAround) / kAround;
      const Vec3 direction(std::cos(up) * std::cos(angle), std::cos(up) * std::sin(angle), 0.7 * std::sin(up));
      const double bump =
          1.0 + 0.3 * base::fractal_noise_3d(1.7 * direction.x(), 1.7 * direction.y(), 1.7 * direction.z(), seed, 3);
      chart.vertices.emplace_back(at + radius_m * bump * direction);
    }
  }
  chart.paint = [seed](const Texel& t) { return material::rock(t.position, seed); };
  chart.texel_m = 0.07;
  charts.push_back(std::move(chart));
}

/// A gorge that winds along x.
struct Gorge {
  std::uint32_t seed = 0;
  double depth_m = 30.0, half_width_m = 22.0, phase = 0.0;

  double middle_y(double x) const {
    return 24.0 * std::sin(x / 41.0 + phase) + 9.0 * base::fractal_noise(x / 60.0, 0.5, seed, 2);
  }
  /// Distance from the middle, bent by gullies.
  double from_middle_m(double x, double y) const {
    return std::abs(y - middle_y(x)) + 7.0 * base::fractal_noise(x / 17.0, y / 17.0, seed + 1, 3);
  }
  double height_m(double x, double y) const {
    const double from_m = from_middle_m(x, y);
    const double bed = 0.45 * smooth_step(from_m, 3.0, 0.55 * half_width_m);  // scree below, a cliff above
    const double wall = 0.55 * smooth_step(from_m, 0.62 * half_width_m, half_width_m);
    const double rough = base::fractal_noise(x / 4.0, y / 4.0, seed + 2, 3);
    const double meadow = 2.5 * base::fractal_noise(x / 55.0, y / 55.0, seed + 3, 3);
    return depth_m * (bed + wall) + (0.3 + 0.5 * smooth_step(from_m, 1.2 * half_width_m, 6.0)) * rough + meadow;
  }
};

}  // namespace

SyntheticPlace make_ravine(std::uint32_t seed) {
  base::HashRandom random(seed ^ 0x4a51U);
  const Gorge gorge{.seed = seed,
                    .depth_m = random.uniform(22.0, 36.0),
                    .half_width_m = random.uniform(24.0, 36.0),
                    .phase = random.uniform(0.0, 6.28)};
  Landscape land;
  land.height_m = [gorge](double x, double y) { return gorge.height_m(x, y); };
  land.paint = [gorge, seed](const Texel& t) {
    const double x = t.position.x(), y = t.position.y();
    const float steep = static_cast<float>(
        smooth_step(t.normal.z() + 0.08 * base::fractal_noise(x / 3, y / 3, seed + 4, 3), 0.86, 0.70));
    const double from_m = gorge.from_middle_m(x, y);
    if (from_m < 2.6) {
      const float foam = base::fractal_noise(x / 2.2, y / 0.8, seed + 5, 4, 0.6F);
      return mix_colors({0.22F, 0.30F, 0.30F}, {0.62F, 0.66F, 0.64F}, std::clamp(1.3F * foam, 0.0F, 1.0F));
    }
    const Color soil =
        from_m < gorge.half_width_m ? material::forest_floor(x, y, seed + 6) : material::lawn(x, y, seed + 7);
    return mix_colors(soil, material::rock(t.position, seed + 8), steep);
  };
  land.texel_m = 0.06;
  std::vector<Chart> objects;
  for (int i = 0; i < 110; ++i) {
    const double x = random.uniform(-96, 96), from_m = random.uniform(-0.7, 0.7) * gorge.half_width_m;
    const double y = gorge.middle_y(x) + from_m;
    if (std::abs(y) < 97.0) add_boulder(land.point(x, y), random.uniform(0.5, 2.6), random.bits(), objects);
  }
  plant(
      land, 2200,
      [&](const Vec2& at) {
        const double from_m = gorge.from_middle_m(at.x(), at.y());
        const bool thicket = base::fractal_noise(at.x() / 30, at.y() / 30, seed + 9, 2) > 0.05F;
        return from_m > 3.5 && thicket && std::abs(from_m - 0.85 * gorge.half_width_m) > 5.0;
      },
      draw_tree, seed + 10, objects);
  SyntheticPlace place = make_place_on(land, seed);
  append(std::move(objects), place.charts);
  return place;
}

SyntheticPlace make_woods(std::uint32_t seed) {
  constexpr double kTrack_m = 2.0;
  base::HashRandom random(seed ^ 0x3003U);
  const double phase = random.uniform(0.0, 6.28), slope = random.uniform(-0.05, 0.05);
  // The forest lies north of this line, fields south of it, a track between.
  const auto edge_y = [seed, phase](double x) {
    return 12.0 + 14.0 * std::sin(x / 52.0 + phase) + 6.0 * base::fractal_noise(x / 30.0, 0.5, seed, 2);
  };
  const auto track_y = [edge_y](double x) { return edge_y(x) - 9.0; };
  Landscape land;
  land.height_m = [seed, slope](double x, double y) {
    return 6.0 * base::fractal_noise(x / 90, y / 90, seed + 1, 3) + slope * y +
           0.06 * base::fractal_noise(x / 2, y / 2, seed + 2, 2);
  };
  land.paint = [=](const Texel& t) {
    const double x = t.position.x(), y = t.position.y();
    if (y > edge_y(x) - 2.0) return material::forest_floor(x, y, seed + 3);
    const double off_m = std::abs(y - track_y(x));
    if (off_m < kTrack_m) {
      const float rut = edge_coverage(std::abs(off_m - 0.8) - 0.3, 0.3);
      return mix_colors(material::lawn(x, y, seed + 4), material::mulch(x, y, seed + 5), 0.3F + 0.7F * rut);
    }
    // Strips of crop and meadow of different widths.
    const double strip = std::floor(x / 23.0 + 0.3 * std::sin(y / 40.0));
    const float kind = base::cell_random(strip, 0.5, seed + 6);
    if (y < track_y(x) - 6.0 && kind < 0.55F)
      return material::crop(y, x, seed + static_cast<std::uint32_t>(7 + strip + 10));
    return material::lawn(x, y, seed + 8);
  };
  land.texel_m = 0.06;
  std::vector<Chart> objects;
  plant(
      land, 5200, [&](const Vec2& at) { return at.y() > edge_y(at.x()); },
      [](const Vec2& at, base::HashRandom& draw) {
        if (draw.chance(0.25)) return draw_tree(at, draw);
        const double radius_m = draw.uniform(1.5, 2.6);
        return Tree{.position = at,
                    .height_m = radius_m * draw.uniform(4.0, 6.5),
                    .radius_m = radius_m,
                    .kind = TreeKind::kConifer,
                    .seed = draw.bits()};
      },
      seed + 11, objects);
  plant(
      land, 60, [&](const Vec2& at) { return at.y() < track_y(at.x()) - 4.0; }, draw_tree, seed + 12, objects);
  for (int i = 0; i < 16; ++i) {  // stacked logs and bales beside the track
    const double x = random.uniform(-90, 90), y = track_y(x) - random.uniform(4.0, 6.0);
    const bool logs = random.chance(0.5);
    const Painter side = painted(logs ? material::bark : material::crop, random.bits());
    add_box(land.point(x, y) - Vec3(0, 0, 0.2), {random.uniform(3.0, 7.0), 2.2, random.uniform(1.3, 2.4)},
            random.uniform(-0.3, 0.3), side, side, objects);
  }
  const double hut_x = random.uniform(-60, 60);
  const House hut{.center = {hut_x, track_y(hut_x) - 14.0},
                  .angle_rad = random.uniform(-0.4, 0.4),
                  .width_m = 12.0,
                  .depth_m = 8.0,
                  .eaves_m = 3.2,
                  .rise_m = 3.4,
                  .seed = random.bits()};
  add_house(hut, land.height_m(hut.center.x(), hut.center.y()), objects);
  land.holes.push_back(hut.hidden());
  SyntheticPlace place = make_place_on(land, seed);
  append(std::move(objects), place.charts);
  return place;
}

}  // namespace tileflight::demo_place
