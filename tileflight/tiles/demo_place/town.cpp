// An old town and a suburb: houses along streets.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "tileflight/tiles/demo_place/landscape.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

constexpr double kEdge_m = 97.0;  ///< nothing is built beyond

/// Blocks between streets, of random sizes about `wanted_m`.
std::vector<Rect> draw_blocks(double wanted_m, double street_m, base::HashRandom& random) {
  const auto divide = [&] {
    const auto count = static_cast<std::size_t>(std::lround((2.0 * kEdge_m + street_m) / (wanted_m + street_m)));
    std::vector<double> shares(count);
    double sum = 0.0;
    for (double& share : shares) sum += share = random.uniform(0.8, 1.25);
    const double built_m = 2.0 * kEdge_m - street_m * static_cast<double>(count - 1);
    std::vector<std::pair<double, double>> spans;
    double from_m = -kEdge_m;
    for (const double share : shares) {
      spans.emplace_back(from_m, from_m + share / sum * built_m);
      from_m = spans.back().second + street_m;
    }
    return spans;
  };
  std::vector<Rect> blocks;
  for (const auto& [y0, y1] : divide())
    for (const auto& [x0, x1] : divide()) blocks.push_back({x0, y0, x1, y1});  // streets along y do not line up
  return blocks;
}

const Rect* block_at(const std::vector<Rect>& blocks, double x, double y) {
  const auto found = std::ranges::find_if(blocks, [&](const Rect& block) { return block.distance(x, y) < 0.0; });
  return found == blocks.end() ? nullptr : &*found;
}

/// Rows of houses around a block, their fronts on its sides.
void line_with_houses(const Rect& block, std::vector<House>& houses, base::HashRandom& random) {
  constexpr double kDepth_m = 8.0;
  const std::array<Vec2, 4> corners{Vec2(block.x0, block.y0), Vec2(block.x1, block.y0), Vec2(block.x1, block.y1),
                                    Vec2(block.x0, block.y1)};
  for (std::size_t side = 0; side < 4; ++side) {
    const Vec2 along = (corners[(side + 1) % 4] - corners[side]).normalized(), inward(-along.y(), along.x());
    const double length_m = (corners[(side + 1) % 4] - corners[side]).norm();
    // The next side's row takes the corner.
    for (double from = kDepth_m + 0.3; from < length_m - 4.0;) {
      const double width_m = std::min(random.uniform(5.0, 9.5), length_m - from);
      if (width_m < 4.0) break;
      if (!random.chance(0.08)) {  // a gap: a lane into the court
        const double depth_m = kDepth_m + random.uniform(-1.0, 1.2);
        houses.push_back(
            {.center = corners[side] + (from + width_m / 2) * along + (depth_m / 2 + random.uniform(0.0, 0.5)) * inward,
             .angle_rad = std::atan2(along.y(), along.x()),
             .width_m = width_m,
             .depth_m = depth_m,
             .eaves_m = random.uniform(5.0, 11.0),
             .rise_m = depth_m * random.uniform(0.35, 0.6),
             .seed = random.bits()});
      }
      from += width_m + (random.chance(0.15) ? 0.8 : 0.02);
    }
  }
}

/// A nave and a tower with a spire.
void add_church(const Vec2& at, double ground_m, std::uint32_t seed, std::vector<House>& houses,
                std::vector<Chart>& charts) {
  const Vec2 tower_at = at - Vec2(15.0, 0.0);
  houses.push_back({.center = at, .width_m = 24.0, .depth_m = 11.0, .eaves_m = 9.0, .rise_m = 7.0, .seed = seed});
  constexpr double kHalf_m = 3.2, kHeight_m = 24.0, kSpire_m = 11.0;
  const Painter stone = [seed](const Texel& t) { return material::brick(t.s_m, t.t_m, {0.60F, 0.56F, 0.48F}, seed); };
  add_box({tower_at.x(), tower_at.y(), ground_m - 1.0}, {2 * kHalf_m, 2 * kHalf_m, kHeight_m + 1.0}, 0.0, stone, stone,
          charts);
  const Vec3 tip(tower_at.x(), tower_at.y(), ground_m + kHeight_m + kSpire_m);
  const std::array<Vec2, 4> corners{Vec2(-1, -1), Vec2(1, -1), Vec2(1, 1), Vec2(-1, 1)};
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec2 a = tower_at + 1.1 * kHalf_m * corners[i], b = tower_at + 1.1 * kHalf_m * corners[(i + 1) % 4];
    Chart face;
    face.s_m = {0.0, (b - a).norm()};
    face.t_m = {0.0, std::hypot(kHalf_m, kSpire_m)};
    face.vertices = {{a.x(), a.y(), ground_m + kHeight_m}, {b.x(), b.y(), ground_m + kHeight_m}, tip, tip};
    face.paint = painted(material::roof_tiles, seed | 3U);
    charts.push_back(std::move(face));
  }
}

