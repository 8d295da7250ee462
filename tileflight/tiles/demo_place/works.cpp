// An industrial yard, and a star fort: places of large bodies.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "tileflight/tiles/demo_place/landscape.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

constexpr double kTurn_rad = 2.0 * std::numbers::pi;

Painter sheet_metal(const Color& color, std::uint32_t seed) {
  return [color, seed](const Texel& t) -> Color {
    const float ribs = band_coverage(t.s_m, 0.35, 0.16, 0.08);
    return material::metal(t.s_m, t.t_m, color, seed) * (1.0F - 0.25F * ribs);
  };
}

Color draw_color(base::HashRandom& random) {
  constexpr std::array<std::array<float, 3>, 7> kColors{{{0.62F, 0.63F, 0.62F},
                                                         {0.33F, 0.42F, 0.52F},
                                                         {0.56F, 0.26F, 0.20F},
                                                         {0.30F, 0.42F, 0.32F},
                                                         {0.72F, 0.66F, 0.50F},
                                                         {0.20F, 0.32F, 0.50F},
                                                         {0.76F, 0.45F, 0.16F}}};
  const auto& c = kColors[random.bits() % kColors.size()];
  return {c[0], c[1], c[2]};
}

/// A hall with a saw-tooth roof, whose teeth rise towards +x.
void add_hall(const Rect& f, double height_m, std::uint32_t seed, std::vector<Chart>& charts) {
  base::HashRandom random(seed);
  const Painter wall = sheet_metal(draw_color(random), seed);
  std::vector<Chart> body = make_box({f.x0, f.y0, -0.5}, {f.x1, f.y1, height_m}, wall, wall);
  body.pop_back();  // the flat roof
  append(std::move(body), charts);
  const int teeth = std::max(2, static_cast<int>((f.x1 - f.x0) / 7.0));
  const double tooth_m = (f.x1 - f.x0) / teeth, rise_m = 0.38 * tooth_m;
  for (int i = 0; i < teeth; ++i) {
    const double x0 = f.x0 + i * tooth_m, x1 = x0 + tooth_m;
    charts.push_back(make_panel({x0, f.y0, height_m}, {tooth_m, 0, rise_m}, {0, f.y1 - f.y0, 0},
                                painted(material::roof_membrane, seed + 1U)));
    charts.push_back(make_panel({x1, f.y0, height_m}, {0, f.y1 - f.y0, 0}, {0, 0, rise_m}, [seed](const Texel& t) {
      const float bars = std::max(band_coverage(t.s_m, 1.2, 0.1), band_coverage(t.t_m, 1.0, 0.1));
      return mix_colors(material::glass(t.s_m, t.t_m, seed), {0.6F, 0.6F, 0.58F}, bars);
    }));
    for (const double y : {f.y0, f.y1}) {  // the triangle at each end
      Chart end;
      end.s_m = {0.0, tooth_m};
      end.t_m = {0.0, rise_m};
      const Vec3 left(y == f.y0 ? x0 : x1, y, height_m), right(y == f.y0 ? x1 : x0, y, height_m),
          top(x1, y, height_m + rise_m);
      end.vertices = {left, right, top, top};
      end.paint = wall;
      charts.push_back(std::move(end));
    }
  }
}

/// An upright cylinder with a low cone on top.
void add_tank(const Vec3& foot, double radius_m, double height_m, const Painter& paint, std::vector<Chart>& charts) {
  constexpr std::size_t kSides = 28;
  Chart chart;
  chart.s_m = even_positions(kTurn_rad * radius_m, kSides);
  chart.t_m = {0.0, 0.5 * height_m, height_m, height_m + radius_m};
  for (const double t : chart.t_m) {
    const bool top = t > height_m;
    for (std::size_t i = 0; i <= kSides; ++i) {
      const double angle = kTurn_rad * static_cast<double>(i % kSides) / kSides, r = top ? 0.0 : radius_m;
      chart.vertices.emplace_back(
          foot + Vec3(r * std::cos(angle), r * std::sin(angle), std::min(t, height_m) + (top ? 0.15 * radius_m : 0.0)));
    }
  }
  chart.paint = paint;
  chart.texel_m = 0.06;
  charts.push_back(std::move(chart));
}

