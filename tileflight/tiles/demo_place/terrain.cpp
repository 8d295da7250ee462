#include "tileflight/tiles/demo_place/terrain.h"

#include <cmath>

#include "tileflight/core/base/noise.h"

namespace tileflight::demo_place {
namespace {

constexpr double kWestRim_m = 13.2, kEastRim_m = 11.1, kNorthRim_m = 8.5, kSouthRim_m = 3.0;

/// Smooth step: 0 before `from`, 1 after `to`.
double ramp(double v, double from, double to) {
  const double t = std::clamp((v - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t) * 0.35 + t * 0.65;
}

/// Smooth maximum, rounded where the values differ by less than about `round_m`.
double smooth_max(double a, double b, double round_m) {
  const double overlap = std::max(0.0, round_m - std::fabs(a - b)) / round_m;
  return std::max(a, b) + overlap * overlap * round_m / 4 * std::clamp(std::min(a, b) / round_m, 0.0, 1.0);
}

double bowl_m(double x, double y) {
  const double west = kWestRim_m * ramp(-x, 33, 59), east = kEastRim_m * ramp(x, 33, 55);
  const double north = kNorthRim_m * ramp(y, 68, 92), south = kSouthRim_m * ramp(-y, 70, 118);
  return smooth_max(smooth_max(west, east, 2.0), smooth_max(north, south, 2.0), 3.0);
}

/// Weight of the hills: 0 in the bowl.
double outside(double x, double y) { return ramp(std::max(std::fabs(x) - 78, std::fabs(y) - 108), 0, 45); }

}  // namespace

Terrain::Terrain(const SitePlan& plan) : seed_(plan.seed ^ 0x7e44U) {
  for (const Building& building : plan.buildings) {
    const Vec2 c = building.footprint.center();
    pads_.push_back({building.footprint, natural_height_m(c.x(), c.y()), 5.0});
  }
  for (const CarPark& park : plan.car_parks) {
    const Vec2 c = park.area.center();
    pads_.push_back({park.area, natural_height_m(c.x(), c.y()), 11.0});
  }
}

double Terrain::natural_height_m(double x, double y) const {
  const double hills = 3.4 * base::fractal_noise(x / 95, y / 95, seed_, 3) - 0.02 * std::max(0.0, -x - 80) -
                       0.035 * std::max(0.0, x - 80);
  const double creek = -4.5 * std::exp(-0.5 * std::pow((0.8 * x + 0.6 * y - 170) / 16, 2));
  return bowl_m(x, y) + outside(x, y) * (hills + creek);
}

double Terrain::unevenness_m(double x, double y) const {
  return 0.16 * base::fractal_noise(x / 9, y / 9, seed_ + 1, 3) +
         0.03 * base::fractal_noise(x / 1.9, y / 1.9, seed_ + 2, 2);
}

double Terrain::height_m(double x, double y) const {
  if (kFieldArea.distance(x, y) < 0) return 0.25 * (1 - std::min(1.0, std::fabs(x) / 29));  // crowned for drainage
  double height = natural_height_m(x, y) + unevenness_m(x, y) * ramp(kFieldArea.distance(x, y), 0, 6);
  for (const Pad& pad : pads_) {
    const double share = 1 - ramp(pad.area.distance(x, y), 1.5, pad.margin_m);
    if (share > 0) height += share * (pad.height_m - height);
  }
  return height;
}

Vec3 Terrain::normal(double x, double y) const {
  constexpr double kStep_m = 0.25;
  const double slope_x = (height_m(x + kStep_m, y) - height_m(x - kStep_m, y)) / (2 * kStep_m);
  const double slope_y = (height_m(x, y + kStep_m) - height_m(x, y - kStep_m)) / (2 * kStep_m);
  return Vec3(-slope_x, -slope_y, 1).normalized();
}

}  // namespace tileflight::demo_place
