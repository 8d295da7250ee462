#include "tileflight/tiles/demo_place/ground_paint.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string_view>
#include <vector>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/demo_place/materials.h"

namespace tileflight::demo_place {
namespace {

constexpr double kKerb_m = 0.18, kSidewalk_m = 2.0;

/// A road's segments near the part that is painted, with the arc length before each segment.
struct RoadPiece {
  Vec2 a, b;
  double before_m = 0.0;
};

struct LocalRoad {
  std::vector<RoadPiece> pieces;
  double half_width_m = 0.0;
  bool street = true;
  std::uint32_t seed = 0;
};

/// The elements of the plan that affect one part of it.
struct LocalPlan {
  std::vector<Rect> plazas, buildings;
  std::vector<CarPark> car_parks;
  std::vector<LocalRoad> roads;
  std::vector<Tree> trees;
  std::uint32_t seed = 0;
};

bool near(const Rect& a, const Rect& b, double reach_m) {
  return a.x0 < b.x1 + reach_m && b.x0 < a.x1 + reach_m && a.y0 < b.y1 + reach_m && b.y0 < a.y1 + reach_m;
}

LocalRoad local_road(const Road& road, const Rect& part, std::uint32_t seed) {
  LocalRoad local{{}, road.half_width_m, road.street, seed};
  double before_m = 0.0;
  for (std::size_t i = 0; i + 1 < road.line.size(); ++i) {
    const Vec2 &a = road.line[i], &b = road.line[i + 1];
    const Rect box{std::min(a.x(), b.x()), std::min(a.y(), b.y()), std::max(a.x(), b.x()), std::max(a.y(), b.y())};
    if (near(box, part, 9.0)) local.pieces.push_back({a, b, before_m});
    before_m += (b - a).norm();
  }
  return local;
}

LocalPlan local_plan(const SitePlan& plan, const Rect& part) {
  LocalPlan local;
  local.seed = plan.seed;
  for (const Rect& plaza : plan.plazas)
    if (near(plaza, part, 1.0)) local.plazas.push_back(plaza);
  for (const Building& building : plan.buildings)
    if (near(building.footprint, part, 3.0)) local.buildings.push_back(building.footprint);
  for (const CarPark& park : plan.car_parks)
    if (near(park.area, part, 1.0)) local.car_parks.push_back(park);
  for (std::size_t i = 0; i < plan.roads.size(); ++i) {
    LocalRoad road = local_road(plan.roads[i], part, plan.seed + 100U + static_cast<std::uint32_t>(i));
    if (!road.pieces.empty()) local.roads.push_back(std::move(road));
  }
  for (const Tree& tree : plan.trees)
    if (part.distance(tree.position.x(), tree.position.y()) < 6.0) local.trees.push_back(tree);
  return local;
}

/// The plan around each cell of a part: a texel looks only at what is near to it.
class PlanGrid {
 public:
  PlanGrid(const SitePlan& plan, const Rect& part) : part_(part) {
    for (int row = 0; row < kCells; ++row)
      for (int column = 0; column < kCells; ++column) cells_.push_back(local_plan(plan, cell(column, row)));
  }

  const LocalPlan& at(double x, double y) const {
    const int column = index(x, part_.x0, part_.x1), row = index(y, part_.y0, part_.y1);
    return cells_[static_cast<std::size_t>(row * kCells + column)];
  }

 private:
  static constexpr int kCells = 10;  ///< along each side

  static int index(double place, double low, double high) {
    return std::clamp(static_cast<int>((place - low) / (high - low) * kCells), 0, kCells - 1);
  }
  Rect cell(int column, int row) const {
    const double width = (part_.x1 - part_.x0) / kCells, height = (part_.y1 - part_.y0) / kCells;
    return {part_.x0 + column * width, part_.y0 + row * height, part_.x0 + (column + 1) * width,
            part_.y0 + (row + 1) * height};
  }

