#include <array>
#include <cmath>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/demo_place/ground_paint.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

/// Side profile of a car, as fractions: position along its length, height of the body's edge and of the roof there.
struct Station {
  double along, waist, roof;
};

constexpr std::array<Station, 9> kSaloon{{{0.00, 0.10, 0.10},
                                          {0.02, 0.46, 0.48},
                                          {0.24, 0.56, 0.62},
                                          {0.27, 0.58, 0.66},
                                          {0.40, 0.60, 0.98},
                                          {0.68, 0.60, 1.00},
                                          {0.85, 0.58, 0.68},
                                          {0.98, 0.54, 0.60},
                                          {1.00, 0.10, 0.10}}};
constexpr std::array<Station, 9> kVan{{{0.00, 0.08, 0.08},
                                       {0.02, 0.38, 0.40},
                                       {0.17, 0.44, 0.52},
                                       {0.20, 0.46, 0.56},
                                       {0.31, 0.48, 0.97},
                                       {0.60, 0.48, 1.00},
                                       {0.92, 0.48, 0.98},
                                       {0.985, 0.46, 0.86},
                                       {1.00, 0.08, 0.08}}};

struct Car {
  Vec3 foot;             ///< centre of the car on the ground
  double heading = 1.0;  ///< +1: nose to +y; -1: to -y
  double length_m = 4.6, width_m = 1.8, height_m = 1.45;
  bool van = false;
  Color paint{0.8F, 0.8F, 0.8F};
  std::uint32_t seed = 0;
};

Color car_paint(base::HashRandom& random) {
  constexpr std::array<std::array<float, 3>, 9> kPaints{{{0.88F, 0.88F, 0.87F},
                                                         {0.62F, 0.64F, 0.66F},
                                                         {0.16F, 0.16F, 0.17F},
                                                         {0.36F, 0.38F, 0.40F},
                                                         {0.58F, 0.12F, 0.11F},
                                                         {0.16F, 0.24F, 0.44F},
                                                         {0.50F, 0.45F, 0.36F},
                                                         {0.18F, 0.33F, 0.25F},
                                                         {0.80F, 0.62F, 0.20F}}};
  const auto& c = kPaints[static_cast<std::size_t>(random.uniform() * random.uniform(0.5, 1.0) * 9)];
  return {c[0], c[1], c[2]};
}

Car random_car(const Vec3& foot, double heading, base::HashRandom& random) {
  Car car;
  car.foot = foot + Vec3(random.uniform(-0.2, 0.2), random.uniform(-0.3, 0.3), 0);
  car.heading = heading;
  car.van = random.chance(0.42);
  car.length_m = random.uniform(4.2, 5.0) + (car.van ? 0.2 : 0.0);
  car.width_m = random.uniform(1.72, 1.92);
  car.height_m = car.van ? random.uniform(1.65, 1.95) : random.uniform(1.38, 1.5);
  car.paint = car_paint(random);
  car.seed = random.bits();
  return car;
}

/// Cross-section of the body, by column: sill, waist, roof edge, then mirrored. Fraction of half the width, and which
/// height.
Vec3 body_point(const Car& car, const Station& station, int column) {
  const double side = column < 3 ? 1.0 : -1.0;
  const int from_edge = column < 3 ? column : 5 - column;
  const double end = station.along == 0.0 || station.along == 1.0 ? 0.86 : 1.0;
  const std::array<double, 3> across{1.0, 0.98, 0.70}, up{0.0, station.waist, station.roof};
  const double x = side * end * across[static_cast<std::size_t>(from_edge)] * car.width_m / 2;
  const double z = from_edge == 0 ? -0.08 : up[static_cast<std::size_t>(from_edge)] * car.height_m;
  return car.foot + Vec3(car.heading * x, car.heading * (station.along - 0.5) * -car.length_m, z);
}