/// Stalls with bright roofs.
void add_market(const Rect& square, const Landscape& land, base::HashRandom& random, std::vector<Chart>& charts) {
  for (int i = 0; i < 14; ++i) {
    const double x = random.uniform(square.x0 + 3, square.x1 - 3), y = random.uniform(square.y0 + 2, square.y0 + 8);
    const Color color(static_cast<float>(random.uniform(0.3, 0.9)), static_cast<float>(random.uniform(0.3, 0.8)),
                      static_cast<float>(random.uniform(0.2, 0.7)));
    const Painter stripes = [color](const Texel& t) {
      return mix_colors(color, {0.88F, 0.86F, 0.80F}, band_coverage(t.s_m, 0.9, 0.45));
    };
    add_box(land.point(x, y) - Vec3(0, 0, 0.2), {random.uniform(2.0, 3.2), 2.0, random.uniform(2.2, 2.7)},
            random.uniform(-0.1, 0.1), painted(material::bark, random.bits()), stripes, charts);
  }
}

}  // namespace

SyntheticPlace make_town(std::uint32_t seed) {
  base::HashRandom random(seed ^ 0x70e1U);
  const std::vector<Rect> blocks = draw_blocks(36.0, 5.0, random);
  const auto middle = std::ranges::min_element(blocks, {}, [](const Rect& block) { return block.center().norm(); });
  const Rect square = *middle;
  Landscape land;
  land.height_m = [seed](double x, double y) {
    return 5.0 * base::fractal_noise(x / 140, y / 140, seed, 2) + 0.02 * x;
  };
  std::vector<Chart> objects;
  std::vector<House> houses;
  for (const Rect& block : blocks) {
    if (block.center() != square.center()) line_with_houses(block, houses, random);
  }
  const Vec2 church = square.center() + Vec2(4.0, 5.0);
  add_church(church, land.height_m(church.x(), church.y()), random.bits(), houses, objects);
  for (const House& house : houses) {
    add_house(house, land.height_m(house.center.x(), house.center.y()), objects);
    land.holes.push_back(house.hidden());
  }
  land.paint = [blocks, square, seed](const Texel& t) {
    const double x = t.position.x(), y = t.position.y();
    const Rect* block = block_at(blocks, x, y);
    if (!block || block->center() == square.center()) return material::cobbles(x, y, seed + 1);
    const float yard = base::fractal_noise(x / 9, y / 9, seed + 2, 2);
    return yard > 0.1F ? material::lawn(x, y, seed + 3) : material::concrete(x, y, 1.3, seed + 4);
  };
  add_market(square, land, random, objects);
  plant(
      land, 900,
      [&](const Vec2& at) {
        const Rect* block = block_at(blocks, at.x(), at.y());
        return block && block->center() != square.center() && block->distance(at.x(), at.y()) < -11.5;
      },
      draw_tree, seed + 5, objects);
  SyntheticPlace place = make_place_on(land, seed);
  append(std::move(objects), place.charts);
  return place;
}

