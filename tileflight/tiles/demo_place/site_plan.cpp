#include "tileflight/tiles/demo_place/site_plan.h"

#include <cmath>
#include <limits>

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

namespace {

/// Catmull-Rom spline through the points, sampled about every 4 m.
std::vector<Vec2> smooth_line(const std::vector<Vec2>& points) {
  std::vector<Vec2> line;
  const auto at = [&](std::ptrdiff_t i) {
    return points[static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(i, 0, std::ssize(points) - 1))];
  };
  for (std::ptrdiff_t i = 0; i + 1 < std::ssize(points); ++i) {
    const Vec2 a = at(i - 1), b = at(i), c = at(i + 1), d = at(i + 2);
    const int steps = std::max(1, static_cast<int>((c - b).norm() / 4.0));
    for (int k = 0; k < steps; ++k) {
      const double t = static_cast<double>(k) / steps;
      line.push_back(0.5 *
                     (2 * b + t * (c - a) + t * t * (2 * a - 5 * b + 4 * c - d) + t * t * t * (3 * b - a - 3 * c + d)));
    }
  }
  line.push_back(points.back());
  return line;
}

std::vector<Grandstand> plan_stands() {
  return {{{-59, -55, -32, 55}, 1.0, 30, 1.5}, {{32, -50, 55, 50}, -1.0, 25, 1.5}};
}

std::vector<Building> plan_buildings() {
  using enum BuildingStyle;
  return {{{-67, -32, -59, 32}, 10.0, kPressBox},        {{-74, -54, -68, -40}, 4.5, kConcession},
          {{-74, 40, -68, 54}, 4.5, kConcession},        {{61, -46, 68, -30}, 4.5, kConcession},
          {{62, -8, 68, 8}, 5.5, kConcession},           {{61, 30, 68, 46}, 4.5, kConcession},
          {{-30, -104, 30, -84}, 9.0, kFieldHouse},      {{-12, -112, 14, -104}, 6.0, kFieldHouse},
          {{-88, 112, -44, 140}, 14.0, kBrickHall},      {{-60, 140, -44, 166}, 11.0, kBrickHall},
          {{2, 128, 44, 156}, 18.0, kGlassOffice},       {{118, -38, 150, 12}, 15.0, kBrickHall},
          {{150, -20, 172, 2}, 12.0, kBrickHall},        {{112, -128, 158, -88}, 11.0, kConcreteDeck},
          {{-184, -118, -122, -86}, 12.0, kGlassOffice}, {{-186, 108, -140, 136}, 13.0, kBrickHall}};
}

std::vector<Road> make_roads() {
  std::vector<Road> roads;
  const auto street = [&](const std::vector<Vec2>& p, double half_width_m) {
    roads.push_back({smooth_line(p), half_width_m, true});
  };
  const auto path = [&](const std::vector<Vec2>& p, double half_width_m) {
    roads.push_back({smooth_line(p), half_width_m, false});
  };
  street({{-98, -205}, {-95, -130}, {-92, -60}, {-94, 20}, {-101, 95}, {-96, 160}, {-90, 205}}, 4.0);
  street({{-205, -140}, {-150, -136}, {-95, -130}, {-20, -127}, {50, -131}, {95, -120}, {150, -140}, {205, -150}}, 4.0);
  street({{95, -120}, {92, -70}, {94, -20}, {98, 30}, {90, 80}, {60, 108}, {0, 114}, {-50, 103}, {-101, 95}}, 3.5);
  path({{-64, 60}, {-52, 76}, {-30, 84}, {0, 86}, {30, 84}, {48, 74}, {60, 58}}, 1.6);
  path({{-64, -60}, {-54, -74}, {-40, -84}, {-36, -100}, {-40, -124}}, 1.8);
  path({{60, -56}, {52, -72}, {40, -84}, {38, -104}, {44, -126}}, 1.8);
  path({{-22, 67}, {-24, 86}, {-30, 104}}, 1.5);
  path({{78, 60}, {110, 66}, {150, 40}, {205, 46}}, 1.5);
  path({{-72, 70}, {-84, 90}}, 1.4);
  path({{22, 114}, {22, 127}}, 2.0);
  return roads;
}

/// Lamps beside the streets, on alternating sides.
std::vector<Vec2> make_lamps(const std::vector<Road>& roads, const std::vector<CarPark>& car_parks) {
  std::vector<Vec2> lamps;
  for (const Road& road : roads) {
    if (!road.street) continue;
    for (std::size_t i = 4; i + 1 < road.line.size(); i += 8) {
      const Vec2 along = (road.line[i + 1] - road.line[i - 1]).normalized();
      const double side = (i / 8) % 2 == 0 ? 1.0 : -1.0;
      lamps.push_back(road.line[i] + side * (road.half_width_m + 2.6) * Vec2(-along.y(), along.x()));
    }
  }
  for (const CarPark& park : car_parks)
    for (double x = park.area.x0 + 15; x < park.area.x1; x += 30)
      for (double y = park.area.y0 + 17.5; y < park.area.y1; y += 33) lamps.emplace_back(x, y);
  std::erase_if(lamps, [](const Vec2& p) { return p.cwiseAbs().maxCoeff() > kSiteHalf_m - 2; });
  return lamps;
}

