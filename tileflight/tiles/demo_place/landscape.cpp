#include "tileflight/tiles/demo_place/landscape.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

Vec3 normal_of(const Landscape& land, double x, double y) {
  constexpr double kStep_m = 0.5;
  const double slope_x = land.height_m(x + kStep_m, y) - land.height_m(x - kStep_m, y);
  const double slope_y = land.height_m(x, y + kStep_m) - land.height_m(x, y - kStep_m);
  return Vec3(-slope_x, -slope_y, 2.0 * kStep_m).normalized();
}

Chart make_leaf(const Landscape& land, double x0, double y0) {
  constexpr double kCell_m = 1.0;
  const auto cells = static_cast<std::size_t>(std::lround(SyntheticPlace::kLeaf_m / kCell_m));
  Chart chart;
  chart.s_m = chart.t_m = even_positions(SyntheticPlace::kLeaf_m, cells);
  for (const double t : chart.t_m) {
    for (const double s : chart.s_m) {
      chart.vertices.push_back(land.point(x0 + s, y0 + t));
      chart.normals.push_back(normal_of(land, x0 + s, y0 + t));
    }
  }
  for (std::size_t row = 0; row < cells; ++row) {
    for (std::size_t column = 0; column < cells; ++column) {
      const double x = x0 + static_cast<double>(column) * kCell_m, y = y0 + static_cast<double>(row) * kCell_m;
      chart.hole.push_back(std::ranges::any_of(land.holes, [&](const Rect& hole) {
        return x >= hole.x0 && x + kCell_m <= hole.x1 && y >= hole.y0 && y + kCell_m <= hole.y1;
      }));
    }
  }
  chart.paint = land.paint;
  chart.texel_m = land.texel_m;
  return chart;
}

}  // namespace

SyntheticPlace make_place_on(const Landscape& land, std::uint32_t seed) {
  base::HashRandom random(seed ^ 0xa71aU);
  SyntheticPlace place;
  place.origin = {30.0, -40.0, {50.0}};
  place.heading_rad = random.uniform(0.05, 0.45) * std::numbers::pi;  // no wall lies along a row of voxels
  for (double y = -place.half_m; y < place.half_m - 1e-6; y += SyntheticPlace::kLeaf_m)
    for (double x = -place.half_m; x < place.half_m - 1e-6; x += SyntheticPlace::kLeaf_m)
      place.charts.push_back(make_leaf(land, x, y));
  return place;
}

void move_charts(std::vector<Chart>& charts, double angle_rad, const Vec3& by) {
  const geometry::Mat3 turn = Eigen::AngleAxisd(angle_rad, Vec3::UnitZ()).toRotationMatrix();
  for (Chart& chart : charts) {
    for (Vec3& vertex : chart.vertices) vertex = turn * vertex + by;
    for (Vec3& normal : chart.normals) normal = turn * normal;
    chart.paint = [paint = std::move(chart.paint), turn, by](Texel texel) {
      texel.position = turn.transpose() * (texel.position - by);
      texel.normal = turn.transpose() * texel.normal;
      return paint(texel);
    };
  }
}

void append(std::vector<Chart> more, std::vector<Chart>& charts) {
  std::ranges::move(more, std::back_inserter(charts));
}

Painter painted(Color (*material)(double, double, std::uint32_t), std::uint32_t seed) {
  return [material, seed](const Texel& texel) { return material(texel.s_m, texel.t_m, seed); };
}

void add_box(const Vec3& foot, const Vec3& size, double angle_rad, const Painter& wall, const Painter& roof,
             std::vector<Chart>& charts) {
  std::vector<Chart> box =
      make_box({-size.x() / 2, -size.y() / 2, 0.0}, {size.x() / 2, size.y() / 2, size.z()}, wall, roof);
  move_charts(box, angle_rad, foot);
  append(std::move(box), charts);
}

Rect House::hidden() const {
  const double half_m =
      0.5 * std::min(width_m, depth_m) / (std::abs(std::cos(angle_rad)) + std::abs(std::sin(angle_rad)));
  return {center.x() - half_m, center.y() - half_m, center.x() + half_m, center.y() + half_m};
}