void add_containers(const Rect& area, const Landscape& land, base::HashRandom& random, std::vector<Chart>& charts) {
  constexpr double kLength_m = 6.1, kWidth_m = 2.44, kHeight_m = 2.6;
  for (double y = area.y0 + 2.0; y + kWidth_m < area.y1; y += kWidth_m + random.uniform(0.1, 1.4)) {
    for (double x = area.x0 + 4.0; x + kLength_m < area.x1; x += kLength_m + random.uniform(0.3, 2.5)) {
      const int stack = static_cast<int>(random.uniform(0.0, 3.7));
      for (int k = 0; k < stack; ++k) {
        const Painter side = sheet_metal(draw_color(random), random.bits());
        const Vec3 foot =
            land.point(x + kLength_m / 2, y + kWidth_m / 2) + Vec3(random.uniform(-0.1, 0.1), 0.0, k * kHeight_m);
        add_box(foot, {kLength_m, kWidth_m, kHeight_m}, random.uniform(-0.02, 0.02), side, side, charts);
      }
    }
  }
}

/// Pipes on posts from one point to another along x.
void add_pipes(double x0, double x1, double y, const Landscape& land, base::HashRandom& random,
               std::vector<Chart>& charts) {
  constexpr double kHeight_m = 5.0;
  for (double x = x0; x <= x1; x += 8.0)
    add_box(land.point(x, y) - Vec3(0, 0, 0.3), {0.4, 3.2, kHeight_m + 0.3}, 0.0,
            painted(material::asphalt, random.bits()), painted(material::asphalt, random.bits()), charts);
  for (int i = 0; i < 3; ++i) {
    const Painter pipe = sheet_metal(draw_color(random), random.bits());
    const Vec3 foot(0.5 * (x0 + x1), y - 1.0 + i, land.height_m(0.5 * (x0 + x1), y) + kHeight_m);
    add_box(foot, {x1 - x0, 0.6, 0.6}, 0.0, pipe, pipe, charts);
  }
}

}  // namespace

SyntheticPlace make_works(std::uint32_t seed) {
  base::HashRandom random(seed ^ 0x3042U);
  Landscape land;
  land.height_m = [seed](double x, double y) { return 0.5 * base::fractal_noise(x / 60, y / 60, seed, 2); };
  std::vector<Chart> objects;
  std::vector<Rect> built;
  // Nine lots, each of a kind that is drawn.
  for (const double y0 : {-95.0, -31.0, 33.0}) {
    for (const double x0 : {-95.0, -31.0, 33.0}) {
      const Rect lot{x0 + random.uniform(0.0, 4.0), y0 + random.uniform(0.0, 4.0), x0 + 56.0, y0 + 56.0};
      const double kind = random.uniform();
      if (kind < 0.35) {
        const Rect hall{lot.x0 + 3, lot.y0 + 3, lot.x1 - random.uniform(4, 16), lot.y1 - random.uniform(6, 20)};
        add_hall(hall, random.uniform(7.0, 12.0), random.bits(), objects);
        land.holes.push_back(hall);
        built.push_back(hall);
      } else if (kind < 0.55) {
        const double radius_m = random.uniform(5.0, 8.0);
        for (const double x : {lot.x0 + 12.0, lot.x0 + 36.0})
          for (const double y : {lot.y0 + 12.0, lot.y0 + 36.0}) {
            if (random.chance(0.15)) continue;
            const Painter coat = sheet_metal({0.74F, 0.74F, 0.72F}, random.bits());
            add_tank(land.point(x, y) - Vec3(0, 0, 0.3), radius_m, random.uniform(8.0, 14.0), coat, objects);
          }
        add_pipes(lot.x0 + 2.0, lot.x1 - 2.0, lot.y0 + 24.0, land, random, objects);
      } else if (kind < 0.8) {
        add_containers(lot, land, random, objects);
      } else {
        const Building office{
            {std::round(lot.x0) + 6, std::round(lot.y0) + 8, std::round(lot.x0) + 38, std::round(lot.y0) + 28},
            random.uniform(9.0, 17.0),
            random.chance(0.5) ? BuildingStyle::kGlassOffice : BuildingStyle::kBrickHall};
        add_building(office, land.height_m(office.footprint.center().x(), office.footprint.center().y()), random.bits(),
                     objects);
        land.holes.push_back(office.footprint);
        built.push_back(office.footprint);
        for (double x = lot.x0 + 6.0; x < lot.x1 - 6.0; x += 2.9)
          if (random.chance(0.6)) objects.push_back(make_random_car(land.point(x, lot.y0 + 42.0), random.bits()));
        const std::uint32_t bricks = random.bits();
        objects.push_back(make_post(land.point(lot.x1 - 8.0, lot.y1 - 8.0) - Vec3(0, 0, 0.5),
                                    random.uniform(28.0, 42.0), 1.6, 20, [bricks](const Texel& t) {
                                      return material::brick(t.s_m, t.t_m, {0.55F, 0.33F, 0.26F}, bricks);
                                    }));
      }
    }
  }
  land.paint = [seed](const Texel& t) {
    const double x = t.position.x(), y = t.position.y();
    const float road = edge_coverage(
        std::min(std::abs(x + 35.0), std::min(std::abs(x - 29.0), std::min(std::abs(y + 35.0), std::abs(y - 29.0)))) -
            3.5,
        0.1);
    const float green = base::fractal_noise(x / 21, y / 21, seed + 1, 2) > 0.35F ? 1.0F : 0.0F;
    const Color yard = mix_colors(material::concrete(x, y, 5.0, seed + 2), material::lawn(x, y, seed + 3), green);
    return mix_colors(yard, material::asphalt(x, y, seed + 4), road);
  };
  plant(
      land, 250,
      [&](const Vec2& at) {
        const bool green = base::fractal_noise(at.x() / 21, at.y() / 21, seed + 1, 2) > 0.4F;
        return green && std::ranges::none_of(built, [&](const Rect& f) { return f.distance(at.x(), at.y()) < 4.0; });
      },
      draw_tree, seed + 5, objects);
  SyntheticPlace place = make_place_on(land, seed);
  append(std::move(objects), place.charts);
  return place;
}