Tree random_tree(const Vec2& at, bool woods, base::HashRandom& random) {
  Tree tree;
  tree.position = at;
  tree.seed = random.bits();
  const double kind = random.uniform();
  if (kind < 0.18) {
    tree.kind = TreeKind::kConifer;
    tree.height_m = random.uniform(9, 17);
    tree.radius_m = random.uniform(1.8, 3.0);
  } else if (kind < (woods ? 0.28 : 0.40)) {
    tree.kind = TreeKind::kBush;
    tree.height_m = random.uniform(1.0, 2.4);
    tree.radius_m = random.uniform(0.8, 1.8);
  } else {
    tree.radius_m = random.uniform(2.0, woods ? 4.4 : 3.8);
    tree.height_m = tree.radius_m * random.uniform(2.1, 3.0);
  }
  return tree;
}

/// Woods where low-frequency noise is high, single trees elsewhere; crowns never overlap.
std::vector<Tree> plant_trees(const SitePlan& plan) {
  base::HashRandom random(plan.seed ^ 0x7ee5U);
  std::vector<Tree> trees;
  constexpr int kTries = 16000;
  constexpr std::size_t kMost = 780;
  for (int i = 0; i < kTries && trees.size() < kMost; ++i) {
    const Vec2 at(random.uniform(-kSiteHalf_m + 5, kSiteHalf_m - 5), random.uniform(-kSiteHalf_m + 5, kSiteHalf_m - 5));
    const bool woods = base::fractal_noise(at.x() / 70, at.y() / 70, plan.seed ^ 0x33U, 2) > 0.06F;
    const Tree tree = random_tree(at, woods, random);
    if (!woods && !random.chance(at.norm() < 130 ? 0.75 : 0.35)) continue;
    if (plan.clearance_m(at.x(), at.y()) < 0.75 * tree.radius_m + 0.8) continue;
    const auto crowds = [&](const Tree& other) {
      return (other.position - at).norm() < (woods ? 0.72 : 1.0) * (other.radius_m + tree.radius_m);
    };
    if (std::none_of(trees.begin(), trees.end(), crowds)) trees.push_back(tree);
  }
  return trees;
}

}  // namespace

LineProjection project_onto_line(const std::vector<Vec2>& line, const Vec2& p) {
  LineProjection best{std::numeric_limits<double>::infinity(), 0.0};
  double before_m = 0.0;
  for (std::size_t i = 0; i + 1 < line.size(); ++i) {
    const Vec2 edge = line[i + 1] - line[i];
    const double length_m = edge.norm();
    const double t = std::clamp((p - line[i]).dot(edge) / (length_m * length_m), 0.0, 1.0);
    const double distance_m = (line[i] + t * edge - p).norm();
    if (distance_m < best.distance_m) best = {distance_m, before_m + t * length_m};
    before_m += length_m;
  }
  return best;
}

bool SitePlan::is_built(double x, double y) const {
  const auto on = [&](const auto& thing) { return thing.footprint.distance(x, y) < 0; };
  return std::any_of(stands.begin(), stands.end(), on) || std::any_of(buildings.begin(), buildings.end(), on);
}

double SitePlan::clearance_m(double x, double y) const {
  double clearance = kFieldArea.distance(x, y);
  const auto keep = [&](const Rect& rect) { clearance = std::min(clearance, rect.distance(x, y)); };
  for (const Grandstand& stand : stands) keep(stand.footprint);
  for (const Building& building : buildings) keep(building.footprint);
  for (const Rect& plaza : plazas) keep(plaza);
  for (const CarPark& park : car_parks) keep(park.area);
  for (const Road& road : roads) {
    const double verge_m = road.half_width_m + (road.street ? 2.4 : 0.4);
    clearance = std::min(clearance, project_onto_line(road.line, {x, y}).distance_m - verge_m);
  }
  for (const Vec2& mast : masts) clearance = std::min(clearance, (mast - Vec2(x, y)).norm() - 1.5);
  for (const Vec2& lamp : lamps) clearance = std::min(clearance, (lamp - Vec2(x, y)).norm() - 0.5);
  return clearance;
}

SitePlan make_site_plan(std::uint32_t seed) {
  SitePlan plan;
  plan.seed = base::murmur3_mix(seed + 0x51edU);
  plan.stands = plan_stands();
  plan.buildings = plan_buildings();
  plan.plazas = {{-77, -62, -59, 62}, {55, -56, 71, 56}, {-36, -84, 36, -76}, {0, 122, 46, 128}, {-44, 112, -36, 166}};
  plan.car_parks = {{{-162, -66, -106, 78}, plan.seed + 1},
                    {{-80, -190, 36, -146}, plan.seed + 2},
                    {{84, 92, 152, 164}, plan.seed + 3},
                    {{58, -192, 140, -160}, plan.seed + 4}};
  plan.roads = make_roads();
  plan.masts = {{-78, -58}, {-78, 58}, {73, -54}, {73, 54}};
  plan.lamps = make_lamps(plan.roads, plan.car_parks);
  plan.trees = plant_trees(plan);
  return plan;
}

}  // namespace tileflight::demo_place