void add_house(const House& house, double ground_m, std::vector<Chart>& charts) {
  constexpr double kSkirt_m = 1.0, kOverhang_m = 0.35, kChimney_m = 0.7;
  const double x = house.width_m / 2, y = house.depth_m / 2, top = house.eaves_m, ridge = top + house.rise_m;
  std::vector<Chart> parts;
  const std::array<Vec3, 4> corners{Vec3(-x, -y, 0), Vec3(x, -y, 0), Vec3(x, y, 0), Vec3(-x, y, 0)};
  for (std::size_t i = 0; i < 4; ++i)
    parts.push_back(make_wall(corners[i], corners[(i + 1) % 4] - corners[i], top, kSkirt_m, house.style, house.seed));
  const auto quad = [&](const Vec3& left, const Vec3& right, const Vec3& top_left, const Vec3& top_right,
                        Color (*material)(double, double, std::uint32_t)) {
    Chart chart;
    chart.s_m = {0.0, (right - left).norm()};
    chart.t_m = {0.0, (0.5 * (top_left + top_right) - 0.5 * (left + right)).norm()};
    chart.vertices = {left, right, top_left, top_right};
    chart.paint = painted(material, house.seed + 31U);
    chart.texel_m = 0.06;
    parts.push_back(std::move(chart));
  };
  const Vec3 up(0, 0, top);
  for (const double side : {1.0, -1.0}) {
    // The gable, and the slope to its left.
    quad(Vec3(side * x, -side * y, top), Vec3(side * x, side * y, top), Vec3(side * x, 0, ridge),
         Vec3(side * x, 0, ridge), material::plaster);
    const double drop_m = house.rise_m / y * kOverhang_m, out = x + kOverhang_m;
    quad(Vec3(-side * out, -side * (y + kOverhang_m), top - drop_m),
         Vec3(side * out, -side * (y + kOverhang_m), top - drop_m), Vec3(-side * out, 0, ridge),
         Vec3(side * out, 0, ridge), material::roof_tiles);
  }
  const Painter brick = [seed = house.seed](const Texel& t) {
    return material::brick(t.s_m, t.t_m, {0.56F, 0.34F, 0.26F}, seed);
  };
  add_box({0.3 * house.width_m, 0.2 * y, top}, {kChimney_m, kChimney_m, house.rise_m + 1.0}, 0.0, brick,
          painted(material::asphalt, house.seed), parts);
  move_charts(parts, house.angle_rad, {house.center.x(), house.center.y(), ground_m});
  append(std::move(parts), charts);
}

void plant(const Landscape& land, int tries, const std::function<bool(const Vec2&)>& may_stand,
           const std::function<Tree(const Vec2&, base::HashRandom&)>& kind_of, std::uint32_t seed,
           std::vector<Chart>& charts) {
  constexpr double kReach_m = 96.0;
  base::HashRandom random(seed);
  std::vector<Tree> standing;
  for (int i = 0; i < tries; ++i) {
    const Vec2 at(random.uniform(-kReach_m, kReach_m), random.uniform(-kReach_m, kReach_m));
    if (!may_stand(at)) continue;
    const Tree tree = kind_of(at, random);
    const bool crowds = std::ranges::any_of(standing, [&](const Tree& other) {
      return (other.position - at).norm() < 0.8 * (other.radius_m + tree.radius_m);
    });
    if (crowds) continue;
    standing.push_back(tree);
    add_tree(tree, land.point(at.x(), at.y()), charts);
  }
}

Tree draw_tree(const Vec2& at, base::HashRandom& random) {
  Tree tree{.position = at,
            .height_m = 0.0,
            .radius_m = random.uniform(1.6, 3.4),
            .kind = TreeKind::kBroadleaf,
            .seed = random.bits()};
  const double kind = random.uniform();
  if (kind < 0.3) {
    tree.kind = TreeKind::kBush;
    tree.radius_m = random.uniform(0.7, 1.5);
    tree.height_m = random.uniform(0.9, 2.0);
  } else {
    if (kind < 0.45) tree.kind = TreeKind::kConifer;
    tree.height_m = tree.radius_m * random.uniform(2.1, 3.2);
  }
  return tree;
}

}  // namespace tileflight::demo_place
