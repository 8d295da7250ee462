#include <cmath>

#include "tileflight/core/base/noise.h"
#include "tileflight/tiles/demo_place/materials.h"
#include "tileflight/tiles/demo_place/stadium_parts.h"

namespace tileflight::demo_place {
namespace {

Painter plain(const Color& color, std::uint32_t seed) {
  return [color, seed](const Texel& t) -> Color {
    return color * (1.0F + 0.12F * base::fractal_noise(t.s_m / 0.4, t.t_m / 0.4, seed, 3));
  };
}

void add(std::vector<Chart> more, bool thin, std::vector<Chart>& charts) {
  for (Chart& chart : more) {
    chart.thin = thin;
    charts.push_back(std::move(chart));
  }
}

void add_box(const Vec3& low, const Vec3& size, const Painter& paint, bool thin, std::vector<Chart>& charts) {
  add(make_box(low, low + size, paint, paint, 3.0), thin, charts);
}

/// NCAA rule 1-2-5: crossbar 10 feet up, uprights 18 feet 6 inches apart, 30 feet and more high.
void add_goal(double y, double toward_field, std::vector<Chart>& charts) {
  const Painter yellow = plain({0.93F, 0.78F, 0.15F}, 5);
  constexpr double kBar_m = 3.048, kHalf_m = 2.82, kPost_m = 0.12;
  const auto bar = [&](const Vec3& low, const Vec3& high) { add_box(low, high - low, yellow, true, charts); };
  bar({-kPost_m, y - toward_field * 2.0 - kPost_m, -0.1}, {kPost_m, y - toward_field * 2.0 + kPost_m, kBar_m});
  const double neck = y - toward_field * 2.0;
  bar({-kPost_m, std::min(y, neck), kBar_m - kPost_m}, {kPost_m, std::max(y, neck), kBar_m + kPost_m});
  bar({-kHalf_m, y - 0.09, kBar_m - 0.09}, {kHalf_m, y + 0.09, kBar_m + 0.09});
  for (const double x : {-kHalf_m, kHalf_m}) bar({x - 0.06, y - 0.06, kBar_m}, {x + 0.06, y + 0.06, 10.7});
}

void add_mast(const Vec2& at, const Terrain& terrain, std::vector<Chart>& charts) {
  const Vec3 foot = terrain.point(at.x(), at.y()) - Vec3(0, 0, 0.3);
  charts.push_back(make_post(foot, 34.0, 0.42, 8, plain({0.62F, 0.63F, 0.64F}, 6)));
  const double toward = at.x() < 0 ? 0.5 : -1.1;
  const Painter rack = [](const Texel& t) -> Color {
    const bool lamp = std::hypot(std::fmod(t.s_m, 0.9) - 0.45, std::fmod(t.t_m, 0.9) - 0.45) < 0.34;
    return lamp ? Color(0.90F, 0.90F, 0.84F) : Color(0.32F, 0.33F, 0.34F);
  };
  add_box(foot + Vec3(toward, -2.7, 29.5), {0.6, 5.4, 4.0}, rack, false, charts);
}

void add_lamp(const Vec2& at, const Terrain& terrain, std::vector<Chart>& charts) {
  const Vec3 foot = terrain.point(at.x(), at.y()) - Vec3(0, 0, 0.2);
  Chart post = make_post(foot, 8.2, 0.10, 6, plain({0.25F, 0.26F, 0.26F}, 7));
  post.thin = true;
  charts.push_back(std::move(post));
  add_box(foot + Vec3(-0.9, -0.25, 7.9), {1.8, 0.5, 0.22}, plain({0.55F, 0.56F, 0.56F}, 8), true, charts);
}

/// A thin wall along x or y that follows the ground in steps of `piece_m`.
void add_fence(const Vec2& from, const Vec2& to, double height_m, double thickness_m, double piece_m,
               const Painter& paint, bool thin, const Terrain& terrain, std::vector<Chart>& charts) {
  const int pieces = std::max(1, static_cast<int>((to - from).norm() / piece_m + 0.5));
  const Vec2 step = (to - from) / pieces;
  const Vec2 half = thickness_m / 2 * Vec2(step.y() != 0 ? 1 : 0, step.x() != 0 ? 1 : 0);
  for (int i = 0; i < pieces; ++i) {
    const Vec2 a = from + i * step, b = a + step;
    const double ground = std::min(terrain.height_m(a.x(), a.y()), terrain.height_m(b.x(), b.y()));
    const double crest = std::max(terrain.height_m(a.x(), a.y()), terrain.height_m(b.x(), b.y())) + height_m;
    const Vec2 low = a.cwiseMin(b) - half, high = a.cwiseMax(b) + half;
    add_box({low.x(), low.y(), ground - 0.2}, {high.x() - low.x(), high.y() - low.y(), crest - ground + 0.2}, paint,
            thin, charts);
  }
}

Painter banner(std::uint32_t seed) {
  return [seed](const Texel& t) -> Color {
    const double panel = std::floor(t.position.y() / 5.0);
    const float one = base::cell_random(panel, t.position.x() / 50, seed);
    const Color base = one < 0.4F   ? Color(0.10F, 0.32F, 0.22F)
                       : one < 0.7F ? Color(0.84F, 0.82F, 0.75F)
                                    : Color(0.70F, 0.56F, 0.22F);
    const float folds = base::fractal_noise(t.s_m / 0.5, t.t_m / 2.0, seed + 1, 4, 0.6F);
    return base * (1.0F + 0.18F * folds) * (1.0F - 0.4F * band_coverage(t.position.y(), 5.0, 0.1));
  };
}

void add_fences(const Terrain& terrain, std::uint32_t seed, std::vector<Chart>& charts) {
  const Painter concrete = [seed](const Texel& t) { return material::concrete(t.s_m, t.t_m, 1.8, seed); };
  for (const double x : {-32.0, 32.0}) {
    const double stand_m = x < 0 ? 55.0 : 50.0;
    for (const double side : {-1.0, 1.0})
      add_fence({x, side * stand_m}, {x, side * 67.0}, 1.2, 0.3, 4.0, concrete, false, terrain, charts);
  }
  for (const double y : {-67.0, 67.0}) add_fence({-32, y}, {32, y}, 1.1, 0.3, 4.0, concrete, false, terrain, charts);
  add_fence({-77, -62}, {-77, 62}, 2.2, 0.08, 4.0, banner(seed + 3), true, terrain, charts);
  add_fence({71, -56}, {71, 56}, 2.2, 0.08, 4.0, banner(seed + 4), true, terrain, charts);
  add_fence({-40, 98}, {40, 98}, 1.8, 0.06, 4.0, plain({0.30F, 0.33F, 0.31F}, seed + 5), true, terrain, charts);
}

/// A canopy with four slopes on four posts.
void add_tent(const Vec2& at, double half_m, const Color& color, const Terrain& terrain, std::vector<Chart>& charts) {
  const Vec3 foot = terrain.point(at.x(), at.y());
  const Vec3 top = foot + Vec3(0, 0, 3.4);
  const auto corner = [&](int i) -> Vec3 {
    return foot + Vec3((i == 1 || i == 2) ? half_m : -half_m, (i == 2 || i == 3) ? half_m : -half_m, 2.3);
  };
  for (int i = 0; i < 4; ++i) {
    const Vec3 a = corner(i), b = corner((i + 1) % 4);
    Chart chart;
    chart.s_m = {0.0, 2 * half_m};
    chart.t_m = {0.0, 0.5, 0.5 + 1.2 * half_m};
    const Vec3 skirt(0, 0, -0.3);
    chart.vertices = {a + skirt, b + skirt, a, b, top, top};
    chart.paint = plain(color * (i % 2 == 0 ? 1.0F : 0.93F), 20U + static_cast<std::uint32_t>(i));
    charts.push_back(std::move(chart));
    Chart post = make_post(Vec3(a.x(), a.y(), foot.z() - 0.1), 2.3, 0.04, 4, plain({0.7F, 0.7F, 0.7F}, 9));
    post.thin = true;
    charts.push_back(std::move(post));
  }
}

void add_sidelines(const Terrain& terrain, std::uint32_t seed, std::vector<Chart>& charts) {
  base::HashRandom random(seed);
  for (const double x : {-30.4, 29.8}) {
    for (double y = -22; y < 22; y += 5.5)
      add_box({x, y, -0.05}, {0.6, 4.6, 0.95}, plain({0.75F, 0.76F, 0.77F}, random.bits()), false, charts);
  }
  const Color green(0.12F, 0.36F, 0.25F), white(0.90F, 0.89F, 0.86F), gold(0.78F, 0.62F, 0.25F);
  for (int i = 0; i < 7; ++i)
    add_tent({-63.5, -58 + 19.0 * i + (i > 3 ? 2 : 0)}, 1.6, i % 2 == 0 ? white : green, terrain, charts);
  for (int i = 0; i < 6; ++i) add_tent({58.2, -50 + 20.0 * i}, 1.7, i % 3 == 0 ? gold : white, terrain, charts);
  for (const double x : {-20.0, -8.0, 9.0, 21.0}) add_tent({x, -65.0}, 1.5, x < 0 ? white : gold, terrain, charts);
  for (const double y : {-64.5, 64.5})
    for (const double x : {-27.0, 27.0})
      add_box({x - 0.9, y - 0.6, -0.1}, {1.8, 1.2, 1.5}, plain({0.20F, 0.28F, 0.42F}, random.bits()), false, charts);
}

void add_scoreboard(const Terrain& terrain, std::vector<Chart>& charts) {
  const Vec3 foot = terrain.point(0, 95.5);
  for (const double x : {-6.0, 6.0})
    charts.push_back(make_post(foot + Vec3(x, 0.6, -0.4), 6.4, 0.4, 8, plain({0.4F, 0.4F, 0.42F}, 10)));
  const Painter face = [](const Texel& t) -> Color {
    if (t.normal.y() > -0.5) return material::metal(t.s_m, t.t_m, {0.33F, 0.35F, 0.36F}, 12);
    const bool title = is_ink("TILEFLIGHT", (t.s_m - 3.2) / 0.2, (t.t_m - 6.2) / 0.2);
    const bool score = is_ink("HOME 24   GUEST 17", (t.s_m - 1.0) / 0.16, (t.t_m - 3.4) / 0.3);
    if (title || score) return title ? Color(0.95F, 0.95F, 0.92F) : Color(0.98F, 0.80F, 0.25F);
    return t.t_m > 5.8 ? Color(0.10F, 0.32F, 0.22F)
                       : Color(0.09F, 0.09F, 0.11F) * (1.0F + 0.6F * base::value_noise(t.s_m, t.t_m, 4));
  };
  add_box(foot + Vec3(-9.5, 0, 5.5), {19, 1.2, 8.2}, face, false, charts);
}

/// Containers and bins behind buildings.
void add_containers(const SitePlan& plan, const Terrain& terrain, std::vector<Chart>& charts) {
  base::HashRandom random(plan.seed ^ 0xc0aU);
  for (int i = 0; i < 400; ++i) {
    const Vec2 at(random.uniform(-150, 150), random.uniform(-150, 150));
    const float grey = static_cast<float>(random.uniform(0.25, 0.7));
    const Color color = random.chance(0.5) ? Color(grey, grey, grey) : Color(0.5F * grey, 0.8F * grey, 0.6F * grey);
    const Vec3 size(random.uniform(1.2, 2.4), random.uniform(1.2, 6.0), random.uniform(1.2, 2.5));
    const std::uint32_t seed = random.bits();
    if (plan.clearance_m(at.x(), at.y()) < 1.0 || plan.clearance_m(at.x() + size.x(), at.y() + size.y()) < 0.5)
      continue;
    if (plan.clearance_m(at.x(), at.y()) > 6.0 || !random.chance(0.35)) continue;
    const auto hits = [&](const Tree& tree) { return (tree.position - at).norm() < tree.radius_m + 5; };
    if (std::any_of(plan.trees.begin(), plan.trees.end(), hits)) continue;
    const Painter paint = [color, seed](const Texel& t) { return material::metal(t.s_m, t.t_m, color, seed); };
    add_box(terrain.point(at.x(), at.y()) - Vec3(0, 0, 0.4), size, paint, false, charts);
  }
}

}  // namespace

std::vector<Chart> make_furniture(const SitePlan& plan, const Terrain& terrain) {
  std::vector<Chart> charts;
  add_goal(kEndLine_m, -1.0, charts);
  add_goal(-kEndLine_m, 1.0, charts);
  for (const Vec2& at : plan.masts) add_mast(at, terrain, charts);
  for (const Vec2& at : plan.lamps) add_lamp(at, terrain, charts);
  add_fences(terrain, plan.seed ^ 0xfe7ceU, charts);
  add_sidelines(terrain, plan.seed ^ 0x51deU, charts);
  add_scoreboard(terrain, charts);
  add_containers(plan, terrain, charts);
  return charts;
}

}  // namespace tileflight::demo_place