  Rect part_;
  std::vector<LocalPlan> cells_;
};

LineProjection nearest_on_road(const LocalRoad& road, const Vec2& p) {
  LineProjection best{1e9, 0.0};
  for (const RoadPiece& piece : road.pieces) {
    const Vec2 edge = piece.b - piece.a;
    const double t = std::clamp((p - piece.a).dot(edge) / edge.squaredNorm(), 0.0, 1.0);
    const double distance_m = (piece.a + t * edge - p).norm();
    if (distance_m < best.distance_m) best = {distance_m, piece.before_m + t * edge.norm()};
  }
  return best;
}

Color street_color(const LocalRoad& road, const LineProjection& at, double x, double y) {
  Color color = material::asphalt(x, y, road.seed);
  const float track =
      1.0F - static_cast<float>(std::min(1.0, std::fabs(std::fabs(at.distance_m - road.half_width_m / 2) - 0.8) / 0.4));
  color *= 1.0F - 0.10F * track;  // wheel tracks
  const float wear = 0.75F + 0.4F * base::fractal_noise(x / 1.1, y / 1.1, road.seed + 7, 4, 0.6F);
  const float middle = edge_coverage(std::fabs(at.distance_m - 0.16) - 0.06);
  const float edge = edge_coverage(std::fabs(at.distance_m - road.half_width_m + 0.45) - 0.06);
  const bool crossing = std::fmod(at.along_m + 20.0, 83.0) < 3.2 && at.distance_m < road.half_width_m - 0.5;
  color = mix_colors(color, {0.85F, 0.66F, 0.20F}, middle * std::clamp(wear, 0.0F, 1.0F));
  const float stripes = crossing ? band_coverage(at.distance_m, 1.2, 0.6) : 0.0F;
  return mix_colors(color, {0.88F, 0.88F, 0.86F}, std::max(edge, stripes) * std::clamp(wear, 0.0F, 1.0F));
}

/// Colour of the nearest road that covers (x, y), in layers: carriageway over kerb over sidewalk.
bool paint_roads(const LocalPlan& plan, double x, double y, Color& color) {
  int best_layer = 3;
  for (const LocalRoad& road : plan.roads) {
    const LineProjection at = nearest_on_road(road, {x, y});
    const double outside = at.distance_m - road.half_width_m;
    if (!road.street) {
      if (outside < 0 && best_layer > 2) {
        color = material::concrete(x, y, 1.8, road.seed);
        best_layer = 2;
      }
    } else if (outside < 0 && best_layer > 0) {
      color = street_color(road, at, x, y);
      best_layer = 0;
    } else if (outside < kKerb_m && best_layer > 1) {
      color = material::concrete(x, y, 3.0, road.seed) * 1.12F;
      best_layer = 1;
    } else if (outside < kKerb_m + kSidewalk_m && best_layer > 2) {
      color = material::concrete(x, y, 1.5, road.seed) * (1.0F - 0.3F * band_coverage(at.along_m, 1.5, 0.05));
      best_layer = 2;
    }
  }
  return best_layer < 3;
}

Color plaza_color(const Rect& plaza, double x, double y, std::uint32_t seed) {
  Color color = material::concrete(x, y, 2.5, seed);
  const double inside = -plaza.distance(x, y);
  const bool pavers = inside < 1.6 || std::fmod(std::fabs(y) + 3.0, 15.0) < 1.8;
  if (pavers) color = material::brick(x, y, {0.58F, 0.38F, 0.30F}, seed + 5) * 1.05F;
  return color;
}

/// Lawn, or forest floor below trees, with mulch around trunks and bare earth along walls.
Color green_color(const LocalPlan& plan, double x, double y) {
  Color color = material::lawn(x, y, plan.seed + 20);
  const float woods = base::fractal_noise(x / 70, y / 70, plan.seed ^ 0x33U, 2) - 0.10F +
                      0.10F * base::fractal_noise(x / 2.7, y / 2.7, plan.seed + 21, 2);
  if (woods > -0.1F)
    color =
        mix_colors(color, material::forest_floor(x, y, plan.seed + 22), std::clamp(5.0F * woods + 0.5F, 0.0F, 1.0F));
  for (const Tree& tree : plan.trees) {
    const double r = (tree.position - Vec2(x, y)).norm() - 0.45 * tree.radius_m;
    if (r < 0.6)
      color = mix_colors(color, material::mulch(x, y, tree.seed),
                         edge_coverage(r + 0.2 * base::value_noise(2 * x, 2 * y, tree.seed), 0.3));
  }
  return color;
}

Color ground_color(const LocalPlan& plan, double x, double y) {
  if (kFieldArea.distance(x, y) < 0) return field_color(x, y, plan.seed + 30);
  Color color;
  for (const Rect& plaza : plan.plazas)
    if (plaza.distance(x, y) < 0) return plaza_color(plaza, x, y, plan.seed + 40);
  for (const CarPark& park : plan.car_parks)
    if (park.area.distance(x, y) < 0) return car_park_color(park, x, y);
  if (paint_roads(plan, x, y, color)) return color;
  for (const Rect& building : plan.buildings)
    if (building.distance(x, y) < 1.2) return material::concrete(x, y, 1.2, plan.seed + 50) * 0.92F;
  return green_color(plan, x, y);
}

}  // namespace

Color car_park_color(const CarPark& park, double x, double y) {
  const double inside = -park.area.distance(x, y);
  Color color = material::asphalt(x, y, park.seed);
  if (inside < kKerb_m) return material::concrete(x, y, 3.0, park.seed) * 1.1F;
  const double along = x - park.area.x0 - 1.0, across = std::fmod(y - park.area.y0 - 1.0, kParkModule_m);
  if (inside < 1.0) return color;
  const bool in_bays = across < kBayDepth_m || across > kBayDepth_m + kLaneWidth_m;
  float ink = in_bays ? band_coverage(along, kBayWidth_m, 0.11) : 0.0F;
  if (along > 0) ink = std::max(ink, band_coverage(y - park.area.y0 - 1.0, kParkModule_m, 0.11));
  const float wear = 0.62F + 0.5F * base::fractal_noise(x / 1.3, y / 1.3, park.seed + 6, 4, 0.6F);
  const float oil = in_bays ? base::fractal_noise(x / 1.2, y / 1.2, park.seed + 7, 3) : 0.0F;
  color *= 1.0F - 0.35F * std::clamp(2.0F * (oil - 0.3F), 0.0F, 1.0F);
  return mix_colors(color, {0.86F, 0.86F, 0.82F}, ink * std::clamp(wear, 0.1F, 0.95F));
}

Painter ground_painter(const SitePlan& plan, const Rect& part) {
  const auto local = std::make_shared<const PlanGrid>(plan, part);
  return [local](const Texel& texel) {
    const double x = texel.position.x(), y = texel.position.y();
    return ground_color(local->at(x, y), x, y);
  };
}

namespace {

constexpr double kLine_m = 0.1016;  ///< 4 inches (NCAA rule 1-2-1)

/// Coverage of a line of width `width_m` centred at `distance_m` = 0.
float stroke(double distance_m, double width_m = kLine_m) { return edge_coverage(std::fabs(distance_m) - width_m / 2); }

/// Lines across the field: goal lines, a line every 5 yards, hash marks every yard (20 yards from the sidelines, and at
/// the sidelines).
float field_lines(double x, double y) {
  const double ax = std::fabs(x), ay = std::fabs(y);
  if (ax > kSideline_m + 1.9 || ay > kEndLine_m + 1.9) return 0.0F;
  const double outside = std::max(ax - kSideline_m, ay - kEndLine_m);
  float ink = edge_coverage(std::fabs(outside - 0.9) - 0.9);  // the border, 6 feet wide
  if (outside > 0) return ink;
  if (ay < kGoalLine_m + 0.1) ink = std::max(ink, band_coverage(y, 5 * kYard_m, kLine_m));
  ink = std::max(ink, stroke(ay - kGoalLine_m, 2 * kLine_m));
  if (ay < kGoalLine_m) {
    const double from_hash = std::fabs(ax - 6.1), from_side = kSideline_m - ax;
    const bool dash = from_hash < 0.33 || (from_side > 0.1 && from_side < 0.75);
    if (dash) ink = std::max(ink, band_coverage(y, kYard_m, kLine_m));
  }
  return ink;
}

/// Yard numbers, 6 feet high, tops 9 yards from the sideline, readable from that side.
bool on_number(double x, double y) {
  static constexpr std::array<std::string_view, 6> kNumbers{"0", "10", "20", "30", "40", "50"};
  const double ten = 10 * kYard_m * std::nearbyint(y / (10 * kYard_m));
  const auto tens = static_cast<int>(5.5 - std::fabs(ten) / (10 * kYard_m));
  if (tens < 1 || tens > 5) return false;
  constexpr double kUnit_m = 1.83 / 7;
  const double side = x < 0 ? -1.0 : 1.0;
  const double up = (kSideline_m - 9 * kYard_m + 1.83 - std::fabs(x)) / kUnit_m;
  const double half = text_width(kNumbers[static_cast<std::size_t>(tens)]) / 2;
  return is_ink(kNumbers[static_cast<std::size_t>(tens)], side * (y - ten) / kUnit_m + half, up);
}

/// Letters of the end zone, readable from the opposite half of the field.
bool on_end_zone_letters(double x, double y) {
  const std::string_view text = y > 0 ? "TILEFLIGHT" : "FOOTHILLS";
  constexpr double kUnit_m = 0.78;
  const double side = y > 0 ? 1.0 : -1.0;
  const double up = (std::fabs(y) - kGoalLine_m - 1.9) / kUnit_m;
  return is_ink(text, side * x / kUnit_m + text_width(text) / 2, up);
}

/// A ring and a row of chevrons in the middle of the field.
float emblem(double x, double y) {
  const double r = std::hypot(x, y);
  float ink = stroke(r - 5.6, 0.5);
  for (double offset = -2.4; offset < 3.0; offset += 2.4)
    if (r < 4.8) ink = std::max(ink, stroke(y + offset - 0.7 * std::fabs(x), 0.8));
  return ink;
}

Color apron_color(double x, double y, std::uint32_t seed) {
  const Color base = material::asphalt(x, y, seed + 9);
  const float joint = std::max(band_coverage(x, 6.0, 0.06), band_coverage(y, 6.0, 0.06));
  return mix_colors(Color(base * Color(1.18F, 0.82F, 0.66F)), {0.25F, 0.2F, 0.18F}, 0.4F * joint);
}

}  // namespace

Color field_color(double x, double y, std::uint32_t seed) {
  if (kTurfArea.distance(x, y) > 0) return apron_color(x, y, seed);
  Color color = material::turf(x, y, seed);
  const bool end_zone = std::fabs(y) > kGoalLine_m && std::fabs(y) < kEndLine_m && std::fabs(x) < kSideline_m;
  if (end_zone) color = mix_colors(color, Color(0.10F, 0.30F, 0.20F) * (0.6F + 1.4F * color[1]), 0.75F);
  const Color chalk = Color(0.92F, 0.92F, 0.89F) * (0.75F + 0.55F * color[1]);
  float ink = std::max(field_lines(x, y), emblem(x, y));
  if (on_number(x, y) || (end_zone && on_end_zone_letters(x, y))) ink = 1.0F;
  if (ink <= 0.0F) return color;
  const float wear = 0.82F + 0.3F * base::fractal_noise(x / 0.9, y / 0.9, seed + 8, 4, 0.6F);
  return mix_colors(color, chalk, ink * std::clamp(wear, 0.35F, 0.97F));
}

}  // namespace tileflight::demo_place
