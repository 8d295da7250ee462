#include "tileflight/tiles/tileset/view_criteria.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::tileset::view_criteria_test {
namespace {

using fetch::test_support::box_volume;
using fetch::test_support::Json;
using fetch::test_support::MemorySource;
using fetch::test_support::tile;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr double kPi = std::numbers::pi;

class Chance {
 public:
  explicit Chance(std::uint32_t seed) : random_(seed) {}
  double within(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Vec3 point(double reach) { return {within(-reach, reach), within(-reach, reach), within(-reach, reach)}; }
  Vec3 direction() {
    std::normal_distribution<double> normal;
    return Vec3(normal(random_), normal(random_), normal(random_)).normalized();
  }
  Mat3 rotation() { return Eigen::Quaterniond::FromTwoVectors(Vec3::UnitX(), direction()).toRotationMatrix(); }
  OrientedBox box() {
    const Vec3 half(within(0, 20), within(0, 20), within(0, 5));
    return {point(60), rotation() * half.asDiagonal()};
  }

 private:
  std::mt19937 random_;
};

SE3 looking(const Vec3& from, const Vec3& along) {
  return {Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), along), from};
}

TEST(Distance, ToBoxesIsThatOfTheNearestOfManyPoints) {
  Chance chance(1);
  for (int trial = 0; trial < 20; ++trial) {
    const OrientedBox box = chance.box();
    const Vec3 eye = chance.point(80);
    double least = INFINITY;
    for (int i = -20; i <= 20; ++i) {
      for (int j = -20; j <= 20; ++j) {
        for (int k = -5; k <= 5; ++k)
          least = std::min(least, (box.center + box.half_axes * Vec3(i / 20.0, j / 20.0, k / 5.0) - eye).norm());
      }
    }
    const double found = distance_m(box, SE3(), eye);
    EXPECT_LE(found, least + 1e-9);
    EXPECT_NEAR(found, least, 0.9);  // half the diagonal of the grid's cells of 1 m
  }
}

TEST(Distance, IsZeroInsideAndExactForKnownShapes) {
  const OrientedBox flat{Vec3(10, 0, 0), Vec3(2, 3, 0).asDiagonal()};
  EXPECT_DOUBLE_EQ(distance_m(flat, SE3(), {10, 0, 7}), 7.0);
  EXPECT_DOUBLE_EQ(distance_m(flat, SE3(), {15, 7, 0}), 5.0);
  EXPECT_DOUBLE_EQ(distance_m(BoundingSphere{Vec3::Zero(), 2.0}, SE3(), {0, 0, 5}), 3.0);
  EXPECT_DOUBLE_EQ(distance_m(BoundingSphere{Vec3::Zero(), 2.0}, SE3(), {0, 1, 0}), 0.0);
  OrientedBox sheared{Vec3::Zero(), Mat3::Identity()};
  sheared.half_axes(0, 1) = 1.0;  // a point of it lies at (2, 1, 0)
  EXPECT_LE(distance_m(sheared, SE3(), {4, 1, 0}), 2.0);
  EXPECT_GT(distance_m(sheared, SE3(), {9, 1, 0}), 5.0);
}

TEST(Distance, OfAGeographicRegionIsTakenInTheLocalFrame) {
  const geometry::LocalFrame frame({47.0, 8.0, {400.0}});
  const double rad = kPi / 180.0;
  const GeographicRegion region{8.0 * rad, 47.0 * rad, 8.001 * rad, 47.001 * rad, 400, 420};
  const SE3 T_local_ecef = frame.T_ecef_local().inverse();
  EXPECT_NEAR(distance_m(region, T_local_ecef, {30, 50, 120}), 100.0, 0.1);
  EXPECT_EQ(distance_m(region, T_local_ecef, {30, 50, 10}), 0.0);
}

TEST(EyeOf, AnEquidistantLensIsAsSharpEverywhere) {
  const imaging::Camera camera = imaging::make_fisheye(1000, 1000, 150.0);
  const ViewCone eye = view_cone_of(camera);
  const double f = 500.0 / (75.0 * kPi / 180.0);
  // Along the radius f pixels per radian; across it f theta / sin theta, which increases towards the corner.
  const double corner_rad = 75.0 * kPi / 180.0 * std::sqrt(2.0);
  EXPECT_NEAR(eye.half_angle_rad, corner_rad, 1e-6);
  EXPECT_NEAR(eye.pixels_per_rad, f * corner_rad / std::sin(corner_rad), 1e-6 * eye.pixels_per_rad);
}

