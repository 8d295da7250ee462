#include "tileflight/tiles/tileset/view_cone_tree.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/fetch/test_tilesets.h"
#include "tileflight/tiles/tileset/selection.h"

namespace tileflight::tileset::view_cone_tree_test {
namespace {

using fetch::test_support::box_volume;
using fetch::test_support::Json;
using fetch::test_support::MemorySource;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

class Chance {
 public:
  explicit Chance(std::uint32_t seed) : random_(seed) {}
  double within(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Vec3 point(double reach) { return {within(-reach, reach), within(-reach, reach), within(-reach, reach)}; }
  Vec3 direction() {
    std::normal_distribution<double> normal;
    return Vec3(normal(random_), normal(random_), normal(random_)).normalized();
  }
  BoundingVolume volume() {
    const double kind = within(0, 1);
    if (kind < 0.2) return BoundingSphere{point(300), within(0, 60)};
    Mat3 axes = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitX(), direction()).toRotationMatrix();
    axes = axes * Vec3(within(0, 60), within(0, 60), within(0, 20)).asDiagonal();
    if (kind < 0.4) axes(0, 1) += within(0, 30);  // sheared
    return OrientedBox{point(300), axes};
  }

 private:
  std::mt19937 random_;
};

/// Lines to and fro over a square, looking ahead and down, with a second lens to the rear; `frames` view cones.
std::vector<ViewCone> survey_flight(std::size_t frames, double half_angle_rad) {
  std::vector<ViewCone> cones;
  const std::size_t per_line = std::max<std::size_t>(2, frames / 20);
  for (std::size_t i = 0; i < frames; ++i) {
    const std::size_t line = i / per_line;
    const double along_m = -250.0 + 500.0 * static_cast<double>(i % per_line) / static_cast<double>(per_line);
    const double ahead = line % 2 == 0 ? 1.0 : -1.0;
    const Vec3 position(ahead * along_m, -250.0 + 25.0 * static_cast<double>(line), 60.0);
    const Vec3 axis = Vec3(i % 2 == 0 ? ahead : -ahead, 0.1, -1.0).normalized();
    cones.push_back({position, axis, half_angle_rad, 400.0 + static_cast<double>(i % 3)});
  }
  return cones;
}

std::vector<std::vector<ViewCone>> flights() {
  std::vector<std::vector<ViewCone>> all{{}, survey_flight(1, 0.5), survey_flight(77, 0.4), survey_flight(400, 1.3)};
  Chance chance(7);
  std::vector<ViewCone> anywhere, turning;
  for (int i = 0; i < 123; ++i) {
    anywhere.push_back({chance.point(250), chance.direction(), chance.within(0.0, 3.2), chance.within(0.0, 800.0)});
    turning.push_back({Vec3(0, 0, 40), Vec3(std::cos(0.1 * i), std::sin(0.1 * i), 0.0), 0.3, 500.0});
  }
  all.push_back(std::move(anywhere));
  all.push_back(std::move(turning));
  all.push_back(widen_to_all_directions(survey_flight(50, 0.4)));
  return all;
}

/// The definition, view cone by view cone.
RefinementCriterion brute_force(const std::vector<ViewCone>& eyes, const SE3& T_local_tileset, double error_px,
                                const ViewConeRange& part) {
  const auto sphere_of = [T_local_tileset](const BoundingVolume& volume) {
    const BoundingVolume local = transformed(T_local_tileset.matrix(), volume);
    if (const auto* sphere = std::get_if<BoundingSphere>(&local)) return *sphere;
    const auto& box = std::get<OrientedBox>(local);
    double radius_m = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
      const Vec3 signs(corner % 2 == 0 ? 1 : -1, corner / 2 % 2 == 0 ? 1 : -1, corner / 4 == 0 ? 1 : -1);
      radius_m = std::max(radius_m, (box.half_axes * signs).norm());
    }
    return BoundingSphere{box.center, radius_m};
  };
  return {.intersects =
              [=](const BoundingVolume& volume) {
                for (std::size_t i = part.begin; i < std::min(part.end, eyes.size()); ++i) {
                  if (intersects_cone(eyes[i], sphere_of(volume))) return true;
                }
                return false;
              },
          .is_fine_enough =
              [=](const BoundingVolume& volume, double geometric_error_m) {
                return std::ranges::all_of(eyes, [&](const ViewCone& eye) {
                  return geometric_error_m * eye.pixels_per_rad <=
                             error_px * distance_m(volume, T_local_tileset, eye.position) ||
                         !intersects_cone(eye, sphere_of(volume));
                });
              }};
}

TEST(ViewConeTree, AnswersAsEachViewConeDoes) {
  Chance chance(11);
  int met = 0, fine = 0, asked = 0;
  for (const std::vector<ViewCone>& eyes : flights()) {
    for (const ViewConeRange& part : {ViewConeRange{}, ViewConeRange{0, 1}, ViewConeRange{10, 45},
                                      ViewConeRange{30, 30}, ViewConeRange{60, 1000}, ViewConeRange{5000, 6000}}) {
      const SE3 T_local_tileset(Eigen::Quaterniond::FromTwoVectors(Vec3::UnitX(), chance.direction()),
                                chance.point(20));
      const RefinementCriterion tree = flight_criterion(eyes, T_local_tileset, 1.5, part);
      const RefinementCriterion each = brute_force(eyes, T_local_tileset, 1.5, part);
      for (int trial = 0; trial < 40; ++trial) {
        const BoundingVolume volume = chance.volume();
        const double error_m = trial % 8 == 0 ? 0.0 : std::exp(chance.within(-4.0, 3.0));
        ASSERT_EQ(tree.intersects(volume), each.intersects(volume));
        ASSERT_EQ(tree.is_fine_enough(volume, error_m), each.is_fine_enough(volume, error_m));
        met += tree.intersects(volume) ? 1 : 0;
        fine += tree.is_fine_enough(volume, error_m) ? 1 : 0;
        ++asked;
      }
    }
  }
  for (const int yes : {met, fine}) {
    EXPECT_GT(yes, asked / 10);
    EXPECT_LT(yes, asked * 9 / 10);
  }
}

/// A random quadtree over 600 m: some quarters are missing, and some tiles are flat or high.
Json random_squares(Chance& chance, int depth, double x, double y, double half, const std::string& name) {
  Json json = fetch::test_support::tile(box_volume(x, y, chance.within(-10, 10), half, half, chance.within(0, 20)),
                                        depth == 0 ? 0.0 : half / 20.0, name + ".glb");
  for (int child = 0; depth > 0 && child < 4; ++child) {
    if (chance.within(0, 1) < 0.1) continue;
    json["children"].push_back(random_squares(chance, depth - 1, x + (child % 2 == 0 ? -0.5 : 0.5) * half,
                                              y + (child / 2 == 0 ? -0.5 : 0.5) * half, half / 2,
                                              name + std::to_string(child)));
  }
  return json;
}

TEST(ViewConeTree, SelectsTheCutsOfBruteForce) {
  Chance chance(13);
  for (int trial = 0; trial < 3; ++trial) {
    MemorySource source(fetch::test_support::tileset(random_squares(chance, 5, 0, 0, 300, "t")));
    TilesetTree tree(source);
    for (const std::vector<ViewCone>& eyes : flights()) {
      for (const ViewConeRange& part : {ViewConeRange{}, ViewConeRange{20, 40}}) {
        const TileCut found = select_cut(tree, flight_criterion(eyes, SE3(), 1.0, part));
        EXPECT_EQ(found.hash, select_cut(tree, brute_force(eyes, SE3(), 1.0, part)).hash);
      }
    }
  }
}

TEST(ViewConeTree, TestsFewOfManyFrames) {
  constexpr std::size_t kFrames = 30000;
  const ViewConeTree tree(survey_flight(kFrames, 0.5));
  Chance chance(17);
  std::size_t tests = 0;
  constexpr int kVolumes = 200;
  for (int i = 0; i < kVolumes; ++i) {
    const BoundingSphere sphere{Vec3(chance.within(-400, 400), chance.within(-400, 400), 0.0), 5.0};
    tree.any_of(
        {}, [&](const ViewConeTree::Group& group) { return ++tests, may_intersect(group, sphere); },
        [&](const ViewCone& eye) { return ++tests, intersects_cone(eye, sphere); });
  }
  EXPECT_LT(tests, kVolumes * kFrames / 100);
}

}  // namespace
}  // namespace tileflight::tileset::view_cone_tree_test