namespace {

/// The outline of a star fort: bastions and curtains between them.
struct Star {
  int points = 5;
  double inner_m = 38.0, outer_m = 62.0, phase_rad = 0.0;

  /// Radius of the outline at an angle: a straight side between each bastion's tip and the notch beside it.
  double radius_m(double angle_rad) const {
    const double step = kTurn_rad / (2.0 * points);
    double turned = std::fmod(angle_rad - phase_rad, 2.0 * step);
    if (turned < 0.0) turned += 2.0 * step;
    const double from_tip = std::min(turned, 2.0 * step - turned);  // 0 at a tip, `step` at a notch
    const Vec2 tip(outer_m, 0.0), notch(inner_m * std::cos(step), inner_m * std::sin(step));
    // Where the ray of the angle meets the side.
    const Vec2 side = notch - tip, ray(std::cos(from_tip), std::sin(from_tip));
    return (tip.x() * side.y() - tip.y() * side.x()) / (ray.x() * side.y() - ray.y() * side.x());
  }
  /// Distance outside the outline along the ray from the middle; negative inside.
  double outside_m(double x, double y) const { return std::hypot(x, y) - radius_m(std::atan2(y, x)); }
};

/// The rampart's wall along one side of the outline, leaning inwards, with a parapet.
void add_rampart(const Vec2& from, const Vec2& to, double foot_m, double top_m, std::uint32_t seed,
                 std::vector<Chart>& charts) {
  const Vec2 along = (to - from).normalized(), out(along.y(), -along.x());
  const Painter stone = [seed](const Texel& t) {
    return material::brick(0.5 * t.s_m, 0.5 * t.t_m, {0.60F, 0.53F, 0.42F}, seed);
  };
  const double lean_m = 0.12 * (top_m - foot_m);
  const auto at = [&](const Vec2& p, double out_m, double z) {
    return Vec3(p.x() + out_m * out.x(), p.y() + out_m * out.y(), z);
  };
  const auto face = [&](double low_out_m, double low_m, double high_out_m, double high_m) {
    charts.push_back(make_panel(at(from, low_out_m, low_m), at(to, low_out_m, low_m) - at(from, low_out_m, low_m),
                                at(from, high_out_m, high_m) - at(from, low_out_m, low_m), stone, 2.0));
  };
  face(lean_m, foot_m, 0.0, top_m + 1.2);     // outer face with its parapet
  face(0.0, top_m + 1.2, -0.9, top_m + 1.2);  // top of the parapet
  face(-0.9, top_m + 1.2, -0.9, top_m);       // its inner face
  face(-0.9, top_m, -3.2, top_m + 0.05);      // the step behind it, over the end of the ground
}

}  // namespace