namespace {

/// A lot with its house, garden, hedge and car.
void add_lot(const Rect& lot, const Landscape& land, base::HashRandom& random, std::vector<House>& houses,
             std::vector<Chart>& charts) {
  const Vec2 at = lot.center() + Vec2(random.uniform(-2, 2), random.uniform(-2, 2));
  houses.push_back({.center = at,
                    .angle_rad = random.uniform(-0.2, 0.2) + (random.chance(0.5) ? 0.5 * std::numbers::pi : 0.0),
                    .width_m = random.uniform(9.0, 13.0),
                    .depth_m = random.uniform(7.5, 9.5),
                    .eaves_m = random.chance(0.5) ? 3.1 : 5.9,
                    .rise_m = random.uniform(2.2, 4.0),
                    .style = random.chance(0.3) ? BuildingStyle::kBrickHall : BuildingStyle::kPlaster,
                    .seed = random.bits()});
  const std::uint32_t hedge = random.bits();
  const Painter leaves = [hedge](const Texel& t) {
    return material::foliage(t.position.x(), t.position.y(), t.position.z(), {0.26F, 0.36F, 0.16F}, hedge);
  };
  for (double x = lot.x0 + 1.0; x < lot.x1 - 1.5; x += 2.0)
    add_box(land.point(x + 1.0, lot.y0 + 0.6) - Vec3(0, 0, 0.4), {2.05, 0.8, random.uniform(1.6, 2.0)}, 0.0, leaves,
            leaves, charts);
  add_box(land.point(lot.x0 + 3.5, lot.y1 - 3.0) - Vec3(0, 0, 0.3), {3.0, 2.4, 2.5}, random.uniform(-0.2, 0.2),
          painted(material::bark, random.bits()), painted(material::roof_membrane, random.bits()), charts);
  if (random.chance(0.35)) {
    const std::uint32_t ripples = random.bits();
    const Painter water = [ripples](const Texel& t) -> Color {
      return Color(0.30F, 0.58F, 0.66F) * (1.0F + 0.2F * base::fractal_noise(t.s_m / 0.7, t.t_m / 0.7, ripples, 3));
    };
    add_box(land.point(lot.x1 - 5.0, lot.y1 - 4.5) - Vec3(0, 0, 0.2), {6.0, 3.2, 0.35}, 0.0,
            painted(material::plaster, ripples), water, charts);
  }
  const Vec2 drive(lot.x1 - 2.5, lot.y0 + 5.0);
  if (random.chance(0.7)) charts.push_back(make_random_car(land.point(drive.x(), drive.y()), random.bits()));
}

}  // namespace

SyntheticPlace make_suburb(std::uint32_t seed) {
  constexpr double kSidewalk_m = 1.8;
  base::HashRandom random(seed ^ 0x5b5bU);
  const std::vector<Rect> blocks = draw_blocks(48.0, 8.0, random);
  Landscape land;
  land.height_m = [seed](double x, double y) { return 7.0 * base::fractal_noise(x / 110, y / 110, seed, 3); };
  land.paint = [blocks, seed](const Texel& t) {
    const double x = t.position.x(), y = t.position.y();
    const Rect* block = block_at(blocks, x, y);
    if (!block) return material::asphalt(x, y, seed + 1);
    if (block->distance(x, y) > -kSidewalk_m) return material::concrete(x, y, 1.5, seed + 2);
    return material::lawn(x, y, seed + 3);
  };
  std::vector<Chart> objects;
  std::vector<House> houses;
  for (const Rect& block : blocks) {
    const int across = std::max(1, static_cast<int>((block.x1 - block.x0) / 21.0));
    const int up = std::max(1, static_cast<int>((block.y1 - block.y0) / 23.0));
    const double width = (block.x1 - block.x0 - 2 * kSidewalk_m) / across,
                 depth = (block.y1 - block.y0 - 2 * kSidewalk_m) / up;
    for (int i = 0; i < across; ++i) {
      for (int k = 0; k < up; ++k) {
        const double x = block.x0 + kSidewalk_m + i * width, y = block.y0 + kSidewalk_m + k * depth;
        add_lot({x, y, x + width, y + depth}, land, random, houses, objects);
      }
    }
  }
  for (const House& house : houses) {
    add_house(house, land.height_m(house.center.x(), house.center.y()), objects);
    land.holes.push_back(house.hidden());
  }
  plant(
      land, 1200,
      [&](const Vec2& at) {
        const Rect* block = block_at(blocks, at.x(), at.y());
        return block && block->distance(at.x(), at.y()) < -4.0 && std::ranges::none_of(houses, [&](const House& house) {
                 return (house.center - at).norm() < 0.6 * house.width_m + 2.5;
               });
      },
      draw_tree, seed + 5, objects);
  SyntheticPlace place = make_place_on(land, seed);
  append(std::move(objects), place.charts);
  return place;
}

}  // namespace tileflight::demo_place