/// Windows lie between waist and roof; windscreens where the roof line slopes.
Color body_color(const Car& car, const std::array<Station, 9>& shape, const Texel& texel, double along) {
  const double height = (texel.position.z() - car.foot.z()) / car.height_m;
  const double from_axis = std::fabs(texel.position.x() - car.foot.x()) / (car.width_m / 2);
  const bool cabin = along > shape[3].along && along < shape[6].along + 0.05;
  const bool side_window =
      cabin && from_axis > 0.74 && from_axis < 0.97 && height > shape[4].waist + 0.03 && height < 0.94;
  const bool screen = from_axis < 0.66 && ((along > shape[3].along + 0.01 && along < shape[4].along - 0.02) ||
                                           (along > shape[5].along + 0.02 && along < shape[6].along));
  if (side_window || (screen && !car.van) || (screen && along < 0.5)) {
    const bool pillar = std::fabs(along - 0.53) < 0.012 && side_window;
    return pillar ? Color(car.paint * 0.7F) : material::glass(3 * texel.s_m, 3 * texel.t_m, car.seed);
  }
  const double wheel = std::min(std::fabs(along - 0.18), std::fabs(along - 0.80)) * car.length_m;
  if (from_axis > 0.93 && std::hypot(wheel, height * car.height_m - 0.3) < 0.34) return {0.09F, 0.09F, 0.09F};
  const float dust = 1.0F + 0.10F * base::fractal_noise(texel.position.x(), texel.position.y(), car.seed, 4, 0.6F);
  const bool light = from_axis > 0.55 && height > 0.3 && height < 0.5 && (along < 0.03 || along > 0.97);
  if (light) return along < 0.5 ? Color(0.92F, 0.90F, 0.82F) : Color(0.62F, 0.10F, 0.08F);
  return height < 0.16 ? Color(0.16F, 0.16F, 0.16F) : Color(car.paint * dust);
}

Chart make_car(const Car& car) {
  Chart chart;
  const std::array<Station, 9>& shape = car.van ? kVan : kSaloon;
  chart.s_m = {0.0, 0.8, 1.5, 2.7, 3.4, 4.2};
  for (const Station& station : shape) {
    chart.t_m.push_back(chart.t_m.empty()
                            ? 0.0
                            : chart.t_m.back() +
                                  std::max(0.4, 1.2 * (station.along - (&station)[-1].along) * car.length_m));
    for (int column = 0; column < 6; ++column) chart.vertices.push_back(body_point(car, station, column));
  }
  chart.texel_m = 0.06;
  chart.paint = [car, shape](const Texel& texel) {
    return body_color(car, shape, texel, 0.5 - car.heading * (texel.position.y() - car.foot.y()) / car.length_m);
  };
  return chart;
}

void fill_park(const CarPark& park, const Terrain& terrain, std::vector<Chart>& charts) {
  base::HashRandom random(park.seed ^ 0xca5U);
  for (double y = park.area.y0 + 1; y + kBayDepth_m < park.area.y1; y += kParkModule_m) {
    for (int side = 0; side < 2; ++side) {
      const double bay_y = y + (side == 0 ? kBayDepth_m / 2 : 1.5 * kBayDepth_m + kLaneWidth_m);
      if (bay_y + kBayDepth_m / 2 > park.area.y1) continue;
      for (double x = park.area.x0 + 1 + kBayWidth_m / 2; x + kBayWidth_m / 2 < park.area.x1; x += kBayWidth_m) {
        const double full = 0.5 + 0.4 * base::fractal_noise(x / 17, bay_y / 17, park.seed, 2);
        if (!random.chance(full)) continue;
        const double heading = (side == 0 ? -1.0 : 1.0) * (random.chance(0.2) ? -1.0 : 1.0);
        charts.push_back(make_car(random_car(terrain.point(x, bay_y), heading, random)));
      }
    }
  }
}

}  // namespace

Chart make_random_car(const Vec3& foot, std::uint32_t seed) {
  base::HashRandom random(seed);
  return make_car(random_car(foot, 1.0, random));
}

std::vector<Chart> make_cars(const SitePlan& plan, const Terrain& terrain) {
  std::vector<Chart> charts;
  for (const CarPark& park : plan.car_parks) fill_park(park, terrain, charts);
  return charts;
}

}  // namespace tileflight::demo_place