SyntheticPlace make_fort(std::uint32_t seed) {
  constexpr double kRampart_m = 6.5, kWalk_m = 7.0, kDitch_m = 4.0, kDitchWidth_m = 11.0;
  base::HashRandom random(seed ^ 0xf027U);
  const Star star{.points = 4 + static_cast<int>(random.bits() % 3),
                  .inner_m = random.uniform(36.0, 42.0),
                  .outer_m = random.uniform(58.0, 68.0),
                  .phase_rad = random.uniform(0.0, 1.0)};
  Landscape land;
  land.height_m = [=](double x, double y) {
    const double out_m = star.outside_m(x, y), meadow = 2.0 * base::fractal_noise(x / 60, y / 60, seed, 3);
    if (out_m < -kWalk_m - 4.0) return 0.0;                                   // the court
    if (out_m < -kWalk_m) return kRampart_m * (out_m + kWalk_m + 4.0) / 4.0;  // the bank behind the walk
    // The ground falls to the ditch inside the wall, within a cell and a half of this line.
    if (out_m < -1.7) return kRampart_m;
    const double slope = std::clamp((out_m - kDitchWidth_m) / 7.0, 0.0, 1.0);
    return -kDitch_m * (1.0 - slope) + slope * meadow;
  };
  land.paint = [=](const Texel& t) {
    const double x = t.position.x(), y = t.position.y(), out_m = star.outside_m(x, y);
    if (out_m < -kWalk_m - 4.0) return material::cobbles(x, y, seed + 1);
    if (out_m < -kWalk_m) return material::lawn(x, y, seed + 2);
    if (out_m < 0.0) return material::concrete(x, y, 2.2, seed + 3);
    return mix_colors(material::lawn(x, y, seed + 4), material::mulch(x, y, seed + 5),
                      out_m < kDitchWidth_m ? 0.45F : 0.0F);
  };
  std::vector<Chart> objects;
  const auto corner = [&](int k) -> Vec2 {
    const double angle = star.phase_rad + kTurn_rad * k / (2.0 * star.points),
                 r = k % 2 == 0 ? star.outer_m : star.inner_m;
    return {r * std::cos(angle), r * std::sin(angle)};
  };
  for (int k = 0; k < 2 * star.points; ++k)
    add_rampart(corner(k), corner(k + 1), -kDitch_m - 0.5, kRampart_m, random.bits(), objects);
  for (int k = 0; k < 2 * star.points; k += 2) {  // a sentry tower on each tip
    const Vec2 at = 0.93 * corner(k);
    const std::uint32_t bricks = random.bits();
    add_tank(
        {at.x(), at.y(), kRampart_m - 1.0}, 1.7, 5.5,
        [bricks](const Texel& t) {
          return material::brick(t.s_m, t.t_m, {0.62F, 0.55F, 0.44F}, bricks);
        },
        objects);
  }
  for (int i = 0; i < 3 + static_cast<int>(random.bits() % 3); ++i) {
    const double angle = kTurn_rad * i / 5.0 + random.uniform(-0.2, 0.2);
    const House barrack{.center = 15.0 * Vec2(std::cos(angle), std::sin(angle)),
                        .angle_rad = angle + 0.5 * std::numbers::pi,
                        .width_m = random.uniform(9.0, 12.0),
                        .depth_m = 7.0,
                        .eaves_m = random.uniform(4.0, 6.5),
                        .rise_m = 3.0,
                        .style = BuildingStyle::kBrickHall,
                        .seed = random.bits()};
    add_house(barrack, 0.0, objects);
    land.holes.push_back(barrack.hidden());
  }
  for (int i = 0; i < 26; ++i) {  // crates and guns on the walk
    const double angle = random.uniform(0.0, kTurn_rad), r = star.radius_m(angle) - random.uniform(2.0, 5.0);
    const Painter wood = painted(material::bark, random.bits());
    add_box({r * std::cos(angle), r * std::sin(angle), kRampart_m},
            {random.uniform(0.8, 2.4), 0.9, random.uniform(0.6, 1.4)}, angle, wood, wood, objects);
  }
  plant(
      land, 700, [&](const Vec2& at) { return star.outside_m(at.x(), at.y()) > kDitchWidth_m + 9.0; }, draw_tree,
      seed + 6, objects);
  SyntheticPlace place = make_place_on(land, seed);
  append(std::move(objects), place.charts);
  return place;
}

}  // namespace tileflight::demo_place