TEST(EyeOf, APinholeIsSharpestInItsCorner) {
  const imaging::Camera camera = imaging::make_pinhole(800, 600, 90.0);
  const ViewCone eye = view_cone_of(camera);
  const double corner_rad = std::atan(std::hypot(1.0, 0.75));
  EXPECT_NEAR(eye.half_angle_rad, corner_rad, 1e-6);
  EXPECT_NEAR(eye.pixels_per_rad, 400.0 / std::pow(std::cos(corner_rad), 2), 1e-6 * eye.pixels_per_rad);
}

TEST(EyeOf, APanoramaLooksEverywhereAsSharpAsItsColumns) {
  const ViewCone eye = view_cone_of(imaging::make_panorama(2000, 1000));
  EXPECT_DOUBLE_EQ(eye.half_angle_rad, kPi);
  EXPECT_NEAR(eye.pixels_per_rad, 1000.0 / kPi, 1e-6 * eye.pixels_per_rad);  // not endless at the poles
}

TEST(WantedFlight, NothingWithinTheConeIsLeftOut) {
  Chance chance(2);
  int culled = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const ViewCone eye{chance.point(50), chance.direction(), chance.within(0.2, 1.6), 500.0};
    const BoundingVolume volume = chance.box();
    const bool met = flight_criterion({eye}, SE3(), 1.0).intersects(volume);
    const auto& box = std::get<OrientedBox>(volume);
    bool any_point_seen = false;
    for (int i = 0; i < 200; ++i) {
      const Vec3 ray = (box.center + box.half_axes * chance.point(1.0) - eye.position).normalized();
      any_point_seen |= std::acos(std::clamp(ray.dot(eye.axis), -1.0, 1.0)) <= eye.half_angle_rad;
    }
    EXPECT_TRUE(met || !any_point_seen);
    culled += met ? 0 : 1;
  }
  EXPECT_GT(culled, 60) << "what is behind is left out";
}

/// A quadtree of `depth` levels over a square of 800 m, each tile with one content named by level and position; the
/// error halves at each level, and is 0 for leaves.
Json squares(int depth, double x, double y, double half, const std::string& name, double error) {
  Json json = fetch::test_support::tile(fetch::test_support::box_volume(x, y, 0, half, half, 5),
                                        depth == 0 ? 0.0 : error, name + ".glb");
  if (depth == 0) return json;
  for (int child = 0; child < 4; ++child) {
    json["children"].push_back(squares(depth - 1, x + (child % 2 == 0 ? -0.5 : 0.5) * half,
                                       y + (child / 2 == 0 ? -0.5 : 0.5) * half, half / 2, name + std::to_string(child),
                                       error / 2));
  }
  return json;
}

std::vector<std::string> uris(const TileCut& cut) {
  std::vector<std::string> out;
  for (const CutContent& content : cut.contents) out.push_back(content.uri);
  return out;
}

TEST(WantedFlight, EveryPointThatIsLookedAtIsThereAndFineEnough) {
  MemorySource source(fetch::test_support::tileset(squares(5, 0, 0, 400, "t", 16.0)));
  const imaging::Camera lens = imaging::make_fisheye(640, 360, 155.0);
  std::vector<SE3> poses;
  for (int i = 0; i < 12; ++i) poses.push_back(looking({-200.0 + 30 * i, 10.0 * i, 60}, Vec3(1, 0.1 * i, -0.6)));
  const std::vector<ViewCone> eyes = view_cones_along(lens, poses);
  TilesetTree tree(source);
  const TileCut cut = select_cut(tree, flight_criterion(eyes, SE3(), 2.0));
  const TileCut whole = select_cut(tree, region_criterion({Vec3::Zero(), Vec3::Constant(2000)}, SE3(), 0.0));
  EXPECT_LT(cut.contents.size(), whole.contents.size() / 2) << "far and unseen parts are coarse or absent";

  Chance chance(3);
  int looked_at = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    const Vec3 point(chance.within(-400, 400), chance.within(-400, 400), chance.within(-5, 5));
    const SE3& pose = poses[static_cast<std::size_t>(chance.within(0, 11.99))];
    const auto pixel = lens.project(pose.inverse() * point);
    if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > 639 || pixel->y() > 359) continue;
    ++looked_at;
    const CutContent* shows = nullptr;
    for (const CutContent& content : cut.contents) {
      if (distance_m(tree.volume(content.node), SE3(), point) <= 0.0) shows = &content;
    }
    ASSERT_NE(shows, nullptr) << point.transpose() << " is a hole";
    const double error_px = shows->geometric_error_m / (point - pose.translation).norm() * eyes[0].pixels_per_rad;
    EXPECT_LE(error_px, 2.0) << shows->uri;
  }
  EXPECT_GT(looked_at, 200);
}

TEST(WantedFlight, AllAroundMissesNothingAndAStricterErrorIsFiner) {
  MemorySource source(fetch::test_support::tileset(squares(4, 0, 0, 400, "t", 16.0)));
  TilesetTree tree(source);
  const std::vector<ViewCone> eyes =
      view_cones_along(imaging::make_pinhole(640, 360, 60.0), {looking({0, 0, 50}, Vec3(1, 0, 0))});
  const auto area = [&](const TileCut& cut) {
    double sum = 0.0;
    for (const CutContent& content : cut.contents)
      sum += 4.0 * std::pow(std::get<OrientedBox>(tree.volume(content.node)).half_axes(0, 0), 2);
    return sum;
  };
  const TileCut ahead = select_cut(tree, flight_criterion(eyes, SE3(), 1.0));
  const TileCut around = select_cut(tree, flight_criterion(widen_to_all_directions(eyes), SE3(), 1.0));
  const TileCut coarse = select_cut(tree, flight_criterion(widen_to_all_directions(eyes), SE3(), 50.0));
  EXPECT_DOUBLE_EQ(area(around), 800.0 * 800.0);
  EXPECT_DOUBLE_EQ(area(coarse), 800.0 * 800.0);
  EXPECT_LT(area(ahead), area(around));
  EXPECT_LT(coarse.contents.size(), around.contents.size());
}

TEST(WantedView, RefinesAsTheScreenSpaceErrorSays) {
  // One tile of error 10 m with a child below it, 100 m under a camera that looks down: 10 * 960 / 100 = 96 px.
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 20, 20, 5), 10, "root.glb");
  root["children"] =
      Json::array({fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 20, 20, 5), 0, "fine.glb")});
  MemorySource source(fetch::test_support::tileset(root));
  TilesetTree tree(source);
  ViewerCamera camera{.T_local_camera = looking({0, 0, 105}, -Vec3::UnitZ())};
  camera.max_error_px = 95.9;
  EXPECT_THAT(uris(select_cut(tree, viewer_criterion(camera, SE3()))), ElementsAre("fine.glb"));
  camera.max_error_px = 96.1;
  EXPECT_THAT(uris(select_cut(tree, viewer_criterion(camera, SE3()))), ElementsAre("root.glb"));
}

TEST(WantedView, LeavesOutWhatLiesBesideAndBehindAndNeedsTheViewerWhereATileAsks) {
  Json root = fetch::test_support::tile(fetch::test_support::box_volume(0, 0, 0, 400, 400, 5), 100);
  root["children"] = {
      fetch::test_support::tile(fetch::test_support::box_volume(60, 0, 0, 10, 10, 5), 0, "ahead.glb"),
      fetch::test_support::tile(fetch::test_support::box_volume(-60, 0, 0, 10, 10, 5), 0, "behind.glb"),
      fetch::test_support::tile(fetch::test_support::box_volume(60, 150, 0, 10, 10, 5), 0, "beside.glb"),
      fetch::test_support::tile(fetch::test_support::box_volume(80, 20, 0, 10, 10, 5), 0, "asks.glb")};
  root["children"][3]["viewerRequestVolume"] = fetch::test_support::box_volume(500, 0, 0, 10, 10, 10);
  MemorySource source(fetch::test_support::tileset(root));
  TilesetTree tree(source);
  EXPECT_THAT(uris(select_cut(tree, viewer_criterion({.T_local_camera = looking({0, 0, 2}, Vec3::UnitX())}, SE3()))),
              ElementsAre("ahead.glb"));
  EXPECT_THAT(uris(select_cut(tree, viewer_criterion({.T_local_camera = looking({505, 0, 2}, -Vec3::UnitX())}, SE3()))),
              ElementsAre("ahead.glb", "behind.glb", "beside.glb", "asks.glb"));
  EXPECT_THAT(uris(select_cut(tree, viewer_criterion({.T_local_camera = looking({0, 0, 200}, Vec3::UnitZ())}, SE3()))),
              IsEmpty());
}

}  // namespace
}  // namespace tileflight::tileset::view_criteria_test
